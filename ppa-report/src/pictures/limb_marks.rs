//! Axis, joint, regions and plane of a limb, drawn over a view of it in the ct frame.

use nalgebra::{Point3, Vector3};
use ppa_scene::{AxisRegion, Landmarks, Plane};

use super::canvas::{Canvas, Colour, mixed, text_width};
use super::palette::{AXIS, CALF_REGION, INK, JOINT, JOINT_REGION, PLANE, SEVERE};
use super::view::View;

/// Half the length of drawn lines, mm: beyond any panel.
const FAR_MM: f64 = 5000.0;

/// Sine of the largest angle between line of sight and plane at which the plane is drawn as a line.
const EDGE_ON: f64 = 0.35;

/// Cosine above which the view counts as along the axis.
const ALONG: f64 = 0.8;

/// Landmarks for drawing.
pub(super) struct LimbMarks<'a> {
    landmarks: &'a Landmarks,
    joint: Point3<f64>,
    scan_direction: Vector3<f64>,
    plane: Plane,
    /// Places of findings, numbered from 1.
    findings: Vec<Point3<f64>>,
}

impl<'a> LimbMarks<'a> {
    pub(super) fn new(landmarks: &'a Landmarks, findings: Vec<Point3<f64>>) -> Self {
        let ct_from_patient = landmarks.patient_from_ct().inverse();
        Self {
            landmarks,
            joint: landmarks.joint_centre.into(),
            scan_direction: landmarks.scan_direction.into(),
            plane: landmarks
                .plane_patient()
                .transformed(ct_from_patient.isometry()),
            findings,
        }
    }

    /// The joint, ct frame.
    pub(super) fn joint(&self) -> Point3<f64> {
        self.joint
    }

    /// A colour tinted if a point lies between the levels of an axis region.
    pub(super) fn tinted(&self, colour: Colour, point: &Point3<f64>) -> Colour {
        let level = self.scan_direction.dot(&(point - self.joint));
        let is_in = |region: &AxisRegion| {
            let [from, to] = region.range_mm;
            (from..=to).contains(&level)
        };
        if is_in(&self.landmarks.joint_region) {
            mixed(colour, JOINT_REGION, 0.5)
        } else if is_in(&self.landmarks.calf_region) {
            mixed(colour, CALF_REGION, 0.5)
        } else {
            colour
        }
    }

    /// Draws the supporting plane in the view's plane through the joint, if it is seen nearly edge-on.
    pub(super) fn draw_plane(&self, canvas: &mut Canvas, view: &View) {
        let (viewer, normal) = (view.towards_viewer(), self.plane.normal.into_inner());
        if viewer.dot(&normal).abs() > EDGE_ON {
            return;
        }
        let along = viewer.cross(&normal).normalize();
        // The point of the plane straight below the joint in the picture.
        let across = normal - viewer * viewer.dot(&normal);
        let below = self.plane.signed_distance(&self.joint) / across.norm_squared();
        let at = self.joint - across * below;
        let ends = [-FAR_MM, FAR_MM].map(|far| view.pixel(&(at + along * far)));
        canvas.line(ends[0], ends[1], 2.0, PLANE);
    }

    /// Draws the axis through everything, except in a view along it, since the joint then marks it.
    pub(super) fn draw_axis(&self, canvas: &mut Canvas, view: &View) {
        let at = Point3::from(self.landmarks.axis_point);
        let along = Vector3::from(self.landmarks.axis_direction);
        if view.towards_viewer().dot(&along).abs() > ALONG {
            return;
        }
        let ends = [-FAR_MM, FAR_MM].map(|far| view.pixel(&(at + along * far)));
        canvas.line(ends[0], ends[1], 2.0, AXIS);
    }

    /// Draws the joint, on top of everything.
    pub(super) fn draw_joint(&self, canvas: &mut Canvas, view: &View) {
        let at = view.pixel(&self.joint);
        canvas.ring(at, 6.0, 10.0, [0; 3]);
        canvas.ring(at, 7.0, 9.0, INK);
        canvas.ring(at, 0.0, 3.5, JOINT);
    }

    /// Draws the three points of the plane: discs if visible, rings if `hides` returns that something is in front of them.
    pub(super) fn draw_plane_points(
        &self,
        canvas: &mut Canvas,
        view: &View,
        hides: impl Fn(&Point3<f64>) -> bool,
    ) {
        for point in self.landmarks.plane_points.map(Point3::from) {
            let at = view.pixel(&point);
            let inner = if hides(&point) { 4.0 } else { 0.0 };
            canvas.ring(at, inner, 7.0, [0; 3]);
            canvas.ring(at, if inner > 0.0 { 4.5 } else { 0.0 }, 6.0, PLANE);
        }
    }

    /// Writes the numbers of the findings at their places.
    pub(super) fn draw_findings(&self, canvas: &mut Canvas, view: &View) {
        for (point, number) in self.findings.iter().zip(1..) {
            let [x, y] = view.pixel(point);
            // Outside the picture, or not finite.
            if ![x, y].iter().all(|pixel| (0.0..1e4).contains(pixel)) {
                continue;
            }
            canvas.ring([x, y], 0.0, 13.0, [0; 3]);
            canvas.ring([x, y], 10.5, 12.5, SEVERE);
            let text = format!("{number}");
            let half = 0.5 * f64::from(text_width(&text, 2));
            let corner = [x - half, y - 8.0].map(|pixel| pixel.max(0.0) as u32);
            canvas.text(&text, corner, 2, INK);
        }
    }
}
