//! Comparison of camera positions in the room of a plan by how much of a limb's joint they see.

use nalgebra::{Isometry3, Point3};
use ppa_core::TransformRows;
use ppa_depth::{
    BodyError, Camera, Coverage, CoverageError, CoverageSettings, JointSurface, MeshBody,
    PlacedBody, Viewpoint, rows_from_isometry,
};
use ppa_scene::{PlaceError, PlaceSettings, Positioning};
use serde::Serialize;

use crate::closed_skin::closed_skin;
use crate::prepared_limb::PreparedLimb;
use crate::scene_setup::{SceneSetup, SceneSetupError};

/// Why camera positions cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CoverageStudyError {
    /// A skin cannot be rendered.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// There is no skin near the joint, or a setting is out of range.
    #[error(transparent)]
    Coverage(#[from] CoverageError),
    /// The furniture cannot be rendered.
    #[error(transparent)]
    SceneSetup(#[from] SceneSetupError),
}

/// A camera somewhere in the room.
#[derive(Debug, Clone)]
pub struct CameraPlace {
    /// Name of the place.
    pub name: String,
    /// Lens of the camera.
    pub camera: Camera,
    /// Pose of the camera in the room, mm.
    pub room_from_camera: Isometry3<f64>,
}

/// Coverage of a joint by cameras.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoverageStudy {
    /// Centre of the joint in the room.
    pub joint_mm: [f64; 3],
    /// Area of the skin near the joint.
    pub surface_mm2: f64,
    /// Skin within this distance of the joint counts.
    pub radius_mm: f64,
    /// Largest angle of incidence.
    pub max_angle_deg: f64,
    /// The places, best first.
    pub places: Vec<RankedPlace>,
}

/// What a camera sees from one place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankedPlace {
    /// Rank, counted from 1.
    pub rank: usize,
    /// Name of the place.
    pub name: String,
    /// Position of the camera relative to the joint.
    #[serde(flatten)]
    pub viewpoint: Viewpoint,
    /// Coverage of the joint.
    #[serde(flatten)]
    pub coverage: Coverage,
    /// Pose of the camera in the room, row-major, mm.
    pub room_from_camera: TransformRows,
}

/// A rigid limb on the table of a room.
pub struct JointInRoom<'a> {
    setup: &'a SceneSetup,
    limb: &'a PreparedLimb,
    room_from_ct: Isometry3<f64>,
    joint_in_ct: Point3<f64>,
    /// The centre of the joint in the room, mm.
    pub joint: Point3<f64>,
}

impl<'a> JointInRoom<'a> {
    /// Lays a limb on the table, rotated medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest there.
    pub fn new(
        setup: &'a SceneSetup,
        limb: &'a PreparedLimb,
        angle_rad: f64,
        positioning: Positioning,
    ) -> Result<Self, PlaceError> {
        let landmarks = &limb.landmarks;
        let settings = PlaceSettings {
            positioning,
            ..PlaceSettings::default()
        };
        let skin = &limb.limb.mesh;
        let placement = (setup.table).place(skin, landmarks, angle_rad, &settings)?;
        let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
        let room_from_ct = *room_from_ct.isometry();
        let joint_in_ct = Point3::from(landmarks.joint_centre);
        Ok(Self {
            setup,
            limb,
            room_from_ct,
            joint_in_ct,
            joint: room_from_ct * joint_in_ct,
        })
    }

    /// The cameras of the rig.
    pub fn rig(&self) -> Vec<CameraPlace> {
        let cameras = self.setup.cameras.iter();
        cameras
            .map(|placed| CameraPlace {
                name: format!("rig {}", placed.view.name()),
                camera: placed.camera.clone(),
                room_from_camera: placed.camera_from_room.inverse(),
            })
            .collect()
    }

    /// Ranks cameras by what they see of the skin near the joint, where neither limb nor furniture hides it.
    ///
    /// # Errors
    /// [`CoverageStudyError`] for a setting out of range, or if there is no skin near the joint.
    pub fn rank(
        &self,
        places: &[CameraPlace],
        settings: &CoverageSettings,
    ) -> Result<CoverageStudy, CoverageStudyError> {
        let (skin, walls) = (&self.limb.limb.mesh, &self.limb.limb.walls);
        let mesh = MeshBody::new(&skin.vertices, &skin.triangles)?;
        let surface = JointSurface::new(&mesh, &self.joint_in_ct, settings)?;
        // A cut face of the limb shows no skin, but hides what is behind it.
        let limb = closed_skin(&walls.vertices(skin), skin, walls)?;
        let furniture = self.setup.table.furniture()?;
        let see = |place: &CameraPlace| {
            let camera_from_room = place.room_from_camera.inverse();
            let scene = [
                PlacedBody {
                    body: &limb,
                    camera_from_body: camera_from_room * self.room_from_ct,
                },
                PlacedBody {
                    body: &furniture,
                    camera_from_body: camera_from_room,
                },
            ];
            let position = place.room_from_camera * Point3::origin();
            RankedPlace {
                rank: 0,
                name: place.name.clone(),
                viewpoint: Viewpoint::of(&position, &self.joint),
                coverage: surface.seen(&place.camera, &scene[0].camera_from_body, &scene),
                room_from_camera: rows_from_isometry(&place.room_from_camera),
            }
        };
        let mut places: Vec<RankedPlace> = places.iter().map(see).collect();
        places.sort_by(|a, b| a.coverage.best_first(&b.coverage));
        for (i, place) in places.iter_mut().enumerate() {
            place.rank = i + 1;
        }
        Ok(CoverageStudy {
            joint_mm: self.joint.into(),
            surface_mm2: surface.area_mm2(),
            radius_mm: settings.radius_mm,
            max_angle_deg: settings.max_angle_deg,
            places,
        })
    }
}
