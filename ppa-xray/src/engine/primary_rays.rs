//! Deterministic rays from focal spot to detector: transmitted energy and its second moment.

use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::beam::spectral_lines::SpectralLines;
use crate::detector::response::LineResponse;
use crate::engine::attenuation_basis::{LANES, dot};
use crate::engine::exposure::Exposure;
use crate::engine::paths::Paths;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// What all rays share.
pub(crate) struct PrimaryRays<'a> {
    pub transport: &'a Transport<'a>,
    paths: &'a Paths<'a>,
    lines: SpectralLines,
    /// Of the basis materials at every line.
    attenuation: Vec<Vec<[f32; LANES]>>,
    response: LineResponse<'a>,
}

/// Buffers of one thread.
pub(crate) struct Scratch {
    mass: Vec<[f32; LANES]>,
    /// With nothing in the beam, line by line: first two moments of the energy per cm² and history that stays in the detector.
    open: Vec<Moments>,
}

impl<'a> PrimaryRays<'a> {
    pub fn new(exposure: &'a Exposure<'a>, paths: &'a Paths<'a>, lines: SpectralLines) -> Self {
        let energies = lines.energy_kev.iter();
        Self {
            transport: &exposure.transport,
            paths,
            attenuation: energies.map(|&kev| paths.basis.at(kev)).collect(),
            response: exposure.response.at_lines(&lines.energy_kev),
            lines,
        }
    }

    pub fn per_pixel(&self, of: impl Fn(usize, &mut Scratch) -> Moments + Sync) -> Vec<Moments> {
        let detector = self.transport.projection.detector;
        (0..detector.pixels())
            .into_par_iter()
            .with_min_len((detector.columns as usize).min(64))
            .map_init(
                || Scratch {
                    mass: vec![[0.0; LANES]; self.paths.basis.groups],
                    open: Vec::new(),
                },
                |scratch, pixel| of(pixel, scratch),
            )
            .collect()
    }

    pub fn pixel(&self, pixel: usize) -> Field {
        let detector = self.transport.projection.detector;
        let centre = detector.pixel_centre_mm(pixel);
        Field::centred([centre.x, centre.y], [detector.pixel_mm; 2])
    }

    /// The part of a pixel that lies in the field: its edges are sharp.
    pub fn lit(&self, pixel: usize) -> Option<Field> {
        self.pixel(pixel).overlap(self.transport.emitter.field())
    }

    /// Prepares for rays to `at` and close by: what would stay in the detector there with nothing in the beam, mean over
    /// `spots`.
    pub fn aim(&self, spots: &[Point3<f64>], at: Point2<f64>, scratch: &mut Scratch) {
        let emitter = &self.transport.emitter;
        scratch.open.clear();
        scratch
            .open
            .resize(self.lines.energy_kev.len(), Moments::default());
        for spot in spots {
            let direction = (self.on_plane(at) - spot).normalize();
            let photons = emitter.open_fluence_cm2(spot, at) / spots.len() as f64;
            let shares = self.lines.mixed(emitter.mixture(&direction));
            let left = self.response.moments(at.into(), &direction);
            for ((sum, share), left) in scratch.open.iter_mut().zip(shares).zip(left) {
                *sum = [*sum, left.scaled(photons * share)].into_iter().sum();
            }
        }
    }

    /// Moments of the energy per cm² and history that arrives on the way from `spot` to `at`, close to where the rays were
    /// aimed at.
    #[inline]
    pub fn behind(&self, spot: &Point3<f64>, at: Point2<f64>, scratch: &mut Scratch) -> Moments {
        let Scratch { mass, open } = scratch;
        self.paths.between(spot, &self.on_plane(at), mass);
        let lines = open.iter().zip(&self.attenuation);
        let arriving = lines.map(|(open, mu)| open.scaled(f64::from(-dot(mass, mu)).exp()));
        arriving.sum()
    }

    fn on_plane(&self, at: Point2<f64>) -> Point3<f64> {
        Point3::new(at.x, at.y, self.transport.projection.source_detector_mm)
    }
}

pub(crate) fn centre(field: Field) -> Point2<f64> {
    Point2::from([0, 1].map(|axis| 0.5 * (field.low_mm[axis] + field.high_mm[axis])))
}

pub(crate) fn area_cm2(field: Field) -> f64 {
    let [x, y] = field.size_mm();
    x * y / 100.0
}
