//! The lead letter on the detector that says which side of the body an image shows.

use nalgebra::Point2;
use ppa_core::Side;
use serde::{Deserialize, Serialize};

use crate::beam::detector::Detector;
use crate::beam::field::Field;
use crate::beam::projection_error::ProjectionError;
use crate::setters::setters;

/// Width of the letter and of its strokes, relative to its height.
const WIDTH: f64 = 0.65;
const STROKE: f64 = 0.17;
/// Outer radius of the bowl of the R, relative to the height of the letter.
const BOWL: f64 = 0.275;

/// Sampling points per side of a pixel for the share that the letter covers.
const POINTS: u32 = 16;

/// A lead letter L or R on the detector, upright with device y pointing down, readable from the side of the source.
///
/// It lets no photon through: 2 mm of lead transmit 1e-12 at 60 keV. X-rays of the lead itself are neglected, as are shadows on
/// the patient, who is in front of the letter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SideMarker {
    /// Side of the body that the letter names.
    pub side: Side,
    /// Middle of the letter in device x and y, mm from the foot of the perpendicular through the source.
    pub centre_mm: [f64; 2],
    /// Height of the letter, mm; it is 0.65 times as wide.
    pub height_mm: f64,
}

setters!(SideMarker {
    with_side: side = Side,
    with_centre_mm: centre_mm = [f64; 2],
    with_height_mm: height_mm = f64,
});

impl SideMarker {
    /// A letter of 15 mm.
    #[must_use]
    pub fn new(side: Side, centre_mm: [f64; 2]) -> Self {
        Self {
            side,
            centre_mm,
            height_mm: 15.0,
        }
    }

    /// Checks that the size of the letter is valid and that its middle is on the detector.
    ///
    /// # Errors
    /// [`ProjectionError::Marker`].
    pub fn check(&self, detector: &Detector) -> Result<(), ProjectionError> {
        let Self {
            centre_mm,
            height_mm,
            ..
        } = *self;
        let on_detector = detector.field().contains(&Point2::from(centre_mm));
        if (1.0..=100.0).contains(&height_mm) && on_detector {
            return Ok(());
        }
        Err(ProjectionError::Marker {
            height_mm,
            centre_mm,
            detector_mm: [detector.field().low_mm, detector.field().high_mm],
        })
    }

    /// Whether the letter covers a point of the detector plane, mm.
    pub(crate) fn covers(&self, at: Point2<f64>) -> bool {
        let [u, v] = [0, 1].map(|axis| (at[axis] - self.centre_mm[axis]) / self.height_mm);
        let (right, bottom) = (0.5 * WIDTH, 0.5);
        if u.abs() > right || v.abs() > bottom {
            return false;
        }
        let in_stem = u < -right + STROKE;
        in_stem
            || match self.side {
                Side::Left => v > bottom - STROKE,
                Side::Right => in_bowl(u, v) || in_leg(u, v),
            }
    }

    /// Returns the pixels that the letter covers fully or in part, and the covered share of each pixel's area.
    pub(crate) fn covered(&self, detector: &Detector) -> Vec<(usize, f64)> {
        let size_mm = [WIDTH * self.height_mm, self.height_mm];
        let frame = Field::centred(self.centre_mm, size_mm);
        let side_mm = [detector.pixel_mm; 2];
        (0..detector.pixels())
            .filter_map(|pixel| {
                let centre = detector.pixel_centre_mm(pixel);
                let square = Field::centred(centre.into(), side_mm);
                square.overlap(&frame)?;
                let share = self.covered_share(&square);
                (share > 0.0).then_some((pixel, share))
            })
            .collect()
    }

    fn covered_share(&self, square: &Field) -> f64 {
        let step_mm = square.size_mm().map(|side| side / f64::from(POINTS));
        let place =
            |axis: usize, i: u32| square.low_mm[axis] + (f64::from(i) + 0.5) * step_mm[axis];
        let points = (0..POINTS * POINTS)
            .map(|n| Point2::new(place(0, n % POINTS), place(1, n / POINTS)))
            .filter(|at| self.covers(*at));
        points.count() as f64 / f64::from(POINTS * POINTS)
    }
}

/// The bowl of an R: two bars and half a ring. Coordinates are relative to the middle of the letter, in units of its height.
fn in_bowl(u: f64, v: f64) -> bool {
    let (u, v) = (u - (0.5 * WIDTH - BOWL), (v + 0.5 - BOWL).abs());
    let from_middle = if u < 0.0 { v } else { u.hypot(v) };
    (BOWL - STROKE..=BOWL).contains(&from_middle)
}

/// The leg of an R, from under the bowl to the lower right corner.
fn in_leg(u: f64, v: f64) -> bool {
    let top = 2.0 * BOWL - 0.5 - STROKE;
    let down = (v - top) / (0.5 - top);
    let width = 1.2 * STROKE;
    let left = -0.3 * STROKE + down * (0.5 * WIDTH - width + 0.3 * STROKE);
    down >= 0.0 && (left..=left + width).contains(&u)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(side: Side) -> String {
        let marker = SideMarker::new(side, [0.0; 2]);
        let rows = (0..9).map(|row| {
            let points = (0..11).map(|column| {
                let at = Point2::new(f64::from(column) - 5.0, 1.7 * (f64::from(row) - 4.0));
                if marker.covers(at) { '#' } else { '.' }
            });
            points.collect::<String>()
        });
        rows.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn letters_look_like_l_and_r() {
        let left = [
            ".##........",
            ".##........",
            ".##........",
            ".##........",
            ".##........",
            ".##........",
            ".##........",
            ".#########.",
            ".#########.",
        ];
        assert_eq!(drawn(Side::Left), left.join("\n"));
        let right = [
            ".########..",
            ".#########.",
            ".##.....##.",
            ".#########.",
            ".########..",
            ".##...###..",
            ".##...###..",
            ".##....###.",
            ".##....###.",
        ];
        assert_eq!(drawn(Side::Right), right.join("\n"));
    }

    /// The area of an L is that of its two bars; the covered shares of the pixels add up to it.
    #[test]
    fn shares_of_pixels_sum_up_to_the_letter() {
        let detector = Detector::centred(120, 100, 0.3);
        let marker = SideMarker::new(Side::Left, [3.1, -2.2]);
        let sum: f64 = marker
            .covered(&detector)
            .iter()
            .map(|(_, share)| share)
            .sum();
        let expected = 15.0_f64.powi(2) * STROKE * (1.0 + WIDTH - STROKE);
        let area = sum * 0.3 * 0.3;
        assert!((area / expected - 1.0).abs() < 3e-3, "{area}, {expected}");
    }

    #[test]
    fn letters_off_the_detector_are_refused() {
        let detector = Detector::centred(120, 100, 0.3);
        for (centre_mm, height_mm) in [
            ([20.0, 0.0], 15.0),
            ([0.0; 2], 0.0),
            ([f64::NAN, 0.0], 15.0),
        ] {
            let marker = SideMarker::new(Side::Right, centre_mm).with_height_mm(height_mm);
            let error = marker.check(&detector).unwrap_err().to_string();
            assert!(error.contains("side marker"), "{error}");
        }
    }
}
