//! DBSCAN against its definition and against linfa's.

use linfa::prelude::{ParamGuard, Transformer};
use linfa_clustering::Dbscan;
use nalgebra::Point3;
use ndarray16::Array2;
use ppa_mesh::dbscan;
use proptest::prelude::*;

/// Points exactly the radius apart, which rounding could put a cell too far apart.
#[test]
fn points_at_the_radius_are_neighbours() {
    let points = [0.5_f32.powi(53), 1.0, 2.0].map(|x| Point3::new(x, 0.0, 0.0));
    assert_eq!(dbscan(&points, 1.0, 2).noise, 0);
    assert_eq!(dbscan(&points, f64::INFINITY, 3).sizes, [3]);
    assert_eq!(dbscan(&points, f64::NAN, 2).noise, 3);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// On lattice points (many equal coordinates), against the definition in O(n²).
    #[test]
    fn clusters_follow_the_definition(
        places in prop::collection::vec(prop::array::uniform3(0..9_i8), 1..90),
        min_points in 0..7_usize,
        reach in 1..3_u8,
    ) {
        let points: Vec<Point3<f32>> = places.iter().map(|p| p.map(f32::from).into()).collect();
        // Between the squared distances that occur on the lattice.
        let eps = f64::from(reach) + 0.1;
        let near = |a: usize, b: usize| f64::from((points[a] - points[b]).norm()) <= eps;
        let n = points.len();
        let core: Vec<bool> =
            (0..n).map(|a| (0..n).filter(|&b| near(a, b)).count() >= min_points).collect();
        let clusters = dbscan(&points, eps, min_points);
        prop_assert_eq!(&clusters.core, &core);
        prop_assert_eq!(clusters.sizes.iter().sum::<usize>() + clusters.noise, n);
        for a in 0..n {
            let reached = (0..n).any(|b| core[b] && near(a, b));
            prop_assert_eq!(clusters.labels[a].is_some(), reached);
            for b in (0..n).filter(|&b| core[a] && core[b] && near(a, b)) {
                prop_assert_eq!(clusters.labels[a], clusters.labels[b]);
            }
        }
        // As many clusters as core components: separate components are not joined.
        let mut component: Vec<usize> = (0..n).collect();
        for _ in 0..n {
            for (a, b) in (0..n * n).map(|ab| (ab / n, ab % n)) {
                if core[a] && core[b] && near(a, b) {
                    component[a] = component[a].min(component[b]);
                }
            }
        }
        let roots = (0..n).filter(|&a| core[a] && component[a] == a).count();
        prop_assert_eq!(clusters.sizes.len(), roots);
    }

    /// Core partition, border points and noise of a cloud without equal distances, and with the
    /// numbers that linfa gives them.
    #[test]
    fn clusters_are_those_of_linfa(
        places in prop::collection::vec(prop::array::uniform3(-20.0..20.0_f32), 1..400),
        min_points in 2..9_usize,
        eps in 0.5..30.0_f64,
    ) {
        let points: Vec<Point3<f32>> = places.iter().map(|&p| p.into()).collect();
        let table = Array2::from_shape_fn((places.len(), 3), |(row, axis)| f64::from(places[row][axis]));
        let linfa = Dbscan::params(min_points).tolerance(eps).check().expect("parameters");
        let expected: Vec<Option<u32>> =
            linfa.transform(&table).iter().map(|label| label.map(|c| c as u32)).collect();
        prop_assert_eq!(dbscan(&points, eps, min_points).labels, expected);
    }
}

#[test]
fn odd_input_is_noise() {
    let points = [
        Point3::new(f32::NAN, 0.0, 0.0),
        Point3::origin(),
        Point3::origin(),
    ];
    let clusters = dbscan(&points, 1.0, 2);
    assert_eq!(
        (clusters.labels, clusters.noise),
        (vec![None, Some(0), Some(0)], 1)
    );
    assert_eq!(dbscan(&points, f64::NAN, 2).noise, 3);
    assert_eq!(dbscan(&[], 1.0, 2).sizes, Vec::<usize>::new());
    // Far more cells apart than a key can distinguish.
    let far = [-1e30, 0.0, 1e-30, 1e30, 1e30].map(|x| Point3::new(x, 0.0, -x));
    let labels = dbscan(&far, 1e-20, 2).labels;
    assert_eq!(labels, [None, Some(0), Some(0), Some(1), Some(1)]);
}
