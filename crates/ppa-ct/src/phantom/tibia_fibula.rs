//! Distal tibia and fibula, whose joint surfaces are cut concentric with the talus.

use nalgebra::{Point3, Vector3};

use super::bone::{Bone, Filling, Knot};
use super::hindfoot::Mortise;
use super::loft::{End, Loft, Section};
use super::parameters::Parameters;
use super::sdf::Shape;

/// Corners of a tibial section as (medial, posterior) in the mortise frame, to be grown by a radius: anterolateral
/// (Chaput) tubercle, front, anteromedial, posteromedial, back, posterolateral (Volkmann) tubercle,
/// floor of the fibular incisura.
type TibiaSection = (f64, [[f64; 2]; 7], f64);

/// From the joint line proximally, station in mm above the joint centre.
const TIBIA: [TibiaSection; 8] = [
    (
        -6.0,
        [
            [-18.7, -11.5],
            [1.0, -15.5],
            [20.0, -9.5],
            [18.5, 9.5],
            [1.0, 17.0],
            [-15.0, 11.5],
            [-11.5, -0.5],
        ],
        3.5,
    ),
    (
        4.0,
        [
            [-18.7, -11.5],
            [1.0, -15.5],
            [20.0, -9.0],
            [18.5, 9.5],
            [1.0, 16.5],
            [-15.5, 11.0],
            [-11.5, -0.5],
        ],
        3.5,
    ),
    (
        15.0,
        [
            [-18.0, -10.5],
            [1.0, -14.5],
            [17.0, -8.5],
            [16.0, 9.0],
            [1.0, 15.0],
            [-15.0, 10.0],
            [-11.5, -0.5],
        ],
        3.5,
    ),
    (
        28.0,
        [
            [-14.0, -8.0],
            [2.0, -13.0],
            [13.5, -7.5],
            [13.0, 8.5],
            [1.0, 13.0],
            [-12.0, 8.5],
            [-11.0, -0.5],
        ],
        4.0,
    ),
    (
        48.0,
        [
            [-9.5, -6.0],
            [2.5, -11.5],
            [10.5, -6.0],
            [10.0, 7.5],
            [0.5, 10.5],
            [-9.0, 7.5],
            [-9.5, 0.5],
        ],
        4.0,
    ),
    (
        90.0,
        [
            [-8.0, -4.0],
            [4.0, -11.5],
            [9.0, -4.5],
            [8.0, 7.0],
            [0.0, 9.0],
            [-8.0, 6.5],
            [-8.5, 1.5],
        ],
        4.0,
    ),
    (
        160.0,
        [
            [-8.0, -2.5],
            [5.5, -13.0],
            [8.5, -4.0],
            [7.5, 8.0],
            [0.0, 9.0],
            [-8.0, 6.0],
            [-9.0, 2.0],
        ],
        4.0,
    ),
    (
        260.0,
        [
            [-9.0, -2.0],
            [6.0, -14.5],
            [9.5, -4.0],
            [8.5, 9.0],
            [0.0, 10.0],
            [-9.5, 6.5],
            [-10.5, 2.0],
        ],
        4.5,
    ),
];

/// Station, centre (medial, posterior) and semi-axes of the fibula in the mortise frame.
const FIBULA: [(f64, [f64; 2], [f64; 2]); 8] = [
    (-14.0, [-24.6, 3.0], [9.0, 10.5]),
    (-4.0, [-23.4, 2.5], [9.0, 10.8]),
    (8.0, [-24.0, 3.0], [8.3, 10.0]),
    (22.0, [-23.5, 3.0], [7.3, 8.2]),
    (45.0, [-22.5, 3.5], [6.0, 6.8]),
    (90.0, [-24.0, 4.5], [5.5, 6.2]),
    (160.0, [-28.5, 6.0], [5.8, 6.5]),
    (260.0, [-34.0, 7.0], [6.2, 7.0]),
];

/// Profile of cortex and marrow along the leg.
fn shaft(knots: &[(f64, f64, f64)]) -> Filling {
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
        trabecular_hu: 280.0,
    }
}

/// Shaft, flare, plafond and medial malleolus.
pub(super) fn tibia(p: &Parameters, mortise: &Mortise, talus: usize) -> Bone {
    let sections = TIBIA
        .iter()
        .map(|(station, corners, round)| Section::polygon(*station, corners, *round))
        .collect();
    let shaft_and_flare = Loft::new(
        mortise.limb_from_mortise.inverse(),
        sections,
        End::Capped { blend: 3.0 },
        End::Open,
    );
    let at = |m, b, z| mortise.point(m, b, z);
    let tip = -p.medial_malleolus_mm;
    let solid = Shape::union(
        5.0,
        vec![
            Shape::Loft(Box::new(shaft_and_flare)),
            // Anterior and, higher, posterior colliculus.
            Shape::round_cone(at(17.5, -4.0, 8.0), 8.0, at(22.0, -4.5, tip + 5.5), 5.5),
            Shape::round_cone(at(17.0, 4.0, 8.0), 8.0, at(21.0, 5.5, tip + 9.5), 5.5),
        ],
    );
    let mortise_space = Shape::common(
        1.5,
        vec![
            grown(p.superior_gutter_mm, mortise.cone(p)),
            grown(p.medial_gutter_mm, mortise.medial_facet(p)),
        ],
    );
    // The tubercles beside the fibula end at the joint line, while the lips in front and behind reach lower.
    let below_tubercles = mortise.wall([-0.45, 0.0, -0.89], [-14.0, 0.0, -3.0]);
    Bone {
        name: "tibia",
        solid: Shape::common(2.0, vec![solid, below_tubercles]),
        hollows: vec![mortise_space],
        yields_to: vec![(talus, 0.8 * p.medial_gutter_mm)],
        filling: shaft(&[
            (5.0, 1.0, 0.0),
            (25.0, 1.2, 0.0),
            (60.0, 2.5, 0.7),
            (100.0, 3.6, 1.0),
            (200.0, 4.8, 1.0),
        ]),
    }
}

/// Shaft and lateral malleolus.
pub(super) fn fibula(p: &Parameters, mortise: &Mortise, tibia: usize, talus: usize) -> Bone {
    let sections = FIBULA
        .iter()
        .map(|&(station, centre, semi)| Section::ellipse(station, centre, semi))
        .collect();
    let shaft_to_malleolus = Loft::new(
        mortise.limb_from_mortise.inverse(),
        sections,
        End::Capped { blend: 5.0 },
        End::Open,
    );
    let tip = -p.lateral_malleolus_mm;
    let solid = Shape::union(
        4.0,
        vec![
            Shape::Loft(Box::new(shaft_to_malleolus)),
            Shape::round_cone(
                mortise.point(-25.0, 2.5, -6.0),
                8.0,
                mortise.point(-26.0, 4.5, tip + 5.5),
                5.5,
            ),
        ],
    );
    Bone {
        name: "fibula",
        solid,
        hollows: vec![grown(p.lateral_gutter_mm, mortise.lateral_facet(p))],
        yields_to: vec![
            (talus, 0.8 * p.lateral_gutter_mm),
            (tibia, p.syndesmosis_mm),
        ],
        filling: shaft(&[
            (0.0, 0.9, 0.0),
            (20.0, 1.2, 0.0),
            (50.0, 1.8, 0.6),
            (100.0, 2.4, 1.0),
        ]),
    }
}

fn grown(margin: f64, shape: Shape) -> Shape {
    Shape::Grown {
        margin,
        shape: Box::new(shape),
    }
}
