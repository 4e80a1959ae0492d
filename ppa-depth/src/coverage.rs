//! Share of the surface near a joint that a camera sees, and its sampling density.

use std::cmp::Ordering;

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::camera::projection::Camera;
use crate::image::DepthImage;
use crate::render::body::PlacedBody;
use crate::render::ideal::render;
use crate::render::mesh_body::MeshBody;

/// Part of a surface to consider, and criteria for visibility.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoverageSettings {
    /// Largest distance of the middle of a triangle from the joint, mm.
    pub radius_mm: f64,
    /// Largest angle of incidence, degrees.
    pub max_angle_deg: f64,
}

impl Default for CoverageSettings {
    /// Within 100 mm, about the length of the paper's region of interest; up to 70 degrees, where a pixel sees three times the
    /// surface that it sees at normal incidence. Both are our choices.
    fn default() -> Self {
        Self {
            radius_mm: 100.0,
            max_angle_deg: 70.0,
        }
    }
}

/// Reason why there is no coverage.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoverageError {
    /// The radius is zero, negative or not finite.
    #[error("radius around the joint is {0} mm, expected a positive number")]
    Radius(f64),
    /// The angle is not an angle of incidence.
    #[error("largest angle of incidence is {0} degrees, expected more than 0 and less than 90")]
    Angle(f64),
    /// The mesh has no triangle near the joint.
    #[error("no surface within {radius_mm} mm of the joint at ({}, {}, {}) mm", joint[0], joint[1], joint[2])]
    NoSurface {
        /// The radius.
        radius_mm: f64,
        /// The joint in the frame of the mesh.
        joint: [f64; 3],
    },
}

/// A triangle in the frame of the mesh.
#[derive(Debug, Clone, Copy)]
struct Facet {
    middle: Point3<f64>,
    normal: Vector3<f64>,
    area_mm2: f64,
}

/// The part of a mesh near a joint.
#[derive(Debug, Clone)]
pub struct JointSurface {
    facets: Vec<Facet>,
    area_mm2: f64,
    least_cos: f64,
}

/// Part of a [`JointSurface`] that a camera sees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coverage {
    /// Area that is in the image, not hidden, and not too oblique, mm².
    pub visible_mm2: f64,
    /// Visible share of the total area.
    pub visible_share: f64,
    /// Pixels on the visible area.
    pub pixels: f64,
    /// Pixels per cm² of visible area; 0 if nothing is visible.
    pub pixels_per_cm2: f64,
    /// Side of the square of surface that a pixel sees on average, mm; `None` if nothing is visible.
    pub mm_per_pixel: Option<f64>,
}

/// A surface is not hidden by one less than this in front of it, mm: the depth of a pixel is that of its centre.
const HIDDEN_MM: f64 = 3.0;

