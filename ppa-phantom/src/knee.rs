//! A knee, built from the same shapes.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use ppa_core::Side;

use super::bone::{Bone, Filling, Gap, Knot, Skeleton};
use super::envelope::{Bounded, Cover, Envelope};
use super::limb::{Limb, ScanRange};
use super::loft::{End, Loft, Section};
use super::sdf::{Plane, Shape};
use super::texture::Texture;
use super::trabeculae::Trabeculae;

/// Station above the joint line, centre (medial, posterior) and semi-axes of the femur. Width over the condyles 80 mm, of
/// the tibial plateau 75 mm, shafts of 28 mm: typical of an average man, without a source.
const FEMUR: [(f64, [f64; 2], [f64; 2]); 6] = [
    (22.0, [0.0, 0.0], [36.0, 23.0]),
    (35.0, [0.0, -3.0], [31.0, 19.0]),
    (55.0, [0.0, -5.0], [22.0, 16.0]),
    (85.0, [-1.0, -6.0], [16.0, 15.0]),
    (120.0, [-3.0, -6.0], [14.5, 14.5]),
    (180.0, [-6.0, -6.0], [14.0, 14.5]),
];
/// The same of the tibia, station below the joint line first.
const TIBIA: [(f64, [f64; 2], [f64; 2]); 7] = [
    (-180.0, [1.0, -3.0], [11.5, 13.0]),
    (-120.0, [1.0, -4.0], [13.0, 15.5]),
    (-70.0, [0.0, -4.0], [16.5, 18.0]),
    (-40.0, [0.0, -3.0], [24.0, 20.5]),
    (-20.0, [0.0, 0.0], [34.0, 23.5]),
    (-8.0, [0.0, 2.0], [37.5, 24.5]),
    (2.0, [0.0, 2.0], [37.5, 24.5]),
];
/// The same of the fibula.
const FIBULA: [(f64, [f64; 2], [f64; 2]); 4] = [
    (-180.0, [-26.0, 14.0], [6.5, 7.0]),
    (-60.0, [-33.0, 18.0], [6.0, 6.5]),
    (-35.0, [-35.0, 18.0], [9.5, 10.5]),
    (-14.0, [-35.0, 17.0], [8.0, 9.0]),
];
/// The same of the skin, from calf to thigh.
const SKIN: [(f64, [f64; 2], [f64; 2]); 7] = [
    (-180.0, [-6.0, 19.0], [54.0, 58.0]),
    (-120.0, [-6.0, 19.0], [57.0, 61.0]),
    (-60.0, [-4.0, 11.0], [55.0, 54.0]),
    (-10.0, [-1.0, 3.0], [55.0, 55.0]),
    (30.0, [0.0, 0.0], [56.0, 62.0]),
    (90.0, [0.0, 5.0], [63.0, 66.0]),
    (180.0, [0.0, 12.0], [74.0, 76.0]),
];
/// Gap between femur and tibia, and femur and patella: cartilage and menisci.
const JOINT_MM: f64 = 4.5;
const SKIN_MM: f64 = 1.5;
/// Extent of the scan above and below the joint line, mm.
const REACH_MM: f64 = 140.0;
const TABLE_DEPTH_MM: f64 = 60.0;
const JOINT_CENTRE_MM: [f64; 3] = [-95.0, 10.0, -150.0];

fn loft(sections: &[(f64, [f64; 2], [f64; 2])], ends: [End; 2]) -> Shape {
    let sections = sections
        .iter()
        .map(|&(station, centre, semi)| Section::ellipse(station, centre, semi))
        .collect();
    let [first, last] = ends;
    Shape::Loft(Box::new(Loft::new(
        Isometry3::identity(),
        sections,
        first,
        last,
    )))
}

/// Trabeculae along the leg, with the spacing assumed for the tarsal bones.
fn trabeculae(mean_hu: f64) -> Trabeculae {
    Trabeculae::new(mean_hu, 0.6, 1.6)
}

/// Cortex and marrow of a shaft that begins at the joint and runs along `away`.
fn shaft(away: Vector3<f64>, cortex_mm: f64) -> Filling {
    let knot = |station_mm, cortex_mm, marrow| Knot {
        station_mm,
        cortex_mm,
        marrow,
    };
    Filling {
        origin: Point3::origin(),
        direction: Unit::new_normalize(away),
        knots: vec![
            knot(30.0, 1.0, 0.0),
            knot(70.0, 2.0, 0.6),
            knot(130.0, cortex_mm, 1.0),
        ],
        trabecular_hu: 220.0,
        trabeculae: trabeculae(220.0),
        scar: None,
    }
}

