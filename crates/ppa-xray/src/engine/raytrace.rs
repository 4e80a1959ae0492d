//! The primary image without randomness: line integrals through the voxels, averaged over each pixel.

use nalgebra::{Point2, Point3, Unit, Vector3};
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::detector::response::LineResponse;
use crate::engine::attenuation_basis::LANES;
use crate::engine::paths::Paths;
use crate::engine::spectral_quadrature::SpectralQuadrature;
use crate::matter::compton::ComptonModel;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tally::Moments;
use crate::transport::tracking::{Transport, TransportError};

/// Energy of unscattered photons per pixel, row-major, eV/cm² per history.
///
/// Each pixel is the mean over `samples_per_side`² evenly spread rays; rays through pixel centres alone are
/// off by up to 13 % at sharp edges. Voxels are homogeneous, as in the transport.
///
/// # Errors
/// As [`crate::analog`]; also when `samples_per_side` is not 1 to 64.
pub fn primary(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    samples_per_side: u32,
) -> Result<Vec<f64>, TransportError> {
    check_samples(samples_per_side)?;
    let transport = Transport::new(phantom, spectrum, projection, ComptonModel::default())?;
    let paths = Paths::new(&transport);
    let quadratures = SpectralQuadrature::exact(&transport);
    let primary = Primary::new(&transport, &paths, &quadratures);
    let ev_cm2 = 1e3 / projection.detector.pixel_cm2();
    let moments = primary.per_pixel(|pixel, scratch| {
        primary.lit(pixel).map_or_else(Moments::default, |lit| {
            primary.sampled(lit, samples_per_side, scratch)
        })
    });
    Ok(moments.iter().map(|m| m.mean_kev * ev_cm2).collect())
}

pub(crate) fn check_samples(samples_per_side: u32) -> Result<(), TransportError> {
    if (1..=64).contains(&samples_per_side) {
        return Ok(());
    }
    Err(TransportError::Setting {
        what: "the number of rays per pixel side",
        found: f64::from(samples_per_side),
        expected: "1 to 64",
    })
}

/// First two moments per history of the primary energy in every pixel.
///
/// One ray through the centre where the image bends little, up to `samples_per_side`² where it does not.
pub(crate) fn primary_moments(
    transport: &Transport,
    paths: &Paths,
    quadratures: &[SpectralQuadrature],
    samples_per_side: u32,
) -> Vec<Moments> {
    let primary = Primary::new(transport, paths, quadratures);
    let detector = transport.projection.detector;
    let cuts = samples_per_side.ilog2();
    let voxels_per_pixel = primary.voxels_per_pixel();
    let fine = voxels_per_pixel <= 0.5;
    let sure_cuts = voxels_per_pixel.log2().ceil().max(0.0) as u32;
    let centres = primary.per_pixel(|pixel, scratch| {
        let lit = primary.lit(pixel);
        lit.map_or_else(Moments::default, |lit| {
            primary.fluence(centre(lit), scratch)
        })
    });
    primary.per_pixel(|pixel, scratch| {
        let Some(lit) = primary.lit(pixel) else {
            return Moments::default();
        };
        let middle = centres[pixel];
        let bend = bend(&centres, pixel, detector.columns as usize);
        let within = |share: f64| {
            bend.is_some_and(|bend| {
                let limit = share * middle.mean_kev;
                bend.iter().all(|bend| bend.mean_kev.abs() <= limit)
            })
        };
        if let Some([x, y]) = bend.filter(|_| fine && within(EVEN) && primary.is_wholly_lit(pixel))
        {
            let mean = [middle, x.scaled(1.0 / 24.0), y.scaled(1.0 / 24.0)];
            return mean.into_iter().sum::<Moments>().scaled(area_cm2(lit));
        }
        // An edge may cut off a corner that five points miss.
        let sure_cuts = sure_cuts.max(u32::from(!within(EDGE)));
        let tolerance = Tolerance {
            energy_kev: TOLERANCE * middle.mean_kev * area_cm2(lit),
            cuts,
            sure_cuts,
        };
        primary.refined(lit, middle, tolerance, scratch)
    })
}

/// Largest second difference between neighbouring pixels for which the centre of a pixel stands for the whole, relative.
///
/// Where the image bends evenly the correction with it is exact; a kink in the centre of a pixel leaves an eighth.
const EVEN: f64 = 4e-3;

/// Second difference beyond which there may be an edge.
const EDGE: f64 = 2e-2;

/// A rectangle is cut as long as opposite quarters differ from its centre by more than this share of the pixel.
const TOLERANCE: f64 = 3e-3;

