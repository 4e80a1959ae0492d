//! DBSCAN against its definition.

use nalgebra::Point3;
use ppa_mesh::dbscan;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// On lattice points (many equal coordinates), from the definition in O(n²).
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
        // As many clusters as core components: nothing joined that is apart.
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
}
