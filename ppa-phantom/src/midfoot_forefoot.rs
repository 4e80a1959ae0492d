//! Navicular, cuboid, cuneiforms, metatarsals, phalanges and sesamoids.
//!
//! Solids overlap on purpose: each is cut back to leave a joint space to its neighbours, which gives the flat and cupped faces of real bones.

use nalgebra::{Rotation3, Vector3};

use super::bone::{Bone, Filling, Gap};
use super::forefoot_table::{FOREFOOT, Metatarsal};
use super::parameters::{Parameters, TABLES};
use super::sdf::Shape;
use super::trabeculae::Trabeculae;

/// Indices of the hindfoot bones that carry the midfoot.
pub(super) struct Hindfoot {
    pub talus: usize,
    pub calcaneus: usize,
}

/// Sesamoids below the head of the first metatarsal: centre and semi-axes in P01. Sizes are assumed: 12 mm long, the
/// medial one wider; cut to fit the head above them.
const SESAMOIDS: [(&str, [f64; 3], [f64; 3]); 2] = [
    ("medial sesamoid", [32.2, -131.0, -75.2], [4.8, 6.0, 3.2]),
    ("lateral sesamoid", [20.8, -131.5, -75.2], [4.2, 5.6, 3.2]),
];

impl Metatarsal {
    fn solid(&self, head: [f64; 3]) -> Shape {
        Shape::union(
            4.0,
            vec![
                Shape::block(self.base, self.base_semi, 4.5, Rotation3::identity()),
                Shape::round_cone(self.base, self.waist + 1.2, head, self.waist),
                Shape::ellipsoid(head, self.head_semi),
            ],
        )
    }
}

fn phalanx(base: [f64; 3], end: [f64; 3], waist: f64) -> Shape {
    Shape::union(
        2.5,
        vec![
            Shape::ellipsoid(base, [1.6 * waist, 1.25 * waist, 1.4 * waist]),
            Shape::round_cone(base, waist, end, 0.9 * waist),
            Shape::ellipsoid(end, [1.4 * waist, 1.1 * waist, 1.15 * waist]),
        ],
    )
}

/// Forward shift of the heads of the five metatarsals and their toes relative to the tables.
pub(super) fn ray_shifts_mm(p: &Parameters) -> [f64; 5] {
    let [first, third, fourth, fifth] =
        std::array::from_fn(|ray| p.metatarsal_heads_mm[ray] - TABLES.metatarsal_heads_mm[ray]);
    [first, 0.0, third, fourth, fifth]
}

