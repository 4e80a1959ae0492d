//! Metatarsals and phalanges of P01.

/// Base, waist and head of a metatarsal: centres, and semi-axes across and upwards.
pub(super) struct Metatarsal {
    pub name: &'static str,
    pub base: [f64; 3],
    pub base_semi: [f64; 3],
    pub head: [f64; 3],
    pub head_semi: [f64; 3],
    pub waist: f64,
}

pub(super) const METATARSALS: [Metatarsal; 5] = [
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
pub(super) struct Toe {
    pub names: &'static [&'static str],
    /// Base and far end per phalanx.
    pub ends: &'static [([f64; 3], [f64; 3])],
    pub waist: f64,
}

pub(super) const TOES: [Toe; 5] = [
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
