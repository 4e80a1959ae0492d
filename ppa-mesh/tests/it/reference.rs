//! Against measured errors of other tools and exact answers stored next to the repository.

use std::collections::HashSet;

use nalgebra::Point3;
use ppa_mesh::{Border, Mesh, dbscan, iso_surface};
use serde_json::Value;

use crate::fields::{Solid, hash_noise, numbers, reference, volume};

/// Smallest absolute error among the peers.
fn best(peers: &Value, key: &str) -> f64 {
    let found = peers.as_object().expect("peers").values();
    found
        .filter_map(|peer| peer[key].as_f64())
        .map(f64::abs)
        .fold(f64::INFINITY, f64::min)
}

/// Vertices that differ after rounding to 0.1 µm, as the peers were counted.
fn unique_vertices(mesh: &Mesh) -> usize {
    let rounded = |v: &Point3<f32>| {
        v.coords
            .map(|c| (f64::from(c) * 1e4).round_ties_even() as i64)
    };
    mesh.vertices
        .iter()
        .map(rounded)
        .collect::<HashSet<_>>()
        .len()
}

fn percentile_99(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(values.len() - 1) * 99 / 100]
}

#[test]
#[ignore = "needs ../shared/reference"]
fn analytic_solids_are_as_exact_as_with_the_best_peer() {
    for case in reference("mc_analytic.json").as_array().expect("cases") {
        let solid = Solid::parse(&case["shape"]);
        let size = numbers::<3>(&case["dims_xyz"]).map(|n| n as usize);
        let ramp = case["field"] == "ramp16";
        let hu = |p: &Point3<f64>| match ramp {
            true => (-500.0 - 200.0 * solid.distance(p))
                .clamp(-1000.0, 100.0)
                .round_ties_even(),
            false => -500.0 - 100.0 * solid.distance(p),
        };
        let field = volume(size, numbers::<3>(&case["spacing_xyz_mm"]), |p| {
            hu(p) as f32
        });
        let mesh = iso_surface(&field, -500.0, Border::Open).expect("surface");
        let (peers, exact) = (&case["peers"], &case["exact"]);
        let at = format!(
            "{} {} {}",
            case["name"], case["spacing_xyz_mm"], case["field"]
        );

        let topology = mesh.topology();
        assert_eq!(topology.boundary_edges, 0, "{at}");
        assert_eq!(topology.non_manifold_edges, 0, "{at}");
        assert_eq!(Some(topology.euler), exact["euler"].as_i64(), "{at}");
        let peer_vertices = peers["vtk_flying_edges"]["unique_vertices"].as_u64();
        assert_eq!(Some(unique_vertices(&mesh) as u64), peer_vertices, "{at}");

        let rel = |value: f64, key: &str| (value / exact[key].as_f64().expect("exact") - 1.0).abs();
        let check = |value: f64, key: &str| {
            let limit = 1.05 * best(peers, key) + 1e-6;
            assert!(value <= limit, "{at}: {key} {value:.3e} > {limit:.3e}");
        };
        check(rel(mesh.area_mm2(), "area_mm2"), "area_rel_err");
        check(rel(mesh.volume_mm3(), "volume_mm3"), "volume_rel_err");
        let distances: Vec<f64> = mesh
            .vertices
            .iter()
            .map(|v| solid.distance(&v.cast()).abs())
            .collect();
        check(
            distances.iter().copied().fold(0.0, f64::max),
            "vertex_dist_max_mm",
        );
        check(
            distances.iter().sum::<f64>() / distances.len() as f64,
            "vertex_dist_mean_mm",
        );
        if case["shape"]["kind"] != "cylinder" {
            let angles: Vec<f64> = mesh
                .vertices
                .iter()
                .zip(&mesh.normals)
                .map(|(v, n)| {
                    n.cast::<f64>()
                        .angle(&solid.outward(&v.cast()))
                        .to_degrees()
                })
                .collect();
            check(
                angles.iter().sum::<f64>() / angles.len() as f64,
                "normal_err_mean_deg",
            );
            check(percentile_99(angles), "normal_err_p99_deg");
        }
    }
}

