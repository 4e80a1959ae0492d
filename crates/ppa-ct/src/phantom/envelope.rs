//! Skin surface and the soft tissues below it.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use super::hindfoot::Mortise;
use super::loft::{End, Loft, Section};
use super::parameters::Parameters;
use super::sdf::{Shape, smooth_max, smooth_min, smooth_step};

/// Station above the joint, centre (x, y) and radii every 30° from medial over posterior.
type ShankSection = (f64, [f64; 2], [f64; 12]);

const SHANK: [ShankSection; 9] = [
    (
        -52.0,
        [-3.0, 14.0],
        [
            25.0, 26.0, 29.0, 34.0, 30.0, 28.0, 26.0, 27.0, 30.0, 33.0, 31.0, 28.0,
        ],
    ),
    (
        -28.0,
        [-2.0, 9.0],
        [
            30.0, 29.0, 33.0, 44.0, 35.0, 32.0, 33.0, 32.0, 33.0, 35.0, 34.0, 32.0,
        ],
    ),
    (
        -8.0,
        [-1.0, 8.0],
        [
            31.0, 29.0, 29.0, 42.5, 31.0, 33.0, 35.0, 34.0, 34.0, 36.0, 36.0, 34.0,
        ],
    ),
    (
        12.0,
        [-1.0, 10.0],
        [
            32.0, 28.0, 27.0, 38.5, 29.0, 30.0, 34.0, 34.0, 35.0, 37.0, 36.0, 35.0,
        ],
    ),
    (
        35.0,
        [-2.0, 12.0],
        [
            32.0, 28.0, 28.0, 38.0, 29.0, 29.0, 33.0, 33.0, 34.0, 38.0, 34.0, 33.0,
        ],
    ),
    (
        70.0,
        [-3.0, 14.0],
        [
            33.0, 32.0, 35.0, 40.0, 36.0, 33.0, 34.0, 33.0, 35.0, 38.0, 33.0, 32.0,
        ],
    ),
    (
        110.0,
        [-4.0, 17.0],
        [
            39.0, 41.0, 44.0, 45.0, 45.0, 42.0, 39.0, 37.0, 37.0, 40.5, 36.0, 37.0,
        ],
    ),
    (
        170.0,
        [-5.0, 22.0],
        [
            49.0, 52.0, 51.0, 49.0, 52.0, 53.0, 50.0, 45.0, 43.0, 46.0, 42.0, 45.0,
        ],
    ),
    (
        250.0,
        [-6.0, 27.0],
        [
            56.0, 58.0, 56.0, 53.0, 57.0, 59.0, 56.0, 51.0, 49.0, 51.5, 48.0, 51.0,
        ],
    ),
];

