//! Finding the table top in a cloud of a room.

use nalgebra::{Point3, Unit, Vector3};
use ppa_core::random::split_mix;
use ppa_mesh::PointCloud;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::room::patch::{Patch, Sheet};
use crate::room::plane::{Plane, on_one_line};
use crate::room::plane_settings::{PlaneError, PlaneSettings};

/// The table top found in a cloud.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TablePlane {
    /// Π_T, facing up.
    pub plane: Plane,
    /// Points of the patch within the threshold.
    pub inliers: usize,
    /// Root mean square distance from the plane, mm, of the points it was fitted to: the inliers within three standard
    /// deviations, without points of a wall or a cushion.
    pub rms_mm: f64,
    /// Mean of the points it was fitted to, on the plane.
    pub centre: Point3<f64>,
}

/// Number of points scored per search; more would not improve the choice, since least squares refines it.
const SCORED_POINTS: usize = 8_000;

/// Number of planes removed from a cloud, largest first, before the search stops.
const MAX_PLANES: usize = 10;

const MIN_POINTS: usize = 30;

/// Finds the table top: planes by RANSAC, each refined by total least squares on one connected
/// patch until its points no longer change, then the patch the beam hits first (or the largest).
///
/// Only the connected patch counts, so that a wall or a cabinet cut by the plane does not tilt
/// it. The floor is often larger than the table; the beam distinguishes them. The result depends
/// on the cloud, the settings and the seed only, not on the number of threads.
///
/// # Errors
/// [`PlaneError`] when a setting is unusable, there are too few points, or no plane qualifies.
pub fn table_plane(
    cloud: &PointCloud,
    settings: &PlaneSettings,
    seed: u64,
) -> Result<TablePlane, PlaneError> {
    let search = Search::new(settings)?;
    let mut points: Vec<Point3<f64>> = cloud
        .points
        .iter()
        .map(|p| p.cast::<f64>())
        .filter(|p| search.wants(p))
        .collect();
    let found = points.len();
    if found < MIN_POINTS {
        return Err(PlaneError::TooFewPoints {
            found,
            expected: MIN_POINTS,
        });
    }
    if on_one_line(points.iter().copied()) {
        return Err(PlaneError::OneLine { found });
    }
    let mut best: Option<(f64, Sheet)> = None;
    for round in 0..MAX_PLANES {
        let Some(plane) = search.consensus(&points, seed, round as u64) else {
            break;
        };
        for patch in Patch::of_plane(&points, &plane, settings) {
            let Some(sheet) = patch.refined(settings) else {
                continue;
            };
            if let Some(merit) = search.merit(&sheet)
                && best.as_ref().is_none_or(|(most, _)| *most < merit)
            {
                best = Some((merit, sheet));
            }
        }
        points.retain(|p| plane.signed_distance(p).abs() > 2.0 * settings.threshold_mm);
        if points.len() < MIN_POINTS {
            break;
        }
    }
    let (_, sheet) = best.ok_or(PlaneError::NoPlane {
        points: found,
        min_area_mm2: settings.min_area_mm2,
        max_tilt_deg: settings.max_tilt_deg,
        beam: settings.beam.is_some(),
    })?;
    Ok(TablePlane {
        plane: sheet.plane,
        inliers: sheet.inliers,
        rms_mm: sheet.rms_mm,
        centre: sheet.centre,
    })
}

/// Checked settings.
struct Search<'a> {
    settings: &'a PlaneSettings,
    up: Unit<Vector3<f64>>,
    beam: Option<(Point3<f64>, Unit<Vector3<f64>>)>,
    min_cos: f64,
}

impl<'a> Search<'a> {
    fn new(settings: &'a PlaneSettings) -> Result<Self, PlaneError> {
        settings.check()?;
        let unit = |name, v: [f64; 3]| {
            Unit::try_new(Vector3::from(v), 1e-9).ok_or(PlaneError::Setting {
                name,
                found: Vector3::from(v).norm(),
                expected: "a direction of length above 0",
            })
        };
        let beam = settings
            .beam
            .map(|[from, along]| Ok((Point3::from(from), unit("beam", along)?)))
            .transpose()?;
        Ok(Self {
            settings,
            up: unit("up", settings.up)?,
            beam,
            min_cos: settings.max_tilt_deg.to_radians().cos(),
        })
    }

    fn wants(&self, p: &Point3<f64>) -> bool {
        p.iter().all(|c| c.is_finite())
            && self.settings.region.is_none_or(|[low, high]| {
                (0..3).all(|axis| (low[axis]..=high[axis]).contains(&p[axis]))
            })
    }

    /// The level plane with the most points within the threshold, among many planes through three points.
    fn consensus(&self, points: &[Point3<f64>], seed: u64, round: u64) -> Option<Plane> {
        let near_beam = self.beam.map(|(from, along)| {
            let reach = 2.0 * self.settings.min_area_mm2.sqrt();
            points
                .iter()
                .filter(|p| {
                    let v = *p - from;
                    let s = v.dot(&along);
                    s > self.settings.min_beam_mm && (v - along.into_inner() * s).norm() < reach
                })
                .copied()
                .collect::<Vec<_>>()
        });
        let pool = near_beam.as_deref().unwrap_or(points);
        if pool.len() < MIN_POINTS {
            return None;
        }
        let stride = pool.len().div_ceil(SCORED_POINTS);
        let scored: Vec<Point3<f64>> = pool.iter().step_by(stride).copied().collect();
        let best = (0..u64::from(self.settings.iterations))
            .into_par_iter()
            .filter_map(|iteration| {
                let plane = self.candidate(pool, seed, round << 32 | iteration)?;
                let threshold = self.settings.threshold_mm;
                let votes = scored
                    .iter()
                    .filter(|p| plane.signed_distance(p).abs() <= threshold)
                    .count();
                Some((votes, std::cmp::Reverse(iteration), plane))
            })
            .max_by_key(|(votes, iteration, _)| (*votes, *iteration))?;
        Some(best.2)
    }

    fn candidate(&self, pool: &[Point3<f64>], seed: u64, index: u64) -> Option<Plane> {
        let pick = |corner: u64| {
            let random = split_mix(split_mix(seed) ^ split_mix(4 * index + corner));
            // The high product maps 64 random bits evenly onto the points.
            pool[((u128::from(random) * pool.len() as u128) >> 64) as usize]
        };
        let [a, b, c] = [0, 1, 2].map(pick);
        let normal = Unit::try_new((b - a).cross(&(c - a)), 1e-6)?;
        let cos = normal.dot(&self.up);
        let normal = if cos < 0.0 { -normal } else { normal };
        (cos.abs() >= self.min_cos).then(|| Plane::through(&a, normal))
    }

    /// How well a sheet fits as the table; `None` if it does not.
    fn merit(&self, sheet: &Sheet) -> Option<f64> {
        if sheet.plane.normal.dot(&self.up).abs() < self.min_cos {
            return None;
        }
        match self.beam {
            None => Some(sheet.inliers as f64),
            Some((from, along)) => {
                let hit = sheet.plane.hit(&from, &along)?;
                let distance_mm = (hit - from).norm();
                let is_table = distance_mm >= self.settings.min_beam_mm && sheet.covers(&hit);
                is_table.then_some(-distance_mm)
            }
        }
    }
}
