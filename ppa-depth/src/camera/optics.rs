//! A camera's lens as the rasteriser needs it: rays, and curvature of straight edges in the image.

use nalgebra::{Matrix2, Vector2};

use crate::camera::distortion::Distortion;
use crate::camera::spec::CameraSpec;

/// Derived once per camera.
#[derive(Debug)]
pub(crate) struct Optics {
    /// (X/Z, Y/Z) of every pixel centre, row-major.
    pub rays: Vec<Option<Vector2<f64>>>,
    /// Smallest and largest X/Z and Y/Z of all rays; empty (∞, −∞) if there is none.
    pub bounds: [Vector2<f64>; 2],
    /// Radius of the disc of directions on which `bow` holds; reaches beyond all rays.
    pub radius: f64,
    /// An edge between two points of the disc that are d pixels apart stays within `bow`·d² pixels of their chord.
    pub bow: f64,
    /// Most pixels per unit of X/Z or Y/Z on the disc.
    pub stretch: f64,
}

/// How far beyond the rays triangles are projected rather than tested against all pixels.
const BEYOND: f64 = 1.2;
/// Least radius of the disc, for cameras of a few pixels.
const LEAST_RADIUS: f64 = 0.05;
/// Radii and directions at which the derivatives of the lens are sampled.
const SAMPLES: (usize, usize) = (64, 24);
/// Safety factor for places between the samples.
const SAFETY: f64 = 2.0;

impl Optics {
    pub(crate) fn new(
        spec: &CameraSpec,
        lens: &Distortion,
        rays: Vec<Option<Vector2<f64>>>,
    ) -> Self {
        let mut bounds = [
            Vector2::repeat(f64::INFINITY),
            Vector2::repeat(f64::NEG_INFINITY),
        ];
        let mut reach = 0.0_f64;
        for ray in rays.iter().flatten() {
            bounds = [bounds[0].inf(ray), bounds[1].sup(ray)];
            reach = reach.max(ray.norm());
        }
        // At the fold the inverse has no finite slope, and near it edges bow without bound.
        let radius = (BEYOND * reach + LEAST_RADIUS).min(0.5 * (reach + lens.fold()));
        let (bow, stretch) = bow_and_stretch(spec, lens, radius);
        // A pole: no triangle is projected, each is tested against all pixels.
        let (radius, bow, stretch) = if bow.is_finite() {
            (radius, bow, stretch)
        } else {
            (0.0, 0.0, 0.0)
        };
        Self {
            rays,
            bounds,
            radius,
            bow,
            stretch,
        }
    }
}

/// With |second derivative| ≤ H and a smallest singular value σ of the first, both in pixels, an edge of length L in
/// directions bows by at most H L²/8, and L is at most d/σ.
fn bow_and_stretch(spec: &CameraSpec, lens: &Distortion, radius: f64) -> (f64, f64) {
    let focal = Matrix2::new(spec.fx, 0.0, 0.0, spec.fy);
    let (radii, directions) = SAMPLES;
    let step = radius / radii as f64;
    let (mut bend, mut least, mut most) = (0.0_f64, f64::INFINITY, 0.0_f64);
    for i in 0..radii {
        for j in 0..directions {
            let turn = std::f64::consts::TAU * j as f64 / directions as f64;
            let direction = Vector2::new(turn.cos(), turn.sin());
            let at = |r: f64| {
                lens.distort(&(direction * r))
                    .map(|(_, slope)| focal * slope)
            };
            let (near, far) = (at(step * i as f64), at(step * (i + 1) as f64));
            let (Some(near), Some(far)) = (near, far) else {
                return (f64::INFINITY, f64::INFINITY);
            };
            bend = bend.max((far - near).norm() / step);
            let sizes = far.singular_values();
            (least, most) = (least.min(sizes.min()), most.max(sizes.max()));
        }
    }
    (SAFETY * bend / (8.0 * least * least), SAFETY * most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, CameraModel, DepthMode};

    /// A barrel whose fold lies just outside the corners of the image: r (1 − 0.2 r²) grows up to r = 1.29, the corners lie at 1.02.
    #[test]
    fn near_a_fold_triangles_still_have_narrow_outlines() {
        let barrel = CameraSpec {
            model: CameraModel::BrownConrady,
            width: 640,
            height: 480,
            fx: 500.0,
            fy: 500.0,
            cx: 319.5,
            cy: 239.5,
            k1: -0.2,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
            k5: 0.0,
            k6: 0.0,
            p1: 0.0,
            p2: 0.0,
            metric_radius: None,
            mask: None,
        };
        let camera = Camera::try_from(barrel).unwrap();
        let optics = camera.optics();
        assert!(optics.radius > optics.bounds[1].norm() && optics.radius < 1.29);
        assert!(optics.bow < 0.1, "{}", optics.bow);
    }

    /// The metric radius limits the rays, not the triangles that are projected.
    #[test]
    fn corners_beyond_the_metric_radius_are_projected() {
        let wide = CameraSpec::azure_kinect(DepthMode::WfovBinned);
        let camera = Camera::try_from(wide.clone()).unwrap();
        let optics = camera.optics();
        assert!(optics.radius > 1.1 * wide.metric_radius.unwrap());
        assert!(optics.bow < 0.1, "{}", optics.bow);
    }
}
