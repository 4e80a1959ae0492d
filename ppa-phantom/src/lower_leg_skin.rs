//! Skin, fat pads and Achilles tendon of a lower leg and foot.

use std::f64::consts::TAU;

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation2, Rotation3, Translation3, UnitQuaternion, Vector2,
    Vector3,
};

use super::envelope::{Bounded, Cover, Envelope};
use super::hindfoot::{Mortise, SOLE_DEPTH_MM, WIDTH_LEVEL_MM, heel_valgus};
use super::loft::{End, Loft, Section};
use super::lower_leg_skin_table::{SKIN, ShankSection};
use super::midfoot_forefoot::ray_shifts_mm;
use super::parameters::{P01, Parameters, TABLES};
use super::placement::Placement;
use super::sdf::{Plane, Shape};
use super::smooth::smooth_step;

/// Centre and semi-axes of the heel.
const HEEL: ([f64; 3], [f64; 3]) = ([-3.0, 27.0, 30.0 - SOLE_DEPTH_MM], [31.0, 34.5, 34.0]);

/// Radius of the rounded edge of the flat patch where the table has pressed the skin; heel and calf would sink
/// at least as deep, so that their middle touches the table.
const TABLE_EDGE_MM: f64 = 3.0;

/// Pose of the limb on the table.
pub(super) struct Rest {
    /// Rise of the tibial axis from the table towards the knee.
    pub rise_rad: f64,
    /// Distance from the joint centre back to the table top, perpendicular to the table.
    pub depth_mm: f64,
}

impl Rest {
    /// Heel and calf sink into the table as deep as those of P01, whose joint centre is 58 mm above it and which rises by 3°.
    pub(super) fn new(p: &Parameters, foot_placement: &Placement) -> Self {
        const P01_RISE_RAD: f64 = 3.0_f64.to_radians();
        const CALF_MM: f64 = 250.0;
        const CALF_RADIUS_MM: f64 = 53.0;
        let back =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -P01_RISE_RAD) * Vector3::y();
        let heel = Point3::from(HEEL.0);
        let heel_back = back.dot(&(foot_placement * (heel_valgus(p) * heel) / p.size - heel));
        let calf_back = 2.0 * CALF_RADIUS_MM * (p.calf_girth - 1.0);
        Self {
            rise_rad: P01_RISE_RAD + (calf_back - heel_back) / CALF_MM,
            depth_mm: (58.0 + heel_back) * p.size,
        }
    }
}

/// Relative widening of the back of a section of the shank against P01; in front, the shin is just below the skin in every leg.
fn wider_behind(p: &Parameters, station: f64) -> f64 {
    let calf = smooth_step(75.0, 200.0, station);
    // Towards the malleoli, bone is just below the skin all around.
    let ankle = smooth_step(-20.0, 60.0, station) * (1.0 - calf);
    ankle * (p.ankle_girth - 1.0) + calf * (p.calf_girth - 1.0)
}

/// Rotation of a section of the shank with the bones of the leg, relative to P01.
fn turn_rad(p: &Parameters, station: f64) -> f64 {
    smooth_step(10.0, 90.0, station) * (P01.mortise_angle_rad - p.mortise_angle_rad)
}

/// A section of the shank with the girth of the leg, rotated with its bones.
fn shank_section(p: &Parameters, section: &ShankSection) -> Section {
    let wider = wider_behind(p, section.station);
    let radii: [f64; 12] = std::array::from_fn(|n| {
        // From zero in front to twice the mean behind.
        let behind = 1.0 + (n as f64 / 12.0 * TAU).sin();
        section.radii[n] * (1.0 + wider * behind)
    });
    Section::polar(section.station, section.centre, &radii).turned(turn_rad(p, section.station))
}

/// A point at a depth below the skin at the back of a section of the shank.
fn below_the_back(p: &Parameters, section: &ShankSection, depth_mm: f64) -> [f64; 3] {
    const BACK: usize = 3; // the fourth radius is the one at 90°
    let station = section.station;
    let radius = section.radii[BACK] * (1.0 + 2.0 * wider_behind(p, station));
    let place = Vector2::from(section.centre) + Vector2::new(0.0, radius - depth_mm);
    let place = Rotation2::new(turn_rad(p, station)) * place;
    [place.x, place.y, station]
}

/// The Achilles tendon, from the heel to the start of the calf, in the drawing of the leg.
fn achilles(p: &Parameters, insertion: Point3<f64>) -> Shape {
    let [ankle, above, calf] = [(3, 3.6), (4, 3.8), (6, 10.0)]
        .map(|(section, depth_mm)| below_the_back(p, &SKIN.shank[section], depth_mm));
    Shape::union(
        8.0,
        vec![
            Shape::round_cone(insertion.into(), 6.0, ankle, 4.6),
            Shape::round_cone(ankle, 4.6, above, 4.7),
            Shape::round_cone(above, 4.7, calf, 6.0),
        ],
    )
}

