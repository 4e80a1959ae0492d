//! Applies the sensor model to an ideal depth image.

use nalgebra::Complex;
use rayon::prelude::*;

use crate::camera::projection::Camera;
use crate::image::{DepthError, DepthImage};
use crate::render::sampled::{SAMPLES, SampledImage};
use crate::render::surface::{Surface, signal};
use crate::sensor::modulation::phase_per_mm;
use crate::sensor::multipath::one_bounce;
use crate::sensor::random::{Purpose, normals};
use crate::sensor::spec::{SensorError, SensorSpec};

/// One device: its constant errors are drawn when it is created.
#[derive(Debug, Clone)]
pub struct Sensor {
    spec: SensorSpec,
    device_seed: u64,
    offset_mm: f64,
    slope: f64,
    /// Cosine of the largest angle of incidence.
    least_cos: f64,
}

/// Light of a pixel: the sum of phasors relative to `reference_mm`, and of their lengths.
struct Light {
    sum: Complex<f64>,
    total: f64,
    reference_mm: f64,
}

impl Sensor {
    /// Creates the device given by `device_seed`.
    ///
    /// # Errors
    /// [`SensorError`] for a number out of range.
    pub fn new(spec: SensorSpec, device_seed: u64) -> Result<Self, SensorError> {
        spec.check()?;
        let [offset, slope, ..] = normals(device_seed, Purpose::DeviceError, 0, 0);
        let (offset_mm, slope) = spec.systematic.map_or((0.0, 0.0), |s| {
            (s.offset_mm * offset, s.per_metre_mm * slope / 1000.0)
        });
        let largest_deg = spec.invalid.map_or(90.0, |invalid| invalid.max_angle_deg);
        Ok(Self {
            least_cos: largest_deg.to_radians().cos(),
            spec,
            device_seed,
            offset_mm,
            slope,
        })
    }

    /// Parameters of the sensor.
    pub fn spec(&self) -> &SensorSpec {
        &self.spec
    }

    /// The depth image that the sensor measures in one frame. Random numbers are addressed by (seed, frame, pixel), so the image is
    /// the same for any number of threads.
    ///
    /// # Errors
    /// [`DepthError::OtherCamera`] if `seen` is not of the size of `camera`'s images.
    pub fn observe(
        &self,
        camera: &Camera,
        seen: &SampledImage,
        seed: u64,
        frame: u64,
    ) -> Result<DepthImage, DepthError> {
        let image = &seen.image;
        let (found, expected) = (
            [image.width, image.height],
            [camera.width(), camera.height()],
        );
        if found != expected {
            return Err(DepthError::OtherCamera { found, expected });
        }
        if image.z_mm.len() != camera.rays().len() {
            let [width, height] = found;
            return Err(DepthError::Length {
                width,
                height,
                found: image.z_mm.len(),
            });
        }
        let surface = Surface::new(camera, image);
        let bounced = (self.spec.multipath).map(|multipath| one_bounce(&surface, image, multipath));
        let mut z_mm = vec![0.0; image.z_mm.len()];
        let width = image.width as usize;
        z_mm.par_chunks_mut(4 * width)
            .enumerate()
            .for_each(|(chunk, z_mm)| {
                let first = chunk * 4 * width;
                let mut edge = seen
                    .edges
                    .partition_point(|(pixel, _)| (*pixel as usize) < first);
                let mut numbers = None;
                for (i, z_mm) in z_mm.iter_mut().enumerate() {
                    let pixel = first + i;
                    let samples = match seen.edges.get(edge) {
                        Some((at, samples)) if *at as usize == pixel => {
                            edge += 1;
                            Some(samples)
                        }
                        _ => None,
                    };
                    if i % 4 == 0 {
                        numbers = None;
                    }
                    let samples = samples.filter(|_| self.spec.mixed.is_some());
                    if samples.is_none() && image.z_mm[pixel] == 0.0 {
                        continue;
                    }
                    let Some(ray) = surface.ray_length(pixel) else {
                        continue;
                    };
                    let cos_incidence = surface.cos_incidence(pixel);
                    let bounced = bounced.as_ref().map(|light| light[pixel]);
                    let measured = self
                        .light(&surface, image, (pixel, ray), cos_incidence, samples)
                        .and_then(|light| self.range(light, cos_incidence, bounced));
                    let Some((range_mm, signal)) = measured else {
                        continue;
                    };
                    let (noise, pattern) =
                        numbers.get_or_insert_with(|| self.draw(seed, frame, (pixel / 4) as u32));
                    let drawn = [noise[i % 4], pattern[i % 4]];
                    let range_mm = self.disturbed(range_mm, signal, drawn);
                    *z_mm = (range_mm / ray).max(0.0) as f32;
                }
            });
        Ok(DepthImage {
            width: image.width,
            height: image.height,
            z_mm,
        })
    }

