//! Surroundings of a placed limb as points and lines in the room: device, detector, cameras, contacts.

use nalgebra::{Matrix3, Point2, Point3, Vector3};
use ppa_depth::{Camera, MountedCamera, RigError, RigSpec};
use ppa_generate::PreparedLimb;
use ppa_generate::Table;
use ppa_mesh::Mesh;
use ppa_scene::{Landmarks, Placement};
use ppa_xray::Detector;

use super::cut_faces::cut_faces;

/// A camera and the part of the table that it sees.
pub(super) struct ViewCone {
    pub(super) name: &'static str,
    pub(super) eye: Point3<f64>,
    /// Where the rays of the image's corners meet the table, or end in the air.
    pub(super) corners: [Point3<f64>; 4],
}

/// A placed limb with its surroundings; room frame, mm.
pub(super) struct PoseScene<'a> {
    pub(super) table: &'a Table,
    /// Across the table, towards the head, up.
    pub(super) axes: Matrix3<f64>,
    pub(super) skin: Mesh,
    /// Faces where the field of view cuts the limb.
    pub(super) cuts: Mesh,
    pub(super) joint: Point3<f64>,
    /// Two points of the limb's axis, far apart.
    pub(super) axis: [Point3<f64>; 2],
    pub(super) source: Point3<f64>,
    /// Where the central beam meets the detector.
    pub(super) beam_end: Point3<f64>,
    pub(super) detector: [Point3<f64>; 4],
    pub(super) cones: [ViewCone; 2],
    /// The lowest distal and the lowest proximal point.
    pub(super) contacts: Vec<Point3<f64>>,
}

/// Length of rays that do not meet the table, mm.
const IN_THE_AIR_MM: f64 = 1500.0;

/// Length to which the limb's axis is drawn on either side of the joint, mm.
const AXIS_MM: f64 = 350.0;

impl<'a> PoseScene<'a> {
    pub(super) fn new(
        limb: &PreparedLimb,
        placement: &Placement,
        table: &'a Table,
        rig: &RigSpec,
        detector: &Detector,
    ) -> Result<Self, RigError> {
        let (skin_ct, landmarks) = (&limb.limb.mesh, &limb.landmarks);
        let device = &table.room.device;
        let up = table.plane.plane.normal.into_inner();
        let head = device.head_direction();
        let head = (head - up * up.dot(&head)).normalize();
        let axes = Matrix3::from_columns(&[head.cross(&up), head, up]);
        let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
        let mut skin = skin_ct.transformed(room_from_ct.isometry());
        if placement.flattening.is_some() {
            skin.vertices = placement.in_room(&skin_ct.vertices, landmarks);
            skin.normals = skin.geometric_normals();
        }
        let cuts = cut_faces(&limb.limb, limb.volume.grid());
        let cuts = cuts.transformed(room_from_ct.isometry());
        let along = room_from_ct.rotate(&Vector3::from(landmarks.axis_direction));
        let joint = room_from_ct * Point3::from(landmarks.joint_centre);
        let in_room = |x: f64, y: f64, z: f64| device.room_from_device * Point3::new(x, y, z);
        let distance = device.source_detector_mm;
        let [half_x, half_y] = [detector.columns, detector.rows]
            .map(|pixels| 0.5 * f64::from(pixels) * detector.pixel_mm);
        let [centre_x, centre_y] = detector.centre_mm;
        let corner =
            |[x, y]: [f64; 2]| in_room(centre_x + x * half_x, centre_y + y * half_y, distance);
        let cone = |name: &'static str, mounted: &MountedCamera| {
            let pose = mounted
                .pose()
                .map_err(|source| RigError::Pose { side: name, source })?;
            let camera = Camera::try_from(mounted.camera.clone())
                .map_err(|source| RigError::Camera { side: name, source })?;
            let room_from_camera = device.room_from_device.isometry() * pose;
            let eye = room_from_camera * Point3::origin();
            let corners = corner_rays(&camera).map(|ray| {
                let direction = room_from_camera * ray;
                let met = table.plane.plane.hit(&eye, &direction);
                let near = met.filter(|point| (point - eye).norm() < 3.0 * IN_THE_AIR_MM);
                near.unwrap_or(eye + direction.normalize() * IN_THE_AIR_MM)
            });
            Ok::<_, RigError>(ViewCone { name, eye, corners })
        };
        Ok(Self {
            table,
            axes,
            joint,
            axis: [joint - along * AXIS_MM, joint + along * AXIS_MM],
            source: device.source(),
            beam_end: in_room(0.0, 0.0, distance),
            detector: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner),
            cones: [cone("left", &rig.left)?, cone("right", &rig.right)?],
            contacts: contacts(&skin, skin_ct, landmarks, placement, table, &head),
            skin,
            cuts,
        })
    }
}

/// Directions of the four corners of an image, in the camera frame; if the lens has no ray there, those of the nearest pixels towards the
/// middle that have one.
fn corner_rays(camera: &Camera) -> [Vector3<f64>; 4] {
    let [width, height] = [camera.width(), camera.height()].map(|pixels| f64::from(pixels - 1));
    [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| {
        let inward = (0..50).map(|step| 0.01 * f64::from(step));
        let ray = inward
            .map(|t| [u + t * (1.0 - 2.0 * u), v + t * (1.0 - 2.0 * v)])
            .find_map(|[u, v]| camera.unproject(&Point2::new(u * width, v * height)));
        let ray = ray.unwrap_or_default();
        Vector3::new(ray.x, ray.y, 1.0)
    })
}

/// The lowest distal and the lowest proximal point of a placed skin, split as for its placement.
fn contacts(
    skin: &Mesh,
    skin_ct: &Mesh,
    landmarks: &Landmarks,
    placement: &Placement,
    table: &Table,
    head: &Vector3<f64>,
) -> Vec<Point3<f64>> {
    let untipped_from_ct = placement.t_mat * placement.t_rot * landmarks.patient_from_ct();
    let joint = untipped_from_ct * Point3::from(landmarks.joint_centre);
    let is_distal = |point: &Point3<f32>| {
        let along = head.dot(&(untipped_from_ct * point.cast::<f64>() - joint));
        along < placement.contact.split_mm
    };
    let lowest = |distal: bool| {
        let half = skin_ct.vertices.iter().zip(&skin.vertices);
        half.filter(|(in_ct, _)| is_distal(in_ct) == distal)
            .map(|(_, placed)| placed.cast::<f64>())
            .min_by(|a, b| {
                let height = |p: &Point3<f64>| table.plane.plane.signed_distance(p);
                height(a).total_cmp(&height(b))
            })
    };
    [true, false].into_iter().filter_map(lowest).collect()
}
