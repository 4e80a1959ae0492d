//! Distal tibia and fibula, with joint surfaces cut concentric with the talus.

use nalgebra::{Point3, Vector3};

use super::bone::{Bone, Filling, Gap, Knot};
use super::hindfoot::{Mortise, WIDTH_LEVEL_MM};
use super::loft::{End, Loft, Section};
use super::parameters::{P01, Parameters};
use super::physeal_scar::PhysealScar;
use super::placement::Placement;
use super::sdf::Shape;
use super::smooth::smooth_step;
use super::tibia_fibula_table::{TIBIA_FIBULA, TibiaSection};
use super::trabeculae::Trabeculae;

/// Half the distance between the points where the front and the back of the syndesmosis are measured.
const SYNDESMOSIS_REACH_MM: f64 = 6.0;
/// Shift of the corner at the floor of the incisura per mm of depth, since the grown polygon rounds it.
const INCISURA_FLOOR: f64 = 1.0;

/// Profile of cortex and marrow along the leg.
///
/// Trabeculae run along the leg (distal tibia: PMC3818375). They are assumed 0.5 mm apart and 1.6 times as long as wide.
fn shaft(p: &Parameters, knots: &[(f64, f64, f64)]) -> Filling {
    let trabecular_hu = p.spongy_hu(280.0);
    Filling {
        origin: Point3::origin(),
        direction: Vector3::z_axis(),
        knots: knots
            .iter()
            .map(|&(station_mm, cortex_mm, marrow)| Knot {
                station_mm,
                cortex_mm,
                marrow,
            })
            .collect(),
        trabecular_hu,
        trabeculae: Trabeculae::new(trabecular_hu, 0.5, 1.6),
        scar: None,
    }
}

/// Heights in P01 at which the thickness of the tibial cortex is defined.
pub(super) const CORTEX_LEVELS_MM: [f64; 3] = [25.0, 100.0, 200.0];

/// Thickness of the cortex relative to P01: metaphysis, distal third, middle of the shaft.
fn cortex_shares(p: &Parameters) -> [f64; 3] {
    std::array::from_fn(|level| p.tibia_cortex_mm[level] / P01.tibia_cortex_mm[level])
}

/// Fraction of a shift at the joint that remains at a station.
fn share_of_shift(station: f64) -> f64 {
    smooth_step(50.0, 8.0, station)
}

/// A section of a tibia that matches the width of the trochlea, with its incisura.
fn tibia_section(p: &Parameters, section: &TibiaSection) -> Section {
    let share = share_of_shift(section.station);
    let mut corners = section.corners;
    for (n, [medial, _]) in corners.iter_mut().enumerate() {
        match n {
            0 | 5 => *medial -= share * p.lateral_shift_mm(),
            6 => *medial -= share * (p.lateral_shift_mm() + INCISURA_FLOOR * shallower_mm(p)),
            2 | 3 => *medial += share * p.medial_shift_mm(),
            _ => {}
        }
    }
    Section::polygon(section.station, &corners, section.round)
}

/// Reduction of the depth of the incisura relative to P01.
fn shallower_mm(p: &Parameters) -> f64 {
    P01.incisura_depth_mm - p.incisura_depth_mm
}

/// Outward shift of the fibula relative to P01: all of it with the trochlea's width, and
/// above the malleolus with the space of the syndesmosis.
fn fibula_shift_mm(p: &Parameters, station: f64) -> f64 {
    let mean = |[front, back]: [f64; 2]| 0.5 * (front + back);
    let wider = mean(p.syndesmosis_mm) - mean(P01.syndesmosis_mm);
    share_of_shift(station) * p.lateral_shift_mm() + smooth_step(-4.0, 8.0, station) * wider
}

/// Joint space between fibula and tibia: the measured values [`SYNDESMOSIS_REACH_MM`] in front of and behind the shaft,
/// interpolated linearly between and constant beyond.
fn syndesmosis(p: &Parameters, mortise: &Mortise) -> Gap {
    let [front, back] = p.syndesmosis_mm;
    let posterior = mortise.limb_from_mortise * Vector3::y();
    Gap {
        at_origin_mm: 0.5 * (front + back),
        slope: posterior * ((back - front) / (2.0 * SYNDESMOSIS_REACH_MM)),
        range_mm: [front.min(back), front.max(back)],
    }
}

