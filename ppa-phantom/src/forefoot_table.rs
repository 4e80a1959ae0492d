//! Metatarsals and phalanges of P01.

/// Base, waist and head of a metatarsal: centres, half-edges of the base and semi-axes of the head (x, y, z), and the radius of
/// the shaft behind the head.
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
        base: [20.5, -101.8, -44.0],
        base_semi: [8.3, 6.0, 11.5],
        head: [27.0, -133.5, -62.5],
        head_semi: [10.0, 9.5, 9.5],
        waist: 6.3,
    },
    Metatarsal {
        name: "second metatarsal",
        base: [6.0, -88.0, -35.0],
        base_semi: [6.8, 8.5, 8.5],
        head: [5.0, -134.0, -62.5],
        head_semi: [5.5, 8.0, 8.0],
        waist: 4.3,
    },
    Metatarsal {
        name: "third metatarsal",
        base: [-7.5, -89.0, -40.0],
        base_semi: [6.3, 8.0, 8.5],
        head: [-9.5, -129.5, -63.5],
        head_semi: [5.3, 7.7, 7.6],
        waist: 4.0,
    },
    Metatarsal {
        name: "fourth metatarsal",
        base: [-20.0, -82.0, -47.5],
        base_semi: [6.3, 8.0, 7.5],
        head: [-24.0, -123.0, -65.0],
        head_semi: [5.2, 7.4, 7.2],
        waist: 3.9,
    },
    Metatarsal {
        name: "fifth metatarsal",
        base: [-31.0, -75.5, -57.0],
        base_semi: [7.0, 10.5, 6.2],
        head: [-38.0, -114.5, -67.5],
        head_semi: [5.2, 7.2, 6.5],
        waist: 4.0,
    },
];

/// Phalanges of one toe, from the base to the tip, and the radius of their shafts.
pub(super) struct Toe {
    pub names: &'static [&'static str],
    /// Middle of the base and of the far end of each.
    pub ends: &'static [([f64; 3], [f64; 3])],
    pub waist: f64,
}

pub(super) const TOES: [Toe; 5] = [
    Toe {
        names: &["proximal phalanx of toe 1", "distal phalanx of toe 1"],
        ends: &[
            ([27.0, -148.5, -66.5], [24.7, -167.8, -69.3]),
            ([24.3, -176.3, -70.2], [22.5, -196.5, -72.0]),
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
            ([4.5, -147.5, -65.0], [3.7, -166.5, -68.3]),
            ([3.4, -175.5, -69.9], [3.1, -184.5, -72.0]),
            ([3.0, -191.5, -73.3], [3.0, -198.0, -74.3]),
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
            ([-10.0, -143.0, -66.0], [-11.3, -161.0, -69.0]),
            ([-11.6, -169.6, -70.3], [-11.9, -177.8, -72.2]),
            ([-12.0, -184.8, -73.4], [-12.0, -190.5, -74.5]),
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
            ([-24.5, -136.0, -67.2], [-25.4, -154.0, -70.0]),
            ([-25.5, -162.0, -71.2], [-25.5, -169.0, -72.8]),
            ([-25.5, -176.0, -73.7], [-25.3, -181.5, -74.6]),
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
            ([-38.5, -127.0, -68.5], [-38.0, -144.0, -70.5]),
            ([-37.8, -151.5, -71.8], [-37.5, -157.0, -73.0]),
            ([-37.2, -163.3, -73.8], [-36.8, -169.0, -74.6]),
        ],
        waist: 2.9,
    },
];