impl JointSurface {
    /// The surface of `mesh` near `joint`, both in the frame of the mesh. The orientation of the triangles does not matter.
    ///
    /// # Errors
    /// [`CoverageError`] for a setting out of range or if there is no surface near the joint.
    pub fn new(
        mesh: &MeshBody,
        joint: &Point3<f64>,
        settings: &CoverageSettings,
    ) -> Result<Self, CoverageError> {
        let CoverageSettings {
            radius_mm,
            max_angle_deg,
        } = *settings;
        if !(radius_mm > 0.0 && radius_mm.is_finite()) {
            return Err(CoverageError::Radius(radius_mm));
        }
        if !(max_angle_deg > 0.0 && max_angle_deg < 90.0) {
            return Err(CoverageError::Angle(max_angle_deg));
        }
        let facet = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize].cast::<f64>());
            let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
            let (normal, twice) =
                nalgebra::Unit::try_new_and_get((b - a).cross(&(c - a)), f64::MIN_POSITIVE)?;
            let near = (middle - joint).norm() <= radius_mm;
            near.then(|| Facet {
                middle,
                normal: normal.into_inner(),
                area_mm2: twice / 2.0,
            })
        };
        let facets: Vec<Facet> = mesh.triangles.iter().filter_map(facet).collect();
        let area_mm2: f64 = facets.iter().map(|facet| facet.area_mm2).sum();
        if area_mm2 == 0.0 {
            return Err(CoverageError::NoSurface {
                radius_mm,
                joint: (*joint).into(),
            });
        }
        Ok(Self {
            facets,
            area_mm2,
            least_cos: max_angle_deg.to_radians().cos(),
        })
    }

    /// Total area, mm².
    pub fn area_mm2(&self) -> f64 {
        self.area_mm2
    }

    /// Part of the surface that `camera` sees in a scene whose bodies include the surface's own mesh. A camera inside one of them sees
    /// nothing.
    pub fn seen(
        &self,
        camera: &Camera,
        camera_from_mesh: &Isometry3<f64>,
        scene: &[PlacedBody],
    ) -> Coverage {
        let inside = |body: &PlacedBody| body.require_camera_outside().is_err();
        if scene.iter().any(inside) {
            return self.coverage(0.0, 0.0);
        }
        let image = render(camera, scene);
        let seen: Vec<_> = self
            .facets
            .par_iter()
            .filter_map(|facet| {
                let pixels_per_mm2 = self.resolution(facet, camera, camera_from_mesh, &image)?;
                Some([facet.area_mm2, facet.area_mm2 * pixels_per_mm2])
            })
            .collect();
        let [visible_mm2, pixels] =
            (seen.iter()).fold([0.0, 0.0], |[a, p], [area, pixels]| [a + area, p + pixels]);
        self.coverage(visible_mm2, pixels)
    }

    /// Pixels per mm² of a facet, if it is seen.
    fn resolution(
        &self,
        facet: &Facet,
        camera: &Camera,
        camera_from_mesh: &Isometry3<f64>,
        image: &DepthImage,
    ) -> Option<f64> {
        let (middle, normal) = (
            camera_from_mesh * facet.middle,
            camera_from_mesh * facet.normal,
        );
        let range_mm = middle.coords.norm();
        let along = normal.dot(&middle.coords);
        let cos = along.abs() / range_mm;
        if cos < self.least_cos {
            return None;
        }
        let (pixel, pixel_from_ray) = camera.project_with_jacobian(&middle)?;
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let on_image = |at: f64, count: u32| 0.0 <= at && at < f64::from(count);
        if !(on_image(u, image.width) && on_image(v, image.height)) {
            return None;
        }
        let index = v as usize * image.width as usize + u as usize;
        let ray = camera.rays()[index]?;
        // Where the ray of the pixel meets the plane of the facet, and what the pixel sees.
        let expected_mm = along / normal.dot(&Vector3::new(ray.x, ray.y, 1.0));
        let found_mm = f64::from(image.z_mm[index]);
        if found_mm > 0.0 && found_mm < expected_mm - HIDDEN_MM {
            return None;
        }
        // An area dA fills the solid angle dA cos θ / r² and, with ρ = r / z, the area ρ³ dΩ of (X/Z, Y/Z).
        let stretch = (range_mm / middle.z).powi(3) / (range_mm * range_mm);
        Some(pixel_from_ray.determinant().abs() * stretch * cos)
    }

    fn coverage(&self, visible_mm2: f64, pixels: f64) -> Coverage {
        let visible = visible_mm2 > 0.0;
        Coverage {
            visible_mm2,
            visible_share: visible_mm2 / self.area_mm2,
            pixels,
            pixels_per_cm2: if visible {
                100.0 * pixels / visible_mm2
            } else {
                0.0
            },
            mm_per_pixel: visible.then(|| (visible_mm2 / pixels).sqrt()),
        }
    }
}

impl Coverage {
    /// Orders the best first: by visible share in whole percent, then by pixels per cm².
    pub fn best_first(&self, other: &Self) -> Ordering {
        let percent = |coverage: &Self| (100.0 * coverage.visible_share).round();
        let finer = || other.pixels_per_cm2.total_cmp(&self.pixels_per_cm2);
        percent(other).total_cmp(&percent(self)).then_with(finer)
    }
}
