//! Convex outlines of bones in a slice.

use nalgebra::{Matrix2, SymmetricEigen, Vector2};

/// A convex polygon, counterclockwise, with its area and moments; mm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hull {
    corners: Vec<Vector2<f64>>,
    pub(crate) area_mm2: f64,
    pub(crate) centre: Vector2<f64>,
    /// Second moments of the area about the centre, mm⁴.
    pub(crate) moments: Matrix2<f64>,
}

impl Hull {
    /// The hull of a set of points by Andrew's monotone chain; `None` when it has no area.
    pub(crate) fn around(mut points: Vec<Vector2<f64>>) -> Option<Self> {
        points.sort_by(|p, q| p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)));
        let mut corners = half(points.iter());
        corners.pop();
        corners.extend(half(points.iter().rev()));
        corners.pop();
        let start = *corners.first()?;
        let (mut area, mut first) = (0.0, Vector2::zeros());
        let mut second = Matrix2::zeros();
        for pair in corners.windows(2) {
            let (p, q) = (pair[0] - start, pair[1] - start);
            let triangle = 0.5 * p.perp(&q);
            area += triangle;
            first += (p + q) * (triangle / 3.0);
            // Mean of x xᵀ over a triangle with one corner at the origin.
            let sum = p + q;
            let mean = p * p.transpose() + q * q.transpose() + sum * sum.transpose();
            second += mean * (triangle / 12.0);
        }
        if area < 1e-9 {
            return None;
        }
        let offset = first / area;
        Some(Self {
            corners,
            area_mm2: area,
            centre: start + offset,
            moments: second - offset * offset.transpose() * area,
        })
    }

    /// Where the hull begins and ends along a unit direction, mm.
    pub(crate) fn extent(&self, along: &Vector2<f64>) -> [f64; 2] {
        let places = self.corners.iter().map(|corner| corner.dot(along));
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            [low.min(place), high.max(place)]
        })
    }

    /// Length along the direction in which the hull extends most.
    pub(crate) fn length_mm(&self) -> f64 {
        let [low, high] = self.extent(&longest(&self.moments));
        high - low
    }
}

/// Unit direction of the largest second moment.
pub(crate) fn longest(moments: &Matrix2<f64>) -> Vector2<f64> {
    let eigen = SymmetricEigen::new(*moments);
    eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned()
}

/// The lower hull of points sorted along x; the upper one of points in reverse.
fn half<'a>(points: impl Iterator<Item = &'a Vector2<f64>>) -> Vec<Vector2<f64>> {
    let mut chain: Vec<Vector2<f64>> = Vec::new();
    for p in points {
        while let [.., a, b] = chain[..] {
            if (b - a).perp(&(p - a)) > 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(*p);
    }
    chain
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rotated rectangle of 30 x 10 mm with points inside.
    #[test]
    fn area_centre_and_moments_are_those_of_a_rectangle() {
        let (along, aside) = (Vector2::new(0.6, 0.8), Vector2::new(-0.8, 0.6));
        let middle = Vector2::new(70.0, -20.0);
        let points = (0..=30).flat_map(|i| (0..=10).map(move |j| [f64::from(i), f64::from(j)]));
        let points = points.map(|[i, j]| middle + along * (i - 15.0) + aside * (j - 5.0));
        let hull = Hull::around(points.collect()).unwrap();
        assert!((hull.area_mm2 - 300.0).abs() < 1e-9);
        assert!((hull.centre - middle).norm() < 1e-9);
        assert!((hull.length_mm() - 30.0).abs() < 1e-9);
        assert!(longest(&hull.moments).perp(&along).abs() < 1e-9);
        // w h³ / 12 and h w³ / 12.
        let [most, least] = [along, aside].map(|d| d.dot(&(hull.moments * d)));
        assert!((most - 22_500.0).abs() < 1e-6 && (least - 2_500.0).abs() < 1e-6);
    }

    #[test]
    fn points_on_a_line_have_no_hull() {
        assert_eq!(Hull::around(vec![]), None);
        let line = (0..5).map(|i| Vector2::new(f64::from(i), 2.0 * f64::from(i)));
        assert_eq!(Hull::around(line.collect()), None);
    }
}
