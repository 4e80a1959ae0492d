//! Recorded surfaces: points with normals, drawn as discs.

use nalgebra::{Point3, Vector3};

use crate::render::body_error::{BodyError, MAX_COORDINATE_MM, check_count, check_points};
use crate::render::nearest::{Index, Ray};

/// A cloud of equal discs, one around each point and perpendicular to its normal, in its own frame, mm.
///
/// A surface sampled at distance g shows no holes once the radius reaches g/√2 for a square grid, and about 1.5 g for
/// scattered points whose mean distance is g. Larger discs are safe on flat parts, but stick out at convex edges.
#[derive(Debug, Clone)]
pub struct SurfelBody {
    discs: Vec<Disc>,
    radius_mm: f64,
    index: Index,
}

#[derive(Debug, Clone, Copy)]
struct Disc {
    centre: Point3<f32>,
    normal: Vector3<f32>,
}

impl SurfelBody {
    /// Copies and indexes the discs. Normals need not have unit length; their sign does not matter.
    ///
    /// # Errors
    /// [`BodyError`] for no point, differing numbers of points and normals, a coordinate that is not finite, a normal
    /// without direction, or a radius that is not positive.
    pub fn new(
        points: &[Point3<f32>],
        normals: &[Vector3<f32>],
        radius_mm: f64,
    ) -> Result<Self, BodyError> {
        check_count(points.len(), "point")?;
        check_points(points)?;
        if points.len() != normals.len() {
            return Err(BodyError::NormalCount {
                points: points.len(),
                normals: normals.len(),
            });
        }
        if !(radius_mm > 0.0 && radius_mm <= f64::from(MAX_COORDINATE_MM)) {
            return Err(BodyError::Radius(radius_mm));
        }
        let discs = points
            .iter()
            .zip(normals)
            .enumerate()
            .map(|(index, (&centre, normal))| {
                // In f64: a tiny f32 normal would underflow when squared.
                match normal.cast::<f64>().try_normalize(0.0) {
                    Some(unit) if unit.iter().all(|n| n.is_finite()) => Ok(Disc {
                        centre,
                        normal: unit.cast(),
                    }),
                    _ => Err(BodyError::Normal {
                        index,
                        found: (*normal).into(),
                    }),
                }
            })
            .collect::<Result<Vec<_>, _>>()?;
        let index = Index::new(discs.iter().map(|disc| {
            // A disc of radius r with unit normal n reaches r √(1 − nᵢ²) along axis i.
            let reach = disc
                .normal
                .map(|n| radius_mm as f32 * (1.0 - n * n).max(0.0).sqrt());
            [disc.centre - reach, disc.centre + reach]
        }));
        Ok(Self {
            discs,
            radius_mm,
            index,
        })
    }

    pub(crate) fn nearest(&self, ray: &Ray, limit: f64) -> Option<f64> {
        let radius_squared = self.radius_mm * self.radius_mm;
        self.index.nearest(ray, limit, |disc| {
            let Disc { centre, normal } = self.discs[disc as usize];
            let (to_centre, normal) = (centre.cast::<f64>() - ray.origin, normal.cast::<f64>());
            let t = normal.dot(&to_centre) / normal.dot(&ray.direction);
            // Edge-on gives an infinite or undefined t, which fails here.
            (t > 0.0 && (ray.direction * t - to_centre).norm_squared() <= radius_squared)
                .then_some(t)
        })
    }
}