#[test]
#[ignore = "needs ../shared/reference"]
fn the_topology_of_noise_is_that_of_the_reference() {
    let cases = reference("mc_topology.json");
    let cases = cases.as_array().expect("cases").iter();
    let expected: Vec<(u64, i64)> = cases
        .map(|case| {
            let euler = case["trilinear_euler_exact"].as_i64().expect("number");
            (case["seed"].as_u64().expect("seed"), euler)
        })
        .collect();
    assert_eq!(expected.len(), EULER_OF_NOISE.len());
    for (seed, euler) in expected {
        assert_eq!(euler, EULER_OF_NOISE[seed as usize - 1], "seed {seed}");
    }
}

/// Euler numbers of the trilinear interpolant of noise by seed from 1, from `mc_topology.json` of the
/// geometry references, where they come from Euler integration and not from a mesh.
const EULER_OF_NOISE: [i64; 24] = [
    -18, -8, -18, -20, -8, -12, -16, -22, -4, -20, -16, -6, -16, -26, -24, 0, -18, -16, -22, -18,
    -22, -16, -6, -16,
];

#[test]
fn noise_gives_closed_manifolds_of_the_trilinear_topology() {
    for (seed, euler) in (1..).zip(EULER_OF_NOISE) {
        let noise = hash_noise(6 * 6 * 6, seed);
        let field = volume([8; 3], [1.0; 3], |p| {
            let [i, j, k] = [p.x, p.y, p.z].map(|c| c as usize);
            if [i, j, k].iter().all(|c| (1..7).contains(c)) {
                noise[(i - 1) + 6 * ((j - 1) + 6 * (k - 1))] as f32
            } else {
                -1.0
            }
        });
        let mesh = iso_surface(&field, 0.0, Border::Open).expect("surface");
        let topology = mesh.topology();
        assert_eq!(topology.boundary_edges, 0, "seed {seed}");
        assert_eq!(topology.non_manifold_edges, 0, "seed {seed}");
        assert_eq!(topology.euler, euler, "seed {seed}");
    }
}

#[test]
#[ignore = "needs ../shared/reference"]
fn clusters_are_those_of_the_reference() {
    for case in reference("dbscan.json").as_array().expect("cases") {
        let spec = &case["spec"];
        let mut points = Vec::new();
        for blob in spec["blobs"].as_array().expect("blobs") {
            let (half, centre) = (numbers::<3>(&blob["half"]), numbers::<3>(&blob["centre"]));
            let count = blob["n"].as_u64().expect("n") as usize;
            let noise = hash_noise(3 * count, blob["seed"].as_u64().expect("seed"));
            points.extend(
                noise
                    .chunks(3)
                    .map(|n| Point3::from([0, 1, 2].map(|x| (n[x] * half[x] + centre[x]) as f32))),
            );
        }
        let eps_mm = spec["eps"].as_f64().expect("eps");
        let min_points = spec["min_points"].as_u64().expect("min_points") as usize;
        let clusters = dbscan(&points, eps_mm, min_points);
        assert_eq!(
            Some(clusters.core_points() as u64),
            case["core_points"].as_u64()
        );
        assert_eq!(Some(clusters.noise as u64), case["noise"].as_u64());
        let mut core_sizes = vec![0_u64; clusters.sizes.len()];
        for (label, core) in clusters.labels.iter().zip(&clusters.core) {
            if let (Some(cluster), true) = (label, core) {
                core_sizes[*cluster as usize] += 1;
            }
        }
        core_sizes.sort_unstable_by(|a, b| b.cmp(a));
        let expected = case["core_cluster_sizes"].as_array().expect("sizes");
        assert_eq!(
            core_sizes,
            expected
                .iter()
                .filter_map(Value::as_u64)
                .collect::<Vec<_>>()
        );
    }
}