/// Points per side of a focal spot that is not a point, and of one whose blur is small.
const SPOT_RAYS: u32 = 4;
const SMALL_SPOT_RAYS: u32 = 2;

/// Largest width, in pixels, of an edge's half-shadow that is small: four points of the spot then put no more than about
/// 1 % of the edge's height into the wrong one of two pixels.
const SMALL_SPOT_PIXELS: f64 = 0.25;

/// When to cut a rectangle no further.
#[derive(Clone, Copy)]
struct Tolerance {
    energy_kev: f64,
    /// Cuts that are left.
    cuts: u32,
    /// Cuts that are made in any case: a square wider than a voxel may hide one.
    sure_cuts: u32,
}

/// Second differences along x and y; none at the rim.
fn bend(values: &[Moments], pixel: usize, columns: usize) -> Option<[Moments; 2]> {
    let column = pixel % columns;
    let along = |before: Option<usize>, after: usize| {
        let (a, b) = (values.get(before?)?, values.get(after)?);
        Some([*a, values[pixel].scaled(-2.0), *b].into_iter().sum())
    };
    if column == 0 || column + 1 == columns {
        return None;
    }
    Some([
        along(pixel.checked_sub(1), pixel + 1)?,
        along(pixel.checked_sub(columns), pixel + columns)?,
    ])
}

/// Points per side of the focal spot, by the half-shadow of what lies nearest to it.
fn spot_rays(transport: &Transport) -> u32 {
    let projection = transport.projection;
    let device_from_ct = projection.ct_from_device.inverse();
    let corners = transport.phantom.corners_ct().into_iter();
    let nearest_mm = corners
        .map(|corner| (device_from_ct * corner).z)
        .fold(f64::INFINITY, f64::min);
    let magnification = projection.source_detector_mm / nearest_mm.max(1.0);
    let half_shadow_mm = projection.source.focal_spot.size_mm * (magnification - 1.0);
    if half_shadow_mm <= SMALL_SPOT_PIXELS * projection.detector.pixel_mm {
        SMALL_SPOT_RAYS
    } else {
        SPOT_RAYS
    }
}

fn centre(field: Field) -> Point2<f64> {
    Point2::from([0, 1].map(|axis| 0.5 * (field.low_mm[axis] + field.high_mm[axis])))
}

fn area_cm2(field: Field) -> f64 {
    let [x, y] = field.size_mm();
    x * y / 100.0
}

fn quarters(field: Field) -> [Field; 4] {
    let middle = centre(field);
    std::array::from_fn(|quarter| {
        let mut part = field;
        for axis in 0..2 {
            if quarter >> axis & 1 == 0 {
                part.high_mm[axis] = middle[axis];
            } else {
                part.low_mm[axis] = middle[axis];
            }
        }
        part
    })
}

/// What the rays of the primary share.
struct Primary<'a> {
    transport: &'a Transport<'a>,
    paths: &'a Paths<'a>,
    spots: Vec<(Point3<f64>, f64)>,
    /// For each spectrum of the emitter.
    spectra: Vec<Lines<'a>>,
}

/// The energies that stand for a spectrum.
struct Lines<'a> {
    photons: &'a [f64],
    attenuation: Vec<Vec<[f32; LANES]>>,
    response: LineResponse<'a>,
}

/// Buffers of one thread.
struct Scratch {
    mass: Vec<[f32; LANES]>,
    photons: Vec<f64>,
}

impl<'a> Primary<'a> {
    fn new(
        transport: &'a Transport<'a>,
        paths: &'a Paths<'a>,
        quadratures: &'a [SpectralQuadrature],
    ) -> Self {
        Self {
            transport,
            paths,
            spots: transport.emitter.spot_points(spot_rays(transport)),
            spectra: quadratures
                .iter()
                .map(|quadrature| Lines {
                    photons: &quadrature.photons,
                    attenuation: quadrature
                        .energy_kev
                        .iter()
                        .map(|&energy_kev| paths.basis.at(energy_kev))
                        .collect(),
                    response: transport.response.at_lines(&quadrature.energy_kev),
                })
                .collect(),
        }
    }

    fn per_pixel(&self, of: impl Fn(usize, &mut Scratch) -> Moments + Sync) -> Vec<Moments> {
        let detector = self.transport.projection.detector;
        (0..detector.pixels())
            .into_par_iter()
            .with_min_len((detector.columns as usize).min(64))
            .map_init(
                || Scratch {
                    mass: vec![[0.0; LANES]; self.paths.basis.groups],
                    photons: Vec::new(),
                },
                |scratch, pixel| of(pixel, scratch),
            )
            .collect()
    }

