//! Density-based clustering of points.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use linfa::prelude::{ParamGuard, Transformer};
use linfa_clustering::Dbscan;
use nalgebra::Point3;
use ndarray16::Array2;
use rayon::prelude::*;

/// Outcome of [`dbscan`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Clusters {
    /// Cluster of each point, numbered from 0; `None` for noise.
    pub labels: Vec<Option<u32>>,
    /// Whether each point has enough points around it to carry a cluster on.
    pub core: Vec<bool>,
    /// Number of points of each cluster.
    pub sizes: Vec<usize>,
    /// Points in no cluster.
    pub noise: usize,
}

impl Clusters {
    /// Number of core points.
    pub fn core_points(&self) -> usize {
        self.core.iter().filter(|core| **core).count()
    }
}

/// DBSCAN (Ester et al. 1996): points with at least `min_points` points (themselves included)
/// within `eps_mm` are core points, core points that near to each other share a cluster, and other
/// points near a core point join its cluster; the rest is noise.
///
/// The clusters of core points and the noise do not depend on the order of the points; a border point
/// between two clusters joins the one found first. Time grows with the number of points
/// times the points within `eps_mm`: 200 000 surface points take about a second. Points that are not
/// finite are noise; a radius that is not positive leaves every point alone.
pub fn dbscan(points: &[Point3<f32>], eps_mm: f64, min_points: usize) -> Clusters {
    let finite: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].coords.iter().all(|c| c.is_finite()))
        .collect();
    let rows: Vec<[f64; 3]> = finite
        .iter()
        .map(|&i| points[i].cast::<f64>().into())
        .collect();
    let mut clusters = Clusters {
        labels: vec![None; points.len()],
        core: vec![false; points.len()],
        ..Clusters::default()
    };
    let labels = cluster_rows(&rows, eps_mm, min_points.max(2));
    let core = core_rows(&rows, eps_mm, min_points);
    for (row, &point) in finite.iter().enumerate() {
        clusters.labels[point] = labels[row];
        clusters.core[point] = core[row];
    }
    let mut count = labels.iter().flatten().max().map_or(0, |&last| last + 1);
    if min_points < 2 {
        // linfa asks for 2 or more; with fewer, a lone point is a cluster of its own.
        for &point in &finite {
            clusters.labels[point].get_or_insert_with(|| {
                count += 1;
                count - 1
            });
        }
    }
    clusters.sizes = vec![0; count as usize];
    for &label in clusters.labels.iter().flatten() {
        clusters.sizes[label as usize] += 1;
    }
    clusters.noise = points.len() - clusters.sizes.iter().sum::<usize>();
    clusters
}

fn cluster_rows(rows: &[[f64; 3]], eps_mm: f64, min_points: usize) -> Vec<Option<u32>> {
    let table = Array2::from_shape_fn((rows.len(), 3), |(row, axis)| rows[row][axis]);
    match Dbscan::params(min_points).tolerance(eps_mm).check() {
        Ok(valid) if eps_mm.is_finite() && !rows.is_empty() => valid
            .transform(&table)
            .into_iter()
            .map(|label| label.map(|cluster| cluster as u32))
            .collect(),
        _ => vec![None; rows.len()],
    }
}

fn core_rows(rows: &[[f64; 3]], eps_mm: f64, min_points: usize) -> Vec<bool> {
    if min_points < 2 {
        return vec![true; rows.len()];
    }
    if !(eps_mm > 0.0 && eps_mm.is_finite()) || rows.is_empty() {
        return vec![false; rows.len()];
    }
    let Ok(tree) = ImmutableKdTree::<f64, 3>::new_from_slice(rows) else {
        return vec![false; rows.len()];
    };
    rows.par_iter()
        .map(|row| {
            let near = tree
                .query(row)
                .within::<SquaredEuclidean<f64>>(eps_mm * eps_mm)
                .unsorted()
                .execute();
            near.len() >= min_points
        })
        .collect()
}
