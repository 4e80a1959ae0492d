//! No ray passes between triangles that share an edge or a corner.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_depth::{Body, DepthImage, MeshBody, PlacedBody, render};

use crate::cameras::{pinhole, small_kinect};
use crate::shapes::bumpy;

/// From inside a closed surface every ray must leave through it, also those aimed at its corners and edges.
#[test]
fn no_ray_leaks_through_edges_or_corners() {
    let (vertices, triangles) = bumpy(4);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    // One pixel, whose ray the pose rotates onto each target.
    let camera = pinhole(1, 1, 1.0);
    let eye = Point3::new(1.7, -2.3, 0.9);
    for (index, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|corner| vertices[corner as usize].cast::<f64>());
        let share = (index as f64 * 0.618_033_988_749_895).fract();
        for target in [a, nalgebra::center(&a, &b), b + (c - b) * share] {
            let body_from_camera =
                Isometry3::face_towards(&eye, &target, &Vector3::new(0.3, 0.8, -0.5));
            let placed = PlacedBody {
                body: &body,
                camera_from_body: body_from_camera.inverse(),
            };
            let z_mm = render(&camera, &[placed]).z_mm[0];
            let distance = (target - eye).norm();
            assert!(
                z_mm > 0.0 && f64::from(z_mm) <= distance + 1e-3,
                "{z_mm} towards {target}, {distance} mm away"
            );
        }
    }
}

/// Rays along the axes of the body run within the planes of its triangles and exactly along edges.
#[test]
fn a_wall_square_to_the_ray_has_no_seams() {
    let side = 65;
    let vertices: Vec<_> = (0..side * side)
        .map(|i| Point3::new((i % side) as f32, (i / side) as f32, 0.0))
        .collect();
    let quad = |x: u32, y: u32| y * side + x;
    let triangles: Vec<_> = (0..side - 1)
        .flat_map(|y| (0..side - 1).map(move |x| (x, y)))
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [
                quad(x, y),
                quad(x + 1, y),
                quad(x, y + 1),
                quad(x + 1, y + 1),
            ];
            [[a, b, c], [b, d, c]]
        })
        .collect();
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    // Focal length and distance of equal size: every pixel looks exactly at a corner of the grid.
    let camera = pinhole(side, side, 1024.0);
    let camera_from_body = Isometry3::translation(-32.0, -32.0, 1024.0);
    let image = render(
        &camera,
        &[PlacedBody {
            body: &body,
            camera_from_body,
        }],
    );
    assert!(
        image.z_mm.iter().all(|&z_mm| z_mm == 1024.0),
        "{} of 4225 pixels",
        image.valid_pixels()
    );
}

/// Pixels that see nothing must reach the border through others that see nothing.
fn has_hole(image: &DepthImage) -> bool {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut outside: Vec<bool> = vec![false; width * height];
    let mut stack: Vec<usize> = (0..width * height)
        .filter(|i| [0, width - 1].contains(&(i % width)) || [0, height - 1].contains(&(i / width)))
        .collect();
    while let Some(i) = stack.pop() {
        if image.z_mm[i] > 0.0 || std::mem::replace(&mut outside[i], true) {
            continue;
        }
        let (x, y) = (i % width, i / width);
        let neighbours = [
            (x > 0, -1),
            (x + 1 < width, 1),
            (y > 0, -(width as isize)),
            (y + 1 < height, width as isize),
        ];
        stack.extend(
            neighbours
                .iter()
                .filter(|(inside, _)| *inside)
                .map(|(_, step)| i.strict_add_signed(*step)),
        );
    }
    image
        .z_mm
        .iter()
        .zip(outside)
        .any(|(&z_mm, outside)| z_mm == 0.0 && !outside)
}

#[test]
fn a_closed_surface_has_no_holes_and_threads_change_nothing() {
    let (vertices, triangles) = bumpy(5);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let camera = small_kinect();
    for turn in 0..6 {
        let camera_from_body = Isometry3::new(
            Vector3::new(5.0, 0.0, 180.0),
            Vector3::new(0.0, f64::from(turn), 0.3),
        );
        let placed = [PlacedBody {
            body: &body,
            camera_from_body,
        }];
        let threads = |count| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(count)
                .build()
                .unwrap()
        };
        let image = threads(1).install(|| render(&camera, &placed));
        assert!(image.valid_pixels() > 3000);
        assert!(!has_hole(&image), "turn {turn}");
        assert_eq!(threads(3).install(|| render(&camera, &placed)), image);
    }
}