/// Appends the bones in front of talus and calcaneus.
pub(super) fn append(bones: &mut Vec<Bone>, p: &Parameters, hindfoot: &Hindfoot) {
    let gap = p.small_joint_mm;
    let mut push = |name, solid, neighbours: &[(usize, f64)], filling| {
        bones.push(Bone {
            name,
            solid,
            hollows: vec![],
            yields_to: neighbours
                .iter()
                .map(|&(bone, gap_mm)| (bone, Gap::even(gap_mm)))
                .collect(),
            filling,
            joints: vec![],
        });
        bones.len() - 1
    };
    // Along the foot; numbers assumed as in the talus.
    let trabeculae = |mean_hu| Trabeculae::new(mean_hu, 0.6, 1.6).along(&-Vector3::y_axis());
    let spongy = || {
        let mean_hu = p.spongy_hu(260.0);
        Filling::spongy(0.9, mean_hu, trabeculae(mean_hu))
    };
    let tubular = |from, to, shaft_cortex_mm, p01_hu| {
        let mean_hu = p.spongy_hu(p01_hu);
        Filling::tubular(from, to, shaft_cortex_mm, mean_hu, trabeculae(mean_hu))
    };
    // Rotated about the foot's long axis by the transverse arch, then forward and down with the longitudinal one.
    let arched = |transverse: f64, longitudinal: f64| {
        Rotation3::from_axis_angle(&Vector3::x_axis(), longitudinal.to_radians())
            * Rotation3::from_axis_angle(&Vector3::y_axis(), transverse.to_radians())
    };

    let navicular = push(
        "navicular",
        Shape::union(
            6.0,
            vec![
                Shape::block(
                    [8.5, -49.5, -30.0],
                    [18.0, 8.5, 11.0],
                    7.5,
                    arched(25.0, 12.0),
                ),
                Shape::ellipsoid([23.5, -45.0, -37.0], [6.5, 8.0, 7.0]),
            ],
        ),
        &[(hindfoot.talus, gap), (hindfoot.calcaneus, gap)],
        spongy(),
    );
    let cuboid = push(
        "cuboid",
        Shape::union(
            5.0,
            vec![
                Shape::block(
                    [-17.5, -57.0, -49.0],
                    [11.8, 18.5, 10.8],
                    8.0,
                    arched(20.0, 6.0),
                ),
                Shape::ellipsoid([-18.0, -48.0, -53.0], [11.0, 12.0, 10.0]),
            ],
        ),
        &[
            (hindfoot.calcaneus, gap),
            (hindfoot.talus, gap),
            (navicular, gap),
        ],
        spongy(),
    );
    let intermediate = push(
        "intermediate cuneiform",
        Shape::block(
            [6.5, -67.0, -28.5],
            [7.5, 13.0, 9.5],
            5.5,
            arched(8.0, 15.0),
        ),
        &[(navicular, gap), (cuboid, gap)],
        spongy(),
    );
    let medial = push(
        "medial cuneiform",
        Shape::block(
            [19.5, -76.0, -38.5],
            [8.0, 18.0, 13.5],
            6.5,
            arched(-12.0, 15.0),
        ),
        &[(navicular, gap), (intermediate, 0.8 * gap)],
        spongy(),
    );
    let lateral = push(
        "lateral cuneiform",
        Shape::block(
            [-5.5, -68.5, -35.5],
            [7.5, 14.0, 10.5],
            5.5,
            arched(18.0, 13.0),
        ),
        &[
            (navicular, gap),
            (cuboid, 0.8 * gap),
            (intermediate, 0.8 * gap),
            (medial, 0.8 * gap),
        ],
        spongy(),
    );
    let tarsals = [medial, intermediate, lateral, cuboid, navicular].map(|t| (t, gap));

    let mut hallux = vec![];
    let mut previous: Option<usize> = None;
    let rays = FOREFOOT.metatarsals.iter().zip(&FOREFOOT.toes);
    for ((metatarsal, toe), forward) in rays.zip(ray_shifts_mm(p)) {
        let moved = |[x, y, z]: [f64; 3]| [x, y - forward, z];
        let head = moved(metatarsal.head);
        let mut neighbours = tarsals.to_vec();
        neighbours.extend(previous.map(|m| (m, 0.8 * gap)));
        let mut last = push(
            metatarsal.name.as_str(),
            metatarsal.solid(head),
            &neighbours,
            tubular(metatarsal.base, head, 2.0, 220.0),
        );
        previous = Some(last);
        if hallux.is_empty() {
            hallux = vec![(last, 0.8 * gap), (last + 1, gap)];
        }
        let distal = toe.phalanges.len() - 1;
        for (place, bone) in toe.phalanges.iter().enumerate() {
            let [base, end] = [bone.base, bone.end].map(moved);
            let waist = toe.waist * if place == distal { 0.8 } else { 1.0 };
            last = push(
                &bone.name,
                phalanx(base, end, waist),
                &[(last, 0.8 * gap)],
                tubular(base, end, 1.2, 180.0),
            );
        }
    }

    let [first, ..] = ray_shifts_mm(p);
    for (name, [x, y, z], semi) in SESAMOIDS {
        let centre = [x, y - first, z];
        let sesamoid = push(name, Shape::ellipsoid(centre, semi), &hallux, spongy());
        hallux.push((sesamoid, gap));
    }
}