/// Station in front of the joint, corners (x, height above the sole) and the radius they are grown by.
type FootSection = (f64, &'static [[f64; 2]], f64);

const FOOT: [FootSection; 8] = [
    (
        -40.0,
        &[[6.0, 20.0], [5.0, 36.0], [-11.0, 36.0], [-12.0, 20.0]],
        20.0,
    ),
    (
        0.0,
        &[[9.0, 20.0], [8.0, 53.0], [-14.0, 53.0], [-16.0, 20.0]],
        20.0,
    ),
    (
        28.0,
        &[
            [19.0, 36.0],
            [13.0, 58.0],
            [-4.0, 60.0],
            [-20.0, 38.0],
            [-23.0, 18.0],
            [-8.0, 17.0],
            [9.0, 24.0],
        ],
        16.0,
    ),
    (
        58.0,
        &[
            [23.0, 41.0],
            [15.0, 57.0],
            [3.0, 58.0],
            [-22.0, 41.0],
            [-31.0, 20.0],
            [-28.0, 14.0],
            [-10.0, 16.0],
            [11.0, 27.0],
        ],
        13.0,
    ),
    (
        92.0,
        &[
            [25.0, 28.0],
            [20.0, 45.0],
            [6.0, 50.0],
            [-18.0, 37.0],
            [-35.0, 18.0],
            [-33.0, 12.5],
            [-8.0, 13.0],
            [15.0, 18.0],
        ],
        12.0,
    ),
    (
        122.0,
        &[
            [33.0, 17.0],
            [28.0, 30.0],
            [8.0, 37.0],
            [-20.0, 28.0],
            [-40.0, 14.0],
            [-38.0, 11.0],
            [0.0, 11.0],
            [28.0, 12.0],
        ],
        11.0,
    ),
    (
        145.0,
        &[
            [37.0, 13.0],
            [32.0, 22.0],
            [8.0, 26.0],
            [-20.0, 20.0],
            [-42.0, 12.0],
            [-40.0, 10.0],
            [0.0, 10.0],
            [34.0, 10.0],
        ],
        10.0,
    ),
    (
        166.0,
        &[
            [34.0, 10.0],
            [30.0, 16.0],
            [5.0, 18.0],
            [-16.0, 14.0],
            [-32.0, 9.5],
            [-30.0, 9.0],
            [0.0, 9.0],
            [32.0, 9.0],
        ],
        9.0,
    ),
];

/// Ball of the toe and its tip: x, y, height above the sole; radii.
const TOES: [([f64; 3], f64, [f64; 3], f64); 5] = [
    ([27.5, -160.0, 13.5], 13.0, [22.5, -197.5, 11.5], 11.5),
    ([4.5, -160.0, 13.0], 9.5, [3.0, -201.0, 9.0], 8.5),
    ([-11.0, -156.0, 12.0], 9.0, [-12.0, -192.5, 8.5], 8.2),
    ([-25.5, -148.0, 11.0], 8.5, [-25.5, -182.0, 8.2], 7.8),
    ([-38.5, -139.0, 10.5], 8.5, [-37.0, -169.0, 8.2], 8.0),
];

/// The soft tissues.
#[derive(Debug, Clone)]
pub(super) struct Envelope {
    shank: Shape,
    foot: Shape,
    toes: Shape,
    floor: f64,
    /// Table top in limb coordinates: the skin is pressed flat where it would cross it.
    table_normal: Unit<Vector3<f64>>,
    table_offset: f64,
    skin_mm: f64,
    achilles: Shape,
    kager: Shape,
    heel_pad: Shape,
}

impl Envelope {
    pub(super) fn new(p: &Parameters, mortise: &Mortise, table_normal: Unit<Vector3<f64>>) -> Self {
        let floor = -p.sole_depth_mm;
        let shank = Loft::new(
            Isometry3::identity(),
            SHANK
                .iter()
                .map(|(station, centre, radii)| Section::polar(*station, *centre, radii))
                .collect(),
            End::Capped { blend: 12.0 },
            End::Open,
        );
        let malleoli = [
            mortise.ellipsoid([22.0, -1.0, -3.0], [10.0, 15.0, 19.0]),
            mortise.ellipsoid([-26.5, 3.0, -10.0], [10.5, 14.0, 22.0]),
        ];
        let mut leg = vec![Shape::Loft(Box::new(shank))];
        leg.extend(malleoli);

        // Local axes of the foot: x medial, up, and forward.
        let axes = Matrix3::from_rows(&[
            Vector3::x().transpose(),
            Vector3::z().transpose(),
            -Vector3::y().transpose(),
        ]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let foot_from_limb =
            Isometry3::from_parts(Translation3::new(0.0, p.sole_depth_mm, 0.0), turn);
        let foot = Loft::new(
            foot_from_limb,
            FOOT.iter()
                .map(|(station, corners, round)| Section::polygon(*station, corners, *round))
                .collect(),
            End::Capped { blend: 12.0 },
            End::Capped { blend: 10.0 },
        );
        let heel = Shape::ellipsoid([-3.0, 27.0, floor + 30.0], [31.0, 31.5, 34.0]);
        let above = |[x, y, height]: [f64; 3]| [x, y, floor + height];
        let toes = TOES
            .iter()
            .map(|&(base, base_radius, tip, tip_radius)| {
                Shape::round_cone(above(base), base_radius, above(tip), tip_radius)
            })
            .collect();
        Self {
            shank: Shape::union(10.0, leg),
            foot: Shape::union(14.0, vec![Shape::Loft(Box::new(foot)), heel]),
            toes: Shape::union(3.0, toes),
            floor,
            table_normal,
            table_offset: p.table_depth_mm,
            skin_mm: p.skin_mm,
            achilles: Shape::union(
                8.0,
                vec![
                    Shape::round_cone([-3.0, 44.0, -42.0], 6.0, [-3.0, 45.0, 20.0], 4.5),
                    Shape::round_cone([-3.0, 45.0, 20.0], 4.5, [-4.0, 52.0, 110.0], 6.0),
                ],
            ),
            kager: Shape::ellipsoid([-2.0, 31.0, 18.0], [13.0, 12.0, 38.0]),
            heel_pad: Shape::ellipsoid([-3.0, 27.0, floor + 6.0], [26.0, 30.0, 16.0]),
        }
    }

    /// Signed distance to the skin, mm.
    pub(super) fn skin_distance(&self, p: &Point3<f64>) -> f64 {
        let foot = smooth_min(self.foot.distance(p), self.toes.distance(p), 8.0);
        let body = smooth_min(self.shank.distance(p), foot, 22.0);
        let body = smooth_max(body, self.floor - p.z, 8.0);
        let above_table = self.table_normal.dot(&p.coords) - self.table_offset;
        smooth_max(body, above_table, 8.0)
    }

    pub(super) fn skin_mm(&self) -> f64 {
        self.skin_mm
    }

    /// Thickness of skin and fat together at a point: thick over the calf, thin at ankle and shin.
    pub(super) fn cover_mm(&self, p: &Point3<f64>) -> f64 {
        let calf = smooth_step(20.0, 160.0, p.z);
        let behind = smooth_step(-25.0, 25.0, p.y);
        let sole = smooth_step(30.0, 10.0, p.z - self.floor);
        self.skin_mm + 1.0 + calf * (1.0 + 4.0 * behind) + 3.5 * sole
    }

    /// Signed distance to the fat bodies away from the skin: heel pad and Kager's triangle.
    pub(super) fn deep_fat_distance(&self, p: &Point3<f64>) -> f64 {
        let fat = smooth_min(self.kager.distance(p), self.heel_pad.distance(p), 1.0);
        fat.max(-self.achilles.distance(p))
    }

    /// Signed distance to the Achilles tendon.
    pub(super) fn tendon_distance(&self, p: &Point3<f64>) -> f64 {
        self.achilles.distance(p)
    }
}