fn bone(name: &'static str, solid: Shape, yields_to: &[usize], filling: Filling) -> Bone {
    Bone {
        name,
        solid,
        hollows: vec![],
        yields_to: yields_to
            .iter()
            .map(|&other| (other, Gap::even(JOINT_MM)))
            .collect(),
        filling,
        joints: vec![],
    }
}

fn skeleton() -> Skeleton {
    let cap = End::Capped { blend: 6.0 };
    let femur = Shape::union(
        8.0,
        vec![
            loft(&FEMUR, [cap, End::Open]),
            Shape::ellipsoid([22.0, 6.0, 22.0], [15.0, 30.0, 21.0]),
            Shape::ellipsoid([-21.0, 6.0, 22.0], [16.0, 29.0, 20.5]),
        ],
    );
    // Between the condyles, from below and behind.
    let notch = Shape::ellipsoid([0.0, 20.0, 4.0], [9.0, 24.0, 20.0]);
    let mut femur = bone("femur", femur, &[], shaft(Vector3::z(), 5.0));
    femur.hollows.push(notch);
    let eminence = |medial| Shape::round_cone([medial, 4.0, -4.0], 4.5, [medial, 4.0, 4.5], 2.0);
    let tuberosity = Shape::ellipsoid([-3.0, -21.0, -42.0], [8.0, 7.0, 13.0]);
    let tibia = Shape::union(
        5.0,
        vec![
            loft(&TIBIA, [End::Open, cap]),
            eminence(5.0),
            eminence(-5.0),
            tuberosity,
        ],
    );
    let patella = Shape::turned_ellipsoid(
        [-1.0, -33.0, 30.0],
        [21.5, 11.0, 21.5],
        Rotation3::from_axis_angle(&Vector3::x_axis(), -0.1),
    );
    let mut fibula = bone(
        "fibula",
        loft(&FIBULA, [End::Open, End::Capped { blend: 5.0 }]),
        &[0],
        shaft(-Vector3::z(), 2.5),
    );
    fibula.yields_to.push((1, Gap::even(1.8)));
    Skeleton::new(vec![
        femur,
        bone("tibia", tibia, &[0], shaft(-Vector3::z(), 4.5)),
        bone(
            "patella",
            patella,
            &[0],
            Filling::spongy(1.2, 260.0, trabeculae(260.0)),
        ),
        fibula,
    ])
}

impl Limb {
    /// A right or left knee, extended and supine, with 14 cm of thigh and of calf: femur, tibia, fibula and patella.
    ///
    /// Simpler than the lower leg, and without published dimensions: it demonstrates that nothing depends on an ankle.
    /// The left one is the mirror image of the right one. The joint centre is in the middle of the joint line.
    pub fn knee(side: Side) -> Self {
        let table = Plane {
            normal: Vector3::y_axis(),
            offset: TABLE_DEPTH_MM,
        };
        let envelope = Envelope {
            first: loft(&SKIN, [End::Open, End::Open]),
            parts: vec![(
                Bounded::new(Shape::ellipsoid([-1.0, -38.0, 28.0], [30.0, 22.0, 34.0])),
                16.0,
            )],
            cuts: vec![(Shape::HalfSpace(table), 4.0)],
            skin_mm: SKIN_MM,
            cover: Cover {
                even_mm: 4.0,
                calf: None,
                sole: None,
            },
            tendon: Some(Shape::union(
                4.0,
                vec![
                    Shape::round_cone([-1.0, -46.0, 46.0], 4.0, [-1.0, -34.0, 110.0], 5.0),
                    Shape::round_cone([-1.0, -45.0, 14.0], 3.5, [-3.0, -32.0, -36.0], 3.5),
                ],
            )),
            // Hoffa's fat pad.
            fat: vec![Shape::ellipsoid([-1.0, -30.0, 2.0], [18.0, 10.0, 13.0])],
        };
        Self {
            side,
            ct_from_limb: Isometry3::from_parts(
                Translation3::from(JOINT_CENTRE_MM),
                UnitQuaternion::identity(),
            ),
            skeleton: skeleton(),
            envelope,
            plate: None,
            scan: ScanRange {
                low: [-120.0, -120.0, -REACH_MM],
                high: [120.0, 120.0, REACH_MM],
                cut: [Some(-REACH_MM), Some(REACH_MM)],
            },
            table_top_y: JOINT_CENTRE_MM[1] + TABLE_DEPTH_MM,
            texture_share: 0.22,
            texture: Texture::new(0),
        }
    }
}
