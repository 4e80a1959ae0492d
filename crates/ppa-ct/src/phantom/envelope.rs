//! Skin surface and the soft tissues below it.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use super::hindfoot::Mortise;
use super::loft::{End, Loft, Section};
use super::parameters::Parameters;
use super::sdf::{Bounds, Shape, smooth_max, smooth_min, smooth_step};

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
            [26.0, 28.0],
            [20.5, 49.0],
            [6.0, 54.0],
            [-18.0, 41.0],
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
            [34.0, 17.0],
            [28.5, 33.0],
            [8.0, 40.0],
            [-20.0, 31.0],
            [-40.0, 14.5],
            [-38.0, 11.0],
            [0.0, 11.0],
            [28.0, 12.0],
        ],
        11.0,
    ),
    (
        145.0,
        &[
            [38.0, 13.0],
            [32.0, 23.5],
            [8.0, 28.0],
            [-20.0, 22.0],
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
            [35.0, 10.5],
            [30.0, 18.0],
            [5.0, 20.5],
            [-16.0, 16.0],
            [-32.0, 10.0],
            [-30.0, 9.0],
            [0.0, 9.0],
            [32.0, 9.0],
        ],
        9.0,
    ),
];

/// Ball of the toe and its tip: x, y, height above the sole; radii.
const TOES: [([f64; 3], f64, [f64; 3], f64); 5] = [
    ([27.5, -160.0, 14.0], 13.5, [22.5, -196.5, 11.5], 11.5),
    ([4.5, -160.0, 14.0], 10.5, [3.0, -198.5, 9.0], 8.8),
    ([-11.0, -156.0, 13.0], 10.0, [-12.0, -190.5, 8.8], 8.5),
    ([-25.5, -148.0, 12.0], 9.2, [-25.5, -181.0, 8.5], 8.2),
    ([-38.5, -139.0, 11.0], 8.8, [-37.0, -168.0, 8.5], 8.2),
];

/// Where the table has pressed the skin flat, the edge of the flat patch is rounded over so many mm; heel and calf would
/// sink at least as deep, so that their middle touches the table.
const TABLE_EDGE_MM: f64 = 3.0;

/// A shape and the box around it, which tells when the shape is too far away to matter.
#[derive(Debug, Clone)]
struct Bounded {
    shape: Shape,
    bounds: Bounds,
}

impl Bounded {
    fn new(shape: Shape) -> Self {
        Self {
            bounds: shape.bounds(),
            shape,
        }
    }
}

/// The soft tissues.
#[derive(Debug, Clone)]
pub(super) struct Envelope {
    shank: Bounded,
    foot: Bounded,
    toes: Bounded,
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
        let heel = Shape::ellipsoid([-3.0, 27.0, floor + 30.0], [31.0, 34.5, 34.0]);
        let above = |[x, y, height]: [f64; 3]| [x, y, floor + height];
        let toes = TOES
            .iter()
            .map(|&(base, base_radius, tip, tip_radius)| {
                Shape::round_cone(above(base), base_radius, above(tip), tip_radius)
            })
            .collect();
        Self {
            shank: Bounded::new(Shape::union(10.0, leg)),
            foot: Bounded::new(Shape::union(14.0, vec![Shape::Loft(Box::new(foot)), heel])),
            toes: Bounded::new(Shape::union(3.0, toes)),
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

    /// The most forward point of the skin, given the transform to the frame in which -y is forward.
    pub(super) fn toe_tip(&self, ct_from_limb: &Isometry3<f64>) -> Point3<f64> {
        TOES.iter()
            .map(|&(_, _, [x, y, height], radius)| {
                ct_from_limb * Point3::new(x, y, self.floor + height) - radius * Vector3::y()
            })
            .fold(Point3::from(Vector3::repeat(f64::INFINITY)), |best, tip| {
                if tip.y < best.y { tip } else { best }
            })
    }

    /// Signed distance to the skin, mm.
    pub(super) fn skin_distance(&self, p: &Point3<f64>) -> f64 {
        let mut body = self.foot.shape.distance(p);
        for (part, blend) in [(&self.toes, 8.0), (&self.shank, 22.0)] {
            if part.bounds.distance(p) < body + blend {
                body = smooth_min(body, part.shape.distance(p), blend);
            }
        }
        let body = smooth_max(body, self.floor - p.z, 8.0);
        let above_table = self.table_normal.dot(&p.coords) - self.table_offset;
        smooth_max(body, above_table, TABLE_EDGE_MM)
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
