//! Normals and spacing of a recorded point cloud that came without them.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Reason why a cloud cannot be searched for neighbours.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CloudError {
    /// Too few points.
    #[error("the number of points in the cloud is {found}, expected at least {expected}")]
    TooFewPoints {
        /// Points given.
        found: usize,
        /// Points needed.
        expected: usize,
    },
    /// More points than the search tree can number.
    #[error("a cloud of {found} points is too large for a neighbour search")]
    TooManyPoints {
        /// Points given.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {0} of the cloud is not finite")]
    NotFinite(usize),
}

/// Unit normals of `points` (mm), each perpendicular to the least-squares plane through its
/// `neighbours` nearest points. Their sign is arbitrary.
///
/// # Errors
/// [`CloudError`] when there are fewer points than neighbours or one is not finite.
pub fn estimate_normals(
    points: &[Point3<f32>],
    neighbours: usize,
) -> Result<Vec<Vector3<f32>>, CloudError> {
    let tree = tree(points, neighbours.max(3))?;
    let neighbours = NonZero::new(neighbours.max(3)).expect("at least 3");
    let normal = |point: &Point3<f32>| {
        let near = tree
            .query(&point.coords.into())
            .nearest_n::<SquaredEuclidean<f32>>(neighbours)
            .execute();
        let offsets: Vec<Vector3<f64>> = near
            .iter()
            .map(|hit| (points[hit.item as usize] - point).cast::<f64>())
            .collect();
        let mean = offsets.iter().sum::<Vector3<f64>>() / offsets.len() as f64;
        let covariance: Matrix3<f64> = offsets
            .iter()
            .map(|offset| (offset - mean) * (offset - mean).transpose())
            .sum();
        let eigen = covariance.symmetric_eigen();
        eigen
            .eigenvectors
            .column(eigen.eigenvalues.imin())
            .into_owned()
            .cast::<f32>()
    };
    Ok(points.par_iter().map(normal).collect())
}

/// Mean distance of a point to its nearest neighbour, mm.
///
/// # Errors
/// [`CloudError`] for fewer than two points or one that is not finite.
pub fn mean_spacing_mm(points: &[Point3<f32>]) -> Result<f64, CloudError> {
    let tree = tree(points, 2)?;
    let two = NonZero::new(2).expect("two is not zero");
    let distance = |point: &Point3<f32>| {
        let near = tree
            .query(&point.coords.into())
            .nearest_n::<SquaredEuclidean<f32>>(two)
            .execute();
        f64::from(near[1].distance).sqrt()
    };
    // Summed in the order of the points, so that threads do not change the last digit.
    let distances: Vec<f64> = points.par_iter().map(distance).collect();
    Ok(distances.iter().sum::<f64>() / distances.len() as f64)
}

fn tree(points: &[Point3<f32>], expected: usize) -> Result<ImmutableKdTree<f32, 3>, CloudError> {
    let found = points.len();
    if found < expected {
        return Err(CloudError::TooFewPoints { found, expected });
    }
    if let Some(bad) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(CloudError::NotFinite(bad));
    }
    let rows: Vec<[f32; 3]> = points.iter().map(|p| p.coords.into()).collect();
    ImmutableKdTree::new_from_slice(&rows).map_err(|_| CloudError::TooManyPoints { found })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tilted_grid() -> (Vec<Point3<f32>>, Vector3<f32>) {
        let (u, v) = (
            Vector3::new(3.0, 0.0, 4.0) / 5.0,
            Vector3::new(0.0, 1.0, 0.0),
        );
        let at = |n: u16| u * f32::from(n % 20) * 2.0 + v * f32::from(n / 20) * 2.0;
        let points = (0..400).map(|n| Point3::from(at(n))).collect();
        (points, u.cross(&v))
    }

    #[test]
    fn a_plane_gets_its_own_normal_and_spacing() {
        let (points, normal) = tilted_grid();
        for found in estimate_normals(&points, 9).unwrap() {
            assert!(found.dot(&normal).abs() > 1.0 - 1e-5, "{found:?}");
        }
        let spacing = mean_spacing_mm(&points).unwrap();
        assert!((spacing - 2.0).abs() < 1e-4, "{spacing}");
    }

    #[test]
    fn few_or_broken_points_are_refused() {
        let (mut points, _) = tilted_grid();
        let few = estimate_normals(&points[..4], 9).unwrap_err();
        assert_eq!(
            few,
            CloudError::TooFewPoints {
                found: 4,
                expected: 9
            }
        );
        points[7].x = f32::NAN;
        assert_eq!(
            mean_spacing_mm(&points).unwrap_err(),
            CloudError::NotFinite(7)
        );
    }
}