fn shank(p: &Parameters, mortise: &Mortise) -> Shape {
    let sections = SKIN.shank.iter().map(|section| shank_section(p, section));
    let loft = Loft::new(
        Isometry3::identity(),
        sections.collect(),
        End::Capped { blend: 12.0 },
        End::Open,
    );
    let (medial, lateral) = (p.medial_shift_mm(), p.lateral_shift_mm());
    let lean = p.medial_lean_mm(WIDTH_LEVEL_MM + p.medial_malleolus_mm);
    let tip = TABLES.lateral_malleolus_mm - p.lateral_malleolus_mm;
    Shape::union(
        10.0,
        vec![
            Shape::Loft(Box::new(loft)),
            mortise.ellipsoid([22.0 + medial + lean, -1.0, -3.0], [10.0, 15.0, 19.0]),
            mortise.ellipsoid(
                [-26.5 - lateral, 3.0, -4.0 + tip.min(0.0)],
                [10.5, 14.0, 28.0],
            ),
        ],
    )
}

fn foot(p: &Parameters) -> Shape {
    // Local axes of the foot: x medial, up, and forward.
    let axes = Matrix3::from_rows(&[
        Vector3::x().transpose(),
        Vector3::z().transpose(),
        -Vector3::y().transpose(),
    ]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let foot_from_limb = Isometry3::from_parts(Translation3::new(0.0, SOLE_DEPTH_MM, 0.0), turn);
    let loft = Loft::new(
        foot_from_limb,
        SKIN.foot
            .iter()
            .map(|section| Section::polygon(section.station, &section.corners, section.round))
            .collect(),
        End::Capped { blend: 12.0 },
        End::Capped { blend: 10.0 },
    );
    let heel = Shape::ellipsoid(HEEL.0, HEEL.1).placed(&heel_valgus(p));
    Shape::union(14.0, vec![Shape::Loft(Box::new(loft)), heel])
}

/// Balls of the toes and their tips.
fn toes(p: &Parameters) -> impl Iterator<Item = (Point3<f64>, f64, Point3<f64>, f64)> {
    SKIN.toes
        .iter()
        .zip(ray_shifts_mm(p))
        .map(|(toe, forward)| {
            let place =
                |[x, y, height]: [f64; 3]| Point3::new(x, y - forward, height - SOLE_DEPTH_MM);
            (
                place(toe.ball),
                toe.ball_radius,
                place(toe.tip),
                toe.tip_radius,
            )
        })
}

/// The standing plane, normal downwards.
pub(super) fn sole() -> Plane {
    Plane {
        normal: -Vector3::z_axis(),
        offset: SOLE_DEPTH_MM,
    }
}

/// Places the skin, drawn in P01's size, with `leg_placement`, and that of the foot with `foot_placement`.
pub(super) fn envelope(
    p: &Parameters,
    mortise: &Mortise,
    [leg_placement, foot_placement]: [&Placement; 2],
    table: Shape,
) -> Envelope {
    let toes = toes(p)
        .map(|(ball, ball_radius, tip, tip_radius)| {
            Shape::round_cone(ball.into(), ball_radius, tip.into(), tip_radius)
        })
        .collect();
    let heel = foot_placement * heel_valgus(p);
    let from_leg = leg_placement.inverse();
    let insertion = from_leg * (heel * Point3::new(-3.0, 44.0, -42.0));
    let achilles = achilles(p, insertion);
    // Kager's fat, between the tendon, which it follows, and the deep flexors behind the tibia.
    let [_, back, _] = below_the_back(p, &SKIN.shank[3], 17.5);
    let kager = Shape::common(
        3.0,
        vec![
            Shape::ellipsoid([-2.0, back, 18.0], [13.0, 12.0, 38.0]),
            mortise.wall([0.0, -1.0, 0.0], [0.0, 23.5, 0.0]),
        ],
    );
    let heel_pad = Shape::ellipsoid([-3.0, 27.0, 6.0 - SOLE_DEPTH_MM], [26.0, 30.0, 16.0]);
    let size = leg_placement.scaling();
    let sole = sole().placed(foot_placement);
    Envelope {
        first: foot(p).placed(foot_placement),
        parts: vec![
            (
                Bounded::new(Shape::union(3.0, toes).placed(foot_placement)),
                8.0 * size,
            ),
            (
                Bounded::new(shank(p, mortise).placed(leg_placement)),
                22.0 * size,
            ),
        ],
        cuts: vec![(Shape::HalfSpace(sole), 8.0 * size), (table, TABLE_EDGE_MM)],
        skin_mm: p.skin_mm * size,
        cover: Cover {
            even_mm: size,
            calf: Some(size),
            sole: Some(sole),
        },
        tendon: Some(achilles.placed(leg_placement)),
        fat: vec![kager.placed(leg_placement), heel_pad.placed(&heel)],
    }
}

/// Foremost point of the skin of the toes, given the transform to the frame in which -y is forward.
pub(super) fn toe_tip(
    p: &Parameters,
    foot_placement: &Placement,
    ct_from_limb: &Isometry3<f64>,
) -> Point3<f64> {
    toes(p)
        .map(|(_, _, tip, radius)| {
            ct_from_limb * (foot_placement * tip) - radius * foot_placement.scaling() * Vector3::y()
        })
        .fold(Point3::from(Vector3::repeat(f64::INFINITY)), |best, tip| {
            if tip.y < best.y { tip } else { best }
        })
}