    fn pixel(&self, pixel: usize) -> Field {
        let detector = self.transport.projection.detector;
        let centre = detector.pixel_centre_mm(pixel);
        Field::centred([centre.x, centre.y], [detector.pixel_mm; 2])
    }

    /// The part of a pixel that lies in the field: its edges are sharp.
    fn lit(&self, pixel: usize) -> Option<Field> {
        self.pixel(pixel).overlap(self.transport.emitter.field())
    }

    /// Whether a pixel and its neighbours lie in the field.
    fn is_wholly_lit(&self, pixel: usize) -> bool {
        let pixel = self.pixel(pixel);
        let field = self.transport.emitter.field();
        (0..2).all(|axis| {
            let side = pixel.size_mm()[axis];
            pixel.low_mm[axis] - side >= field.low_mm[axis]
                && pixel.high_mm[axis] + side <= field.high_mm[axis]
        })
    }

    /// Pixel side over the smallest side of a voxel: below a half neighbouring centres miss nothing.
    fn voxels_per_pixel(&self) -> f64 {
        let Transport {
            phantom,
            projection,
            ..
        } = self.transport;
        projection.detector.pixel_mm / phantom.grid().spacing_mm().min()
    }

    /// A rectangle by the midpoints of `samples_per_side`² parts.
    fn sampled(&self, lit: Field, samples_per_side: u32, scratch: &mut Scratch) -> Moments {
        let size = lit.size_mm();
        let along = |i: u32| (f64::from(i) + 0.5) / f64::from(samples_per_side);
        let rays = samples_per_side * samples_per_side;
        (0..rays)
            .map(|sample| {
                let (i, j) = (sample % samples_per_side, sample / samples_per_side);
                let at = Point2::new(
                    lit.low_mm[0] + along(i) * size[0],
                    lit.low_mm[1] + along(j) * size[1],
                );
                self.fluence(at, scratch)
            })
            .sum::<Moments>()
            .scaled(area_cm2(lit) / f64::from(rays))
    }

    /// A rectangle whose centre reads `middle`, cut into four until both pairs of opposite quarters agree with it: on a
    /// plane they do, at an edge or a kink at least one pair does not.
    fn refined(
        &self,
        lit: Field,
        middle: Moments,
        tolerance: Tolerance,
        scratch: &mut Scratch,
    ) -> Moments {
        let cm2 = area_cm2(lit);
        if tolerance.cuts == 0 {
            return middle.scaled(cm2);
        }
        let parts = quarters(lit);
        let middles = parts.map(|part| self.fluence(centre(part), scratch));
        let differs = |a: usize, b: usize| {
            let pair = 0.5 * (middles[a].mean_kev + middles[b].mean_kev);
            (pair - middle.mean_kev).abs() * cm2 > tolerance.energy_kev
        };
        if tolerance.sure_cuts == 0 && !differs(0, 3) && !differs(1, 2) {
            return middles.into_iter().sum::<Moments>().scaled(0.25 * cm2);
        }
        let tolerance = Tolerance {
            cuts: tolerance.cuts - 1,
            sure_cuts: tolerance.sure_cuts.saturating_sub(1),
            ..tolerance
        };
        parts
            .into_iter()
            .zip(middles)
            .map(|(part, middle)| self.refined(part, middle, tolerance, scratch))
            .sum()
    }

    /// Moments of the energy per cm² and history that arrives unscattered at a point and stays in the detector.
    fn fluence(&self, at: Point2<f64>, scratch: &mut Scratch) -> Moments {
        self.spots
            .iter()
            .map(|(spot, weight)| {
                let photons = weight * self.transport.emitter.open_fluence_cm2(spot, at);
                self.behind(spot, at, scratch).scaled(photons)
            })
            .sum()
    }

    /// Moments of the energy that one photon from `spot` to `at` leaves in the detector.
    fn behind(&self, spot: &Point3<f64>, at: Point2<f64>, scratch: &mut Scratch) -> Moments {
        let Scratch { mass, photons } = scratch;
        let target = Point3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        self.paths.between(spot, &target, mass);
        let direction: Unit<Vector3<f64>> = Unit::new_normalize(target - spot);
        self.transport
            .emitter
            .mixture(&direction)
            .parts()
            .map(|(spectrum, share)| {
                let lines = &self.spectra[spectrum];
                photons.clear();
                photons.extend(lines.photons.iter().zip(&lines.attenuation).map(
                    |(photons, attenuation)| {
                        let exponent = f64::from(super::attenuation_basis::dot(mass, attenuation));
                        share * photons * (-exponent).exp()
                    },
                ));
                lines.response.signal(photons, at.into(), &direction)
            })
            .sum()
    }
}
