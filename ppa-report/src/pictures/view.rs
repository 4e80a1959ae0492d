//! Parallel projection of points in space onto a panel.

use nalgebra::{Point3, Vector3};

use super::canvas::Rect;

/// A parallel projection of space, mm, into a panel, pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// The point projected onto [`Self::middle`].
    centre: Point3<f64>,
    /// Unit direction to the right in the picture.
    pub(super) right: Vector3<f64>,
    /// Unit direction upwards in the picture.
    pub(super) up: Vector3<f64>,
    /// The pixel onto which the centre is projected.
    middle: [f64; 2],
    /// Pixels per millimetre.
    pub(super) pixels_per_mm: f64,
}

/// Part of a panel's width and height that is kept free on each side.
const FREE: f64 = 0.06;

impl View {
    /// Builds a view in which all points fit into `rect`. `right` and `up` are perpendicular unit vectors.
    pub(super) fn fitting(
        rect: Rect,
        [right, up]: [Vector3<f64>; 2],
        points: impl IntoIterator<Item = Point3<f64>>,
    ) -> Self {
        let axes = [right, up, right.cross(&up)];
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points {
            for (axis, direction) in axes.iter().enumerate() {
                let along = direction.dot(&point.coords);
                low[axis] = low[axis].min(along);
                high[axis] = high[axis].max(along);
            }
        }
        let empty = !low.iter().chain(&high).all(|along| along.is_finite());
        if empty {
            (low, high) = ([-0.5; 3], [0.5; 3]);
        }
        let size = [rect.width, rect.height].map(|pixels| f64::from(pixels) * (1.0 - 2.0 * FREE));
        let scale = |axis: usize| size[axis] / (high[axis] - low[axis]).max(1.0);
        let along = |axis: usize| 0.5 * (low[axis] + high[axis]);
        Self {
            centre: Point3::from(axes[0] * along(0) + axes[1] * along(1) + axes[2] * along(2)),
            right,
            up,
            middle: rect.middle(),
            pixels_per_mm: scale(0).min(scale(1)),
        }
    }

    /// Unit direction towards the viewer.
    pub(super) fn towards_viewer(&self) -> Vector3<f64> {
        self.right.cross(&self.up)
    }

    /// The pixel onto which a point is projected.
    pub(super) fn pixel(&self, point: &Point3<f64>) -> [f64; 2] {
        let offset = point - self.centre;
        [
            self.middle[0] + self.pixels_per_mm * self.right.dot(&offset),
            self.middle[1] - self.pixels_per_mm * self.up.dot(&offset),
        ]
    }

    /// Coordinate of a point towards the viewer, mm.
    pub(super) fn nearness(&self, point: &Point3<f64>) -> f64 {
        self.towards_viewer().dot(&(point - self.centre))
    }

    /// The point at a pixel with a given nearness.
    pub(super) fn point(&self, [x, y]: [f64; 2], nearness: f64) -> Point3<f64> {
        let across = (x - self.middle[0]) / self.pixels_per_mm;
        let upwards = (self.middle[1] - y) / self.pixels_per_mm;
        self.centre + self.right * across + self.up * upwards + self.towards_viewer() * nearness
    }

    /// The same view moved along the line of sight so that a point has nearness 0.
    pub(super) fn through(self, point: &Point3<f64>) -> Self {
        Self {
            centre: self.centre + self.towards_viewer() * self.nearness(point),
            ..self
        }
    }
}

/// Orientation letters of a direction in the ct frame (LPS), the strongest first: L or R, P or A, H or F.
///
/// A second or third letter is added if the direction leans towards it by more than 20 degrees.
pub(super) fn letters(direction: &Vector3<f64>) -> String {
    const LEAN: f64 = 0.342; // sin 20°
    let mut parts: Vec<(f64, char)> = direction
        .iter()
        .zip([['L', 'R'], ['P', 'A'], ['H', 'F']])
        .map(|(along, [plus, minus])| (along.abs(), if *along > 0.0 { plus } else { minus }))
        .filter(|(along, _)| *along > LEAN)
        .collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    parts.into_iter().map(|(_, letter)| letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PANEL: Rect = Rect {
        x: 100,
        y: 50,
        width: 200,
        height: 100,
    };

    #[test]
    fn points_fit_and_are_found_again() {
        let points = [[-40.0, 3.0, 10.0], [60.0, -7.0, 90.0]].map(Point3::from);
        let view = View::fitting(PANEL, [Vector3::x(), Vector3::z()], points);
        for point in points {
            let [x, y] = view.pixel(&point);
            assert!(
                (100.0..300.0).contains(&x) && (50.0..150.0).contains(&y),
                "{x} {y}"
            );
            let again = view.point([x, y], view.nearness(&point));
            assert!((again - point).norm() < 1e-9);
        }
        // Right is +x, up is +z, and the viewer looks along +y.
        let [low, high] = points.map(|p| view.pixel(&p));
        assert!(low[0] < high[0] && low[1] > high[1]);
        assert!(view.nearness(&points[1]) > view.nearness(&points[0]));
        let through = view.through(&points[0]);
        assert!(through.nearness(&points[0]).abs() < 1e-9);
    }

    #[test]
    fn a_view_of_one_point_or_of_none_has_a_finite_scale() {
        for points in [vec![], vec![Point3::new(1.0, 2.0, 3.0)]] {
            let view = View::fitting(PANEL, [Vector3::x(), Vector3::y()], points);
            assert!(view.pixel(&Point3::origin()).iter().all(|p| p.is_finite()));
        }
    }

    #[test]
    fn letters_name_the_directions_of_lps() {
        let of = |x: f64, y: f64, z: f64| letters(&Vector3::new(x, y, z).normalize());
        assert_eq!(of(1.0, 0.0, 0.1), "L");
        assert_eq!(of(-1.0, 0.0, 0.0), "R");
        assert_eq!(of(0.0, -1.0, 0.5), "AH");
        assert_eq!(of(0.5, 1.0, 0.0), "PL");
        assert_eq!(of(0.0, 0.1, -1.0), "F");
    }
}