    /// Standard normal numbers of four pixels: of this frame, and of the device.
    fn draw(&self, seed: u64, frame: u64, block: u32) -> ([f64; 4], [f64; 4]) {
        let noise = (self.spec.random).map(|_| normals(seed, Purpose::RangeNoise, frame, block));
        let pattern = (self.spec.systematic)
            .filter(|systematic| systematic.fixed_pattern_mm > 0.0)
            .map(|_| normals(self.device_seed, Purpose::FixedPattern, 0, block));
        (noise.unwrap_or_default(), pattern.unwrap_or_default())
    }

    /// Direct light of a pixel; `ray` is the length of its ray (X/Z, Y/Z, 1).
    fn light(
        &self,
        surface: &Surface,
        image: &DepthImage,
        (pixel, ray): (usize, f64),
        cos_incidence: f64,
        samples: Option<&[f32; SAMPLES]>,
    ) -> Option<Light> {
        let Some(samples) = samples else {
            let reference_mm = f64::from(image.z_mm[pixel]) * ray;
            if reference_mm <= 0.0 {
                return None;
            }
            let total = signal(cos_incidence, reference_mm);
            return Some(Light {
                sum: Complex::new(total, 0.0),
                total,
                reference_mm,
            });
        };
        let nearest = samples
            .iter()
            .filter(|z| **z > 0.0)
            .fold(f32::INFINITY, |a, b| a.min(*b));
        if nearest.is_infinite() {
            return None;
        }
        let phase = phase_per_mm(self.spec.mixed?.modulation_mhz);
        let reference_mm = f64::from(nearest) * ray;
        let mut light = Light {
            sum: Complex::new(0.0, 0.0),
            total: 0.0,
            reference_mm,
        };
        for &z in samples.iter().filter(|z| **z > 0.0) {
            let range_mm = f64::from(z) * ray;
            let cos = surface.cos_incidence(surface.closest(pixel, z));
            let amplitude = signal(cos, range_mm) / SAMPLES as f64;
            light.sum += Complex::from_polar(amplitude, phase * (range_mm - reference_mm));
            light.total += amplitude;
        }
        Some(light)
    }

    /// Range and signal of the light; `None` if the pixel is rejected.
    fn range(
        &self,
        light: Light,
        cos_incidence: f64,
        bounced: Option<Complex<f64>>,
    ) -> Option<(f64, f64)> {
        let mut range_mm = light.reference_mm;
        let mut signal = light.total;
        // The light of one surface has no phase of its own.
        if let Some(mixed) = self.spec.mixed
            && light.sum.im != 0.0
        {
            range_mm += light.sum.arg() / phase_per_mm(mixed.modulation_mhz);
            signal = light.sum.norm();
        }
        if let Some(invalid) = self.spec.invalid {
            let too_oblique = cos_incidence < self.least_cos;
            let mixed = signal < invalid.min_contrast * light.total;
            if signal < invalid.min_signal || too_oblique || mixed {
                return None;
            }
        }
        // Bounced light comes with its phase relative to the direct light of the same pixel.
        if let (Some(bounced), Some(multipath)) = (bounced, self.spec.multipath) {
            let sum = Complex::new(signal, 0.0) + bounced;
            signal = sum.norm();
            range_mm += sum.arg() / phase_per_mm(multipath.modulation_mhz);
        }
        Some((range_mm, signal))
    }

    fn disturbed(&self, range_mm: f64, signal: f64, [noise, pattern]: [f64; 2]) -> f64 {
        let random = self.spec.random.map_or(0.0, |random| {
            noise * (random.floor_mm.powi(2) + (random.at_unit_signal_mm / signal).powi(2)).sqrt()
        });
        let fixed = (self.spec.systematic).map_or(0.0, |s| s.fixed_pattern_mm * pattern);
        range_mm * (1.0 + self.slope) + self.offset_mm + fixed + random
    }
}
