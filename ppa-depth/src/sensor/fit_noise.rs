//! The noise of a real camera, from a recording of a static scene.

use crate::camera::projection::Camera;
use crate::image::{DepthError, DepthImage};
use crate::render::surface::signal;
use crate::sensor::local_plane::{MeanDepth, local_plane};
use crate::sensor::spec::RandomError;

/// Random error fitted to a recording, and quality of the fit.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct NoiseFit {
    /// Fitted parameters.
    pub random: RandomError,
    /// Signal below which pixels are lost in more than half of the frames; `None` if the recording has no such pixels.
    pub min_signal: Option<f64>,
    /// Number of frames.
    pub frames: usize,
    /// Number of pixels used in the fit.
    pub pixels: usize,
    /// Root mean square of (measured − fitted) / fitted standard deviation, over the classes of signal.
    pub relative_misfit: f64,
    /// Signal, measured and fitted standard deviation (mm) of each class.
    pub classes: Vec<[f64; 3]>,
}

/// Why no noise can be fitted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Too few frames.
    #[error("{0} frames, expected at least 3 of a static scene")]
    Frames(usize),
    /// A frame is not of the size of the camera's images.
    #[error("frame {frame}")]
    Size {
        /// Index of the frame, from 0.
        frame: usize,
        /// Error with both sizes.
        source: DepthError,
    },
    /// Too few pixels see a surface.
    #[error("{0} pixels see a surface in every frame, expected at least 1000")]
    Pixels(usize),
    /// The noise is too small to be measured.
    #[error(
        "the depths vary enough to be distinguished from rounding in only {0} of 20 signal classes, expected at least 4: record surfaces further away"
    )]
    Quiet(usize),
    /// All pixels have the same signal.
    #[error(
        "the signal varies by a factor of only {0:.2}, expected 1.2 or more: record surfaces at several distances"
    )]
    Signal(f64),
}

/// Classes of equal size, by signal.
const CLASSES: usize = 20;
/// Smallest number of classes for a fit of two parameters.
const LEAST_CLASSES: usize = 4;
/// Variance of rounding to whole millimetres, mm².
const ROUNDING_MM2: f64 = 1.0 / 12.0;

/// Fits variance = floor² + (at_unit_signal / S)² to the spread of every pixel over the frames of a still scene.
///
/// `whole_mm`: the frames were rounded to millimetres, as 16-bit PNGs are; the variance of rounding is then subtracted. The angle of
/// incidence of a pixel is that of a plane through its surroundings of 9 x 9 pixels; pixels at edges are excluded, since they mix
/// surfaces. The signal is that of diffuse surfaces of one reflectivity. Constant offsets of
/// the device cannot be found from such a recording.
///
/// # Errors
/// [`FitError`] for too few frames, pixels or too little variety, or frames that are not the camera's.
pub fn fit_noise(
    camera: &Camera,
    frames: &[DepthImage],
    whole_mm: bool,
) -> Result<NoiseFit, FitError> {
    if frames.len() < 3 {
        return Err(FitError::Frames(frames.len()));
    }
    for (frame, image) in frames.iter().enumerate() {
        image
            .check_camera(camera)
            .map_err(|source| FitError::Size { frame, source })?;
    }
    let depths = means(frames);
    // Signal, variance of the range, share of frames without a depth.
    let mut pixels = Vec::new();
    let mut always = 0;
    for (pixel, depth) in depths.iter().enumerate() {
        let (Some(ray), true) = (camera.rays()[pixel], depth.frames > 0) else {
            continue;
        };
        let Some(plane) = local_plane(camera, &depths, pixel) else {
            continue;
        };
        let ray = (1.0 + ray.norm_squared()).sqrt();
        let s = signal(plane.cos_incidence, plane.z_mm * ray);
        let count = frames.len();
        let variance = depth
            .variance_mm2
            .filter(|_| depth.frames == count)
            .map(|of_mean| {
                always += 1;
                let rounding = if whole_mm { ROUNDING_MM2 } else { 0.0 };
                (count as f64 * of_mean - rounding) * ray * ray
            });
        pixels.push((s, variance, 1.0 - depth.frames as f64 / count as f64));
    }
    if always < 1000 {
        return Err(FitError::Pixels(always));
    }
    pixels.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let measured: Vec<(f64, f64)> = pixels.iter().filter_map(|p| Some((p.0, p.1?))).collect();
    let range = measured[always - 1].0 / measured[0].0;
    if range < 1.2 {
        return Err(FitError::Signal(range));
    }
    // Mean variance of each class against the mean of 1/S².
    let class = |points: &[(f64, f64)]| {
        let n = points.len() as f64;
        let mean = |value: fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / n;
        (mean(|p| p.0.powi(-2)), mean(|p| p.1))
    };
    // Rounding hides smaller variances: such classes carry no information.
    let least = if whole_mm { ROUNDING_MM2 } else { 0.0 };
    let classes: Vec<_> = measured
        .chunks(always.div_ceil(CLASSES))
        .map(class)
        .filter(|(_, variance)| *variance > least)
        .collect();
    if classes.len() < LEAST_CLASSES {
        return Err(FitError::Quiet(classes.len()));
    }
    let (floor2, unit2) = line(&classes);
    let fitted = |x: f64| (floor2 + unit2 * x).sqrt();
    let rows: Vec<[f64; 3]> = classes
        .iter()
        .map(|&(x, variance)| [x.powf(-0.5), variance.max(0.0).sqrt(), fitted(x)])
        .collect();
    let misfit = |row: &[f64; 3]| (row[1] / row[2] - 1.0).powi(2);
    Ok(NoiseFit {
        random: RandomError {
            floor_mm: floor2.sqrt(),
            at_unit_signal_mm: unit2.sqrt(),
        },
        min_signal: least_signal(&pixels),
        frames: frames.len(),
        pixels: always,
        relative_misfit: (rows.iter().map(misfit).sum::<f64>() / rows.len() as f64).sqrt(),
        classes: rows,
    })
}

