//! The mesh on which our depth images and those of other programs are timed.

use nalgebra::Point3;

/// A bent, bumpy tube of 832 x 832 quads, about 400 mm long and 100 mm thick: 1.38 million triangles.
pub fn tube() -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
    const SIDE: u32 = 832;
    let point = |i: u32, j: u32| {
        let (angle, along) = (
            i as f32 / SIDE as f32 * std::f32::consts::TAU,
            j as f32 / SIDE as f32,
        );
        let radius = 50.0 * (1.0 + 0.2 * (3.0 * angle).sin() * (7.0 * along).cos());
        let (x, y) = (
            radius * angle.cos() + 40.0 * along * along,
            400.0 * along - 200.0,
        );
        Point3::new(x, y, radius * angle.sin())
    };
    let vertices = (0..=SIDE)
        .flat_map(|j| (0..SIDE).map(move |i| point(i, j)))
        .collect();
    let corner = |i: u32, j: u32| j * SIDE + i % SIDE;
    let quads = (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (i, j)));
    let triangles = quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [
                corner(i, j),
                corner(i + 1, j),
                corner(i, j + 1),
                corner(i + 1, j + 1),
            ];
            [[a, b, c], [b, d, c]]
        })
        .collect();
    (vertices, triangles)
}
