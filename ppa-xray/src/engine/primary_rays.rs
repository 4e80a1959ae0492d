//! Deterministic rays from focal spot to detector: transmitted energy and its second moment.
//!
//! docs/physics.md, "Fast engine", primary.

use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::beam::spectral_lines::SpectralLines;
use crate::detector::response::LineResponse;
use crate::engine::attenuation_basis::{LANES, exponents};
use crate::engine::exposure::Exposure;
use crate::engine::open_beam::{LineMoments, OpenBeam};
use crate::engine::paths::Paths;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;
use crate::vector_math::{WIDTH, exp, pad};

/// Data shared by all rays.
pub(crate) struct PrimaryRays<'a> {
    pub transport: &'a Transport<'a>,
    paths: &'a Paths<'a>,
    lines: SpectralLines,
    /// Attenuation of every basis material, line by line, padded to a multiple of [`WIDTH`].
    attenuation: Vec<Vec<f32>>,
    response: LineResponse<'a>,
}

/// Buffers of one thread.
pub(crate) struct Scratch {
    mass: Vec<[f32; LANES]>,
    /// First two moments of the energy per cm² and history deposited in the detector with nothing in the beam.
    open: LineMoments,
}

impl<'a> PrimaryRays<'a> {
    pub fn new(exposure: &'a Exposure<'a>, paths: &'a Paths<'a>, lines: SpectralLines) -> Self {
        Self {
            transport: &exposure.transport,
            paths,
            attenuation: paths.basis.by_line(&lines.energy_kev),
            response: exposure.response.at_lines(&lines.energy_kev),
            lines,
        }
    }

    pub fn per_pixel(
        &self,
        pixels: impl IndexedParallelIterator<Item = usize>,
        of: impl Fn(usize, &mut Scratch) -> Moments + Sync,
    ) -> Vec<Moments> {
        let columns = self.transport.projection.detector.columns as usize;
        pixels
            .with_min_len(columns.min(64))
            .map_init(
                || Scratch {
                    mass: vec![[0.0; LANES]; self.paths.basis.groups],
                    open: LineMoments::default(),
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

    /// The part of a pixel that photons reach.
    pub fn lit(&self, pixel: usize) -> Option<Field> {
        self.pixel(pixel).overlap(self.transport.emitter.field())
    }

    /// Energy deposited in the detector at `at` with nothing in the beam, averaged over `spots`.
    fn open(&self, spots: &[Point3<f64>], at: Point2<f64>) -> LineMoments {
        let emitter = &self.transport.emitter;
        let mut open = vec![Moments::default(); self.lines.energy_kev.len()];
        for spot in spots {
            let direction = (self.on_plane(at) - spot).normalize();
            let photons = emitter.open_fluence_cm2(spot, at) / spots.len() as f64;
            let shares = self.lines.mixed(emitter.mixture(&direction));
            let left = self.response.moments(at.into(), &direction);
            for ((sum, share), left) in open.iter_mut().zip(shares).zip(left) {
                *sum = [*sum, left.scaled(photons * share)].into_iter().sum();
            }
        }
        let padded = |of: fn(&Moments) -> f64| {
            let mut values: Vec<f32> = open.iter().map(|moments| of(moments) as f32).collect();
            pad(&mut values);
            values
        };
        LineMoments {
            mean_kev: padded(|moments| moments.mean_kev),
            square_kev2: padded(|moments| moments.square_kev2),
        }
    }

    /// [`PrimaryRays::aim`] for all points of the detector in the field.
    pub fn open_beam(&self, spots: &[Point3<f64>]) -> Option<OpenBeam> {
        let detector = self.transport.projection.detector.field();
        let lit = detector.overlap(self.transport.emitter.field())?;
        Some(OpenBeam::new(&lit, |at| self.open(spots, at)))
    }

    /// Prepares for rays to `at` and nearby: energy deposited in the detector there with nothing in the beam, averaged over
    /// `spots`.
    pub fn aim(&self, spots: &[Point3<f64>], at: Point2<f64>, scratch: &mut Scratch) {
        scratch.open = self.open(spots, at);
    }

    /// [`PrimaryRays::aim`] by interpolation in a table.
    pub fn aim_from_table(&self, open_beam: &OpenBeam, at: Point2<f64>, scratch: &mut Scratch) {
        open_beam.interpolate(at, &mut scratch.open);
    }

    /// Moments of the energy per cm² and history that arrives on the path from `spot` to `at`, which is close to the prepared
    /// point.
    #[inline]
    pub fn behind(&self, spot: &Point3<f64>, at: Point2<f64>, scratch: &mut Scratch) -> Moments {
        let Scratch { mass, open } = scratch;
        self.paths.between(spot, &self.on_plane(at), mass);
        let mut sums = [[0.0_f32; WIDTH]; 2];
        let lines = open.mean_kev.chunks_exact(WIDTH);
        for (chunk, (mean, square)) in lines.zip(open.square_kev2.chunks_exact(WIDTH)).enumerate() {
            let exponent = exponents(mass, &self.attenuation, chunk * WIDTH);
            for lane in 0..WIDTH {
                let through = exp(-exponent[lane]);
                sums[0][lane] += mean[lane] * through;
                sums[1][lane] += square[lane] * through;
            }
        }
        let [mean_kev, square_kev2] = sums.map(|lanes| lanes.iter().copied().map(f64::from).sum());
        Moments {
            mean_kev,
            square_kev2,
        }
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