/// Shaft, flare, plafond and medial malleolus.
///
/// `flexion` is the motion of the talus; the malleoli are cut to its facets.
pub(super) fn tibia(p: &Parameters, mortise: &Mortise, flexion: &Placement, talus: usize) -> Bone {
    let sections = TIBIA_FIBULA
        .tibia
        .iter()
        .map(|section| tibia_section(p, section))
        .collect();
    let shaft_and_flare = Loft::new(
        mortise.limb_from_mortise.inverse(),
        sections,
        End::Capped { blend: 3.0 },
        End::Open,
    );
    let at = |m, b, z| mortise.point(m, b, z);
    let (tip, shift) = (-p.medial_malleolus_mm, p.medial_shift_mm());
    // The malleolus follows its facet; the posterior colliculus ends 4 mm higher.
    let lean = |end: f64| p.medial_lean_mm(WIDTH_LEVEL_MM - end);
    let solid = Shape::union(
        5.0,
        vec![
            Shape::Loft(Box::new(shaft_and_flare)),
            // Anterior colliculus, and the posterior one above it.
            Shape::round_cone(
                at(17.5 + shift, -4.0, 8.0),
                8.0,
                at(22.0 + shift + lean(tip), -4.5, tip + 5.5),
                5.5,
            ),
            Shape::round_cone(
                at(17.0 + shift, 4.0, 8.0),
                8.0,
                at(21.0 + shift + lean(tip + 4.0), 5.5, tip + 9.5),
                5.5,
            ),
        ],
    );
    let mortise_space = Shape::common(
        1.5,
        vec![
            grown(p.superior_gutter_mm, mortise.cone(p)),
            grown(
                p.medial_gutter_mm,
                Shape::HalfSpace(mortise.medial_facet(p).placed(flexion)),
            ),
        ],
    );
    // The tubercles next to the fibula end at the joint line, while the lips in front and behind extend lower.
    let below_tubercles = mortise.wall(
        [-0.45, 0.0, -0.89],
        [-14.0 - p.lateral_shift_mm(), 0.0, -3.0],
    );
    // Assumed 12.5 mm above the joint, with a hump in front and medially (Poland's), wavy elsewhere.
    let scar_mm = 12.5;
    let hump = |medial, posterior, mm| (at(medial, posterior, scar_mm).into(), mm);
    let scar = PhysealScar {
        humps: vec![
            hump(9.0, -8.0, 3.0),
            hump(-9.0, 9.0, -1.6),
            hump(-10.0, -7.0, 1.2),
            hump(8.0, 10.0, 1.0),
        ],
        axis: Vector3::z_axis(),
        level: at(0.0, 0.0, scar_mm).into(),
        size: 1.0,
    };
    let [thin, distal, middle] = cortex_shares(p);
    let filling = shaft(
        p,
        &[
            (5.0, 1.0 * thin, 0.0),
            (CORTEX_LEVELS_MM[0], 1.2 * thin, 0.0),
            (60.0, 2.5 * distal, 0.7),
            (CORTEX_LEVELS_MM[1], 3.6 * distal, 1.0),
            (CORTEX_LEVELS_MM[2], 4.8 * middle, 1.0),
        ],
    );
    Bone {
        name: "tibia",
        solid: Shape::common(2.0, vec![solid, below_tubercles]),
        hollows: vec![mortise_space],
        yields_to: vec![(talus, Gap::even(0.8 * p.medial_gutter_mm))],
        filling: Filling {
            scar: Some(scar),
            ..filling
        },
        joints: vec![],
    }
}

/// Shaft and lateral malleolus; `flexion` as for [`tibia`].
pub(super) fn fibula(
    p: &Parameters,
    mortise: &Mortise,
    flexion: &Placement,
    [talus, calcaneus, tibia]: [usize; 3],
) -> Bone {
    let sections = TIBIA_FIBULA
        .fibula
        .iter()
        .map(|section| {
            let [medial, posterior] = section.centre;
            let medial = medial - fibula_shift_mm(p, section.station);
            Section::ellipse(section.station, [medial, posterior], section.semi_axes)
        })
        .collect();
    let shaft_to_malleolus = Loft::new(
        mortise.limb_from_mortise.inverse(),
        sections,
        End::Capped { blend: 5.0 },
        End::Open,
    );
    let (tip, shift) = (-p.lateral_malleolus_mm, p.lateral_shift_mm());
    let solid = Shape::union(
        4.0,
        vec![
            Shape::Loft(Box::new(shaft_to_malleolus)),
            Shape::round_cone(
                mortise.point(-25.0 - shift, 2.5, -6.0),
                8.0,
                mortise.point(-26.0 - shift, 4.5, tip + 5.5),
                5.5,
            ),
        ],
    );
    let [thin, distal, _] = cortex_shares(p);
    Bone {
        name: "fibula",
        solid,
        hollows: vec![grown(
            p.lateral_gutter_mm,
            Shape::HalfSpace(mortise.lateral_facet(p).placed(flexion)),
        )],
        yields_to: vec![
            (talus, Gap::even(0.8 * p.lateral_gutter_mm)),
            (tibia, syndesmosis(p, mortise)),
            (calcaneus, Gap::even(p.small_joint_mm)),
        ],
        filling: shaft(
            p,
            &[
                (0.0, 0.9 * thin, 0.0),
                (20.0, 1.2 * thin, 0.0),
                (50.0, 1.8 * distal, 0.6),
                (100.0, 2.4 * distal, 1.0),
            ],
        ),
        joints: vec![],
    }
}

fn grown(margin: f64, shape: Shape) -> Shape {
    Shape::Grown {
        margin,
        shape: Box::new(shape),
    }
}
