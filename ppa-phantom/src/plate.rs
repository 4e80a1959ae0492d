//! A fracture plate with its screws.

use nalgebra::Point3;

use super::bounds::Bounds;
use super::envelope::Bounded;
use super::hindfoot::Mortise;
use super::sdf::Shape;

/// Size of a common small-fragment plate: thickness, half its width, half its length.
const THICKNESS_MM: f64 = 2.5;
const HALF_WIDTH_MM: f64 = 5.0;
const HALF_LENGTH_MM: f64 = 32.0;
/// Heights of the screws above the middle of the plate, and their radius.
const SCREWS_MM: [f64; 5] = [-26.0, -13.0, 0.0, 13.0, 26.0];
const SCREW_RADIUS_MM: f64 = 1.75;
const HEAD_RADIUS_MM: f64 = 3.0;
/// Thickness of the tissue film between plate and bone.
const FILM_MM: f64 = 0.2;
/// Thickness of the soft tissue that covers the plate.
const COVER_MM: f64 = 4.0;

/// A plate bent to the outer face of a bone, and screws through it; limb frame.
#[derive(Debug, Clone)]
pub(super) struct Plate {
    /// The bone to which the plate is bent.
    bone: Shape,
    /// The part of the bone's surface that the plate covers.
    window: Shape,
    screws: Shape,
    bulge: Shape,
    bounds: Bounds,
}

impl Plate {
    /// A plate on the lateral face of the fibula, its lower end 2 cm above the joint; `size` is that of the leg.
    pub(super) fn on_fibula(fibula: &Shape, mortise: &Mortise, size: f64) -> Self {
        let bone = fibula.clone();
        let posterior = 3.5 * size;
        let at = |medial, proximal| mortise.point(medial, posterior, proximal);
        // The outer and the inner face of the bone at a height, on a line from lateral.
        let faces = |proximal: f64| {
            let inside = |medial: &f64| bone.distance(&at(*medial, proximal).into()) < 0.0;
            let line = || (-600..0).map(|n| 0.1 * f64::from(n));
            let outer = line().find(inside).unwrap_or(-30.0 * size);
            let inner = line().rfind(inside).unwrap_or(-15.0 * size);
            [outer, inner]
        };
        let middle = 20.0 * size + HALF_LENGTH_MM;
        let mut screws = Vec::new();
        for height in SCREWS_MM {
            let proximal = middle + height;
            let [outer, inner] = faces(proximal);
            // The screw ends in the far cortex.
            let tip = at(inner - 2.0 - SCREW_RADIUS_MM, proximal);
            let head = at(outer - FILM_MM - 0.5 * THICKNESS_MM, proximal);
            screws.push(Shape::round_cone(
                head,
                SCREW_RADIUS_MM,
                tip,
                SCREW_RADIUS_MM,
            ));
            screws.push(Shape::ellipsoid(head, [HEAD_RADIUS_MM; 3]));
        }
        let [outer, _] = faces(middle);
        let axes = mortise.limb_from_mortise.rotation.to_rotation_matrix();
        let half = [12.0, HALF_WIDTH_MM, HALF_LENGTH_MM];
        let window = Shape::block(at(outer - 8.0, middle), half, 1.0, axes);
        let screws = Shape::union(0.5, screws);
        let end = |sign: f64| {
            let proximal = middle + sign * (HALF_LENGTH_MM - 6.0);
            at(faces(proximal)[0] + HALF_WIDTH_MM - THICKNESS_MM, proximal)
        };
        let radius = HALF_WIDTH_MM + COVER_MM;
        let bulge = Shape::round_cone(end(-1.0), radius, end(1.0), radius);
        let bounds = window.bounds().join(&screws.bounds());
        Self {
            bone,
            window,
            screws,
            bulge,
            bounds,
        }
    }

    /// The skin over the plate, and the width of its blend.
    pub(super) fn bulge(&self) -> (Bounded, f64) {
        (Bounded::new(self.bulge.clone()), 10.0)
    }

    /// Signed distance to the metal, mm; a lower bound far away.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        let far = self.bounds.distance(p);
        if far > 5.0 {
            return far;
        }
        let from_bone = self.bone.distance(p);
        let sheet = (FILM_MM - from_bone).max(from_bone - FILM_MM - THICKNESS_MM);
        sheet
            .max(self.window.distance(p))
            .min(self.screws.distance(p))
    }
}
