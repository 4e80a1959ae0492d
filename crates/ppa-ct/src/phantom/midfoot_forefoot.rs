//! Navicular, cuboid, cuneiforms, metatarsals and phalanges.
//!
//! Solids overlap on purpose: each yields a joint space to its neighbours, which gives the flat and
//! cupped faces of the real bones.

use nalgebra::{Rotation3, Vector3};

use super::bone::{Bone, Filling};
use super::parameters::Parameters;
use super::sdf::Shape;

/// Indices of the bones that carry the midfoot.
pub(super) struct Hindfoot {
    pub talus: usize,
    pub calcaneus: usize,
}

/// Base, waist and head of a metatarsal: centres, and semi-axes across and upwards.
struct Metatarsal {
    name: &'static str,
    base: [f64; 3],
    base_semi: [f64; 3],
    head: [f64; 3],
    head_semi: [f64; 3],
    waist: f64,
}

const METATARSALS: [Metatarsal; 5] = [
    Metatarsal {
        name: "first metatarsal",
        base: [20.5, -98.0, -44.0],
        base_semi: [8.3, 9.0, 11.5],
        head: [27.0, -147.0, -64.5],
        head_semi: [10.0, 9.5, 9.5],
        waist: 6.3,
    },
    Metatarsal {
        name: "second metatarsal",
        base: [6.0, -88.0, -35.0],
        base_semi: [6.8, 8.5, 8.5],
        head: [5.0, -147.5, -65.0],
        head_semi: [5.5, 8.0, 8.0],
        waist: 4.3,
    },
    Metatarsal {
        name: "third metatarsal",
        base: [-7.5, -92.0, -40.0],
        base_semi: [6.3, 8.0, 8.5],
        head: [-9.5, -143.0, -66.0],
        head_semi: [5.3, 7.7, 7.6],
        waist: 4.0,
    },
    Metatarsal {
        name: "fourth metatarsal",
        base: [-20.0, -83.5, -47.5],
        base_semi: [6.3, 8.0, 7.5],
        head: [-24.0, -136.5, -67.0],
        head_semi: [5.2, 7.4, 7.2],
        waist: 3.9,
    },
    Metatarsal {
        name: "fifth metatarsal",
        base: [-31.0, -77.0, -57.0],
        base_semi: [7.0, 10.0, 6.2],
        head: [-38.0, -128.0, -69.0],
        head_semi: [5.2, 7.2, 6.5],
        waist: 4.0,
    },
];

/// Phalanges of one toe: x and z of the base, then per phalanx both ends along y, x and z of the far end, waist.
struct Toe {
    names: &'static [&'static str],
    /// Base and far end per phalanx.
    ends: &'static [([f64; 3], [f64; 3])],
    waist: f64,
}

const TOES: [Toe; 5] = [
    Toe {
        names: &["proximal phalanx of toe 1", "distal phalanx of toe 1"],
        ends: &[
            ([27.0, -162.0, -68.0], [24.0, -183.0, -70.5]),
            ([23.5, -191.5, -71.0], [22.3, -199.5, -72.0]),
        ],
        waist: 5.2,
    },
    Toe {
        names: &[
            "proximal phalanx of toe 2",
            "middle phalanx of toe 2",
            "distal phalanx of toe 2",
        ],
        ends: &[
            ([4.5, -161.0, -67.0], [3.5, -177.5, -69.5]),
            ([3.2, -186.5, -71.5], [3.0, -191.0, -73.0]),
            ([3.0, -198.0, -74.0], [3.0, -201.0, -74.3]),
        ],
        waist: 3.1,
    },
    Toe {
        names: &[
            "proximal phalanx of toe 3",
            "middle phalanx of toe 3",
            "distal phalanx of toe 3",
        ],
        ends: &[
            ([-10.5, -156.5, -68.0], [-11.5, -171.5, -70.0]),
            ([-11.8, -180.0, -71.5], [-12.0, -183.5, -73.0]),
            ([-12.0, -190.5, -74.2], [-12.0, -193.0, -74.5]),
        ],
        waist: 3.0,
    },
    Toe {
        names: &[
            "proximal phalanx of toe 4",
            "middle phalanx of toe 4",
            "distal phalanx of toe 4",
        ],
        ends: &[
            ([-25.0, -149.5, -69.0], [-25.5, -163.5, -71.0]),
            ([-25.5, -171.5, -72.5], [-25.5, -174.0, -73.5]),
            ([-25.5, -181.0, -74.3], [-25.3, -183.5, -74.6]),
        ],
        waist: 2.9,
    },
    Toe {
        names: &[
            "proximal phalanx of toe 5",
            "middle phalanx of toe 5",
            "distal phalanx of toe 5",
        ],
        ends: &[
            ([-38.5, -140.5, -69.5], [-38.0, -153.5, -71.0]),
            ([-37.5, -161.0, -73.0], [-37.3, -162.5, -73.5]),
            ([-37.0, -168.8, -74.3], [-36.8, -170.5, -74.6]),
        ],
        waist: 2.9,
    },
];

impl Metatarsal {
    fn solid(&self) -> Shape {
        Shape::union(
            4.0,
            vec![
                Shape::block(self.base, self.base_semi, 4.5, Rotation3::identity()),
                Shape::round_cone(self.base, self.waist + 1.2, self.head, self.waist),
                Shape::ellipsoid(self.head, self.head_semi),
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

/// Appends the bones in front of talus and calcaneus.
pub(super) fn append(bones: &mut Vec<Bone>, p: &Parameters, hindfoot: &Hindfoot) {
    let gap = p.small_joint_mm;
    let mut push = |name, solid, neighbours: &[(usize, f64)], filling| {
        bones.push(Bone {
            name,
            solid,
            hollows: vec![],
            yields_to: neighbours.to_vec(),
            filling,
        });
        bones.len() - 1
    };
    let spongy = || Filling::spongy(0.9, 260.0);
    // Turned about the foot's length by the transverse arch, then forward and down with the longitudinal one.
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
            [19.5, -74.0, -38.5],
            [8.0, 16.0, 13.5],
            6.5,
            arched(-12.0, 15.0),
        ),
        &[(navicular, gap), (intermediate, 0.8 * gap)],
        spongy(),
    );
    let lateral = push(
        "lateral cuneiform",
        Shape::block(
            [-5.5, -70.0, -35.5],
            [7.5, 15.5, 10.5],
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

    let mut previous: Option<usize> = None;
    for (metatarsal, toe) in METATARSALS.iter().zip(&TOES) {
        let mut neighbours = tarsals.to_vec();
        neighbours.extend(previous.map(|m| (m, 0.8 * gap)));
        let mut last = push(
            metatarsal.name,
            metatarsal.solid(),
            &neighbours,
            Filling::tubular(metatarsal.base, metatarsal.head, 2.0, 220.0),
        );
        previous = Some(last);
        let distal = toe.names.len() - 1;
        for (place, (&name, &(base, end))) in toe.names.iter().zip(toe.ends).enumerate() {
            let waist = toe.waist * if place == distal { 0.8 } else { 1.0 };
            last = push(
                name,
                phalanx(base, end, waist),
                &[(last, 0.8 * gap)],
                Filling::tubular(base, end, 1.2, 180.0),
            );
        }
    }
}