/// Mean depths of the pixels.
fn means(frames: &[DepthImage]) -> Vec<MeanDepth> {
    let of_pixel = |pixel: usize| {
        let depths = frames.iter().map(|frame| f64::from(frame.z_mm[pixel]));
        let depths = depths.filter(|z| *z > 0.0);
        let frames = depths.clone().count();
        let count = frames as f64;
        let z_mm = depths.clone().sum::<f64>() / count.max(1.0);
        let spread = depths.map(|z| (z - z_mm).powi(2)).sum::<f64>();
        let variance_mm2 = (frames > 1).then(|| spread / (count - 1.0) / count);
        MeanDepth {
            z_mm,
            variance_mm2,
            frames,
        }
    };
    (0..frames[0].z_mm.len()).map(of_pixel).collect()
}

/// Least squares of y = a + b x with weights 1/y², since the spread of a variance is proportional to it; a and b are at least 0.
fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let weight = |y: f64| 1.0 / y.max(1e-6).powi(2);
    let sum = |value: &dyn Fn(f64, f64) -> f64| {
        points
            .iter()
            .map(|&(x, y)| weight(y) * value(x, y))
            .sum::<f64>()
    };
    let (n, sx, sy) = (sum(&|_, _| 1.0), sum(&|x, _| x), sum(&|_, y| y));
    let (sxx, sxy) = (sum(&|x, _| x * x), sum(&|x, y| x * y));
    let b = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    let a = (sy - b * sx) / n;
    if a < 0.0 {
        (0.0, (sxy / sxx).max(0.0))
    } else if b < 0.0 {
        (sy / n, 0.0)
    } else {
        (a, b)
    }
}

/// Signal below which pixels are lost in more than half of the frames.
fn least_signal(pixels: &[(f64, Option<f64>, f64)]) -> Option<f64> {
    let classes = pixels.chunks(pixels.len().div_ceil(CLASSES));
    let lost = |class: &[(f64, Option<f64>, f64)]| {
        class.iter().map(|pixel| pixel.2).sum::<f64>() / class.len() as f64
    };
    let gone = classes.take_while(|class| lost(class) > 0.5).last()?;
    Some(gone[gone.len() - 1].0)
}
