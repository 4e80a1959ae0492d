//! Visibility of the gutters in a radiograph: contrast-to-noise ratio with scatter and blur.

use nalgebra::{Isometry3, Point3, Vector2};
use ppa_xray::Detector;

use super::gutter::Gap;
use super::joint_space::JointSpace;

/// A measured radiograph: readings and their standard errors, row-major, in one unit.
#[derive(Debug, Clone, Copy)]
pub struct Reading<'a> {
    /// Number and size of the pixels.
    pub detector: &'a Detector,
    /// Source-detector distance, mm.
    pub source_detector_mm: f64,
    /// Pose of the device in the scan.
    pub ct_from_device: &'a Isometry3<f64>,
    /// Energy per pixel.
    pub value: &'a [f32],
    /// Its standard error.
    pub sigma: &'a [f32],
}

/// Visibility of the gutters in a radiograph; 0 is invisible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visibility {
    /// Medial gutter.
    pub medial: f64,
    /// Superior gutter.
    pub superior: f64,
    /// Lateral gutter.
    pub lateral: f64,
}

/// The gap must exceed the noise by this many standard errors: by chance one place in a thousand does.
const LEAST_CNR: f64 = 3.0;
/// Distance from the gap at which the bone is read, mm in the plane through the joint.
const BESIDE_MM: f64 = 2.0;

impl JointSpace {
    /// Visibility of each gutter: the mean over its places of the contrast ln(reading in the gap / reading next to it). The contrast is
    /// taken with the brighter of the two margins and counts as 0 unless it exceeds three standard errors. A gap that the beam crosses
    /// obliquely has no such contrast.
    pub fn visibility(&self, reading: &Reading) -> Visibility {
        let of = |gaps: &[Gap]| {
            let contrasts = gaps.iter().map(|gap| reading.contrast(gap).unwrap_or(0.0));
            contrasts.sum::<f64>() / gaps.len() as f64
        };
        Visibility {
            medial: of(&self.medial.gaps),
            superior: of(&self.superior.gaps),
            lateral: of(&self.lateral.gaps),
        }
    }
}

impl Reading<'_> {
    fn contrast(&self, gap: &Gap) -> Option<f64> {
        let [foot, end] = [gap.foot, gap.end()].map(|p| self.pixel(&p));
        let middle = self.at((foot + end) / 2.0)?;
        let magnified = self.source_detector_mm / self.depth_mm(&gap.foot);
        let aside = BESIDE_MM * magnified / self.detector.pixel_mm;
        // Seen end on, a gap has no sides.
        let across = (end - foot).try_normalize(1e-6)?;
        let beside = [foot - across * aside, end + across * aside];
        let [a, b] = beside.map(|at| self.at(at));
        let (a, b) = (a?, b?);
        let brighter = if a.0 > b.0 { a } else { b };
        let contrast = (middle.0 / brighter.0).ln();
        let sigma = (middle.1 / middle.0).hypot(brighter.1 / brighter.0);
        (contrast > LEAST_CNR * sigma).then_some(contrast)
    }

    fn depth_mm(&self, p: &Point3<f64>) -> f64 {
        self.ct_from_device.inverse_transform_point(p).z
    }

    /// Column and row at which a point is projected; pixel centres are whole numbers.
    fn pixel(&self, p: &Point3<f64>) -> Vector2<f64> {
        let p = self.ct_from_device.inverse_transform_point(p);
        let first = self.detector.pixel_centre_mm(0);
        let at = Point3::from(p.coords * (self.source_detector_mm / p.z));
        (at.xy() - first) / self.detector.pixel_mm
    }

    /// Interpolated reading and standard error; `None` off the detector and where nothing was read.
    fn at(&self, pixel: Vector2<f64>) -> Option<(f64, f64)> {
        let [x, y] = [pixel.x.floor(), pixel.y.floor()];
        let (columns, rows) = (self.detector.columns as usize, self.detector.rows as usize);
        let inside = x >= 0.0 && y >= 0.0 && x + 1.0 < columns as f64 && y + 1.0 < rows as f64;
        if !inside {
            return None;
        }
        let (fx, fy) = (pixel.x - x, pixel.y - y);
        let first = y as usize * columns + x as usize;
        let corners = [
            (first, (1.0 - fx) * (1.0 - fy)),
            (first + 1, fx * (1.0 - fy)),
            (first + columns, (1.0 - fx) * fy),
            (first + columns + 1, fx * fy),
        ];
        let (mut value, mut variance) = (0.0, 0.0);
        for (pixel, weight) in corners {
            value += weight * f64::from(self.value[pixel]);
            variance += (weight * f64::from(self.sigma[pixel])).powi(2);
        }
        (value > 0.0).then(|| (value, variance.sqrt()))
    }
}
