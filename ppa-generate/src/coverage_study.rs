//! Where a camera in the room of a plan would see most of a limb's joint.

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

/// Why places of a camera cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CoverageStudyError {
    /// A skin that cannot be rendered.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The skin near the joint, or a setting.
    #[error(transparent)]
    Coverage(#[from] CoverageError),
    /// Furniture that cannot be rendered.
    #[error(transparent)]
    SceneSetup(#[from] SceneSetupError),
}

/// A camera somewhere in the room.
#[derive(Debug, Clone)]
pub struct CameraPlace {
    /// What it is called.
    pub name: String,
    /// Its lens.
    pub camera: Camera,
    /// Where it stands, mm.
    pub room_from_camera: Isometry3<f64>,
}

/// What cameras see of a joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoverageStudy {
    /// The joint in the room.
    pub joint_mm: [f64; 3],
    /// Area of the skin near it.
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
    /// From 1.
    pub rank: usize,
    /// What it is called.
    pub name: String,
    /// Where it is, seen from the joint.
    #[serde(flatten)]
    pub viewpoint: Viewpoint,
    /// What it sees.
    #[serde(flatten)]
    pub coverage: Coverage,
    /// Where it stands, row-major, mm.
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
    /// Lays a limb on the table, turned medially by an angle in radians.
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

    /// What cameras see of the skin near the joint, where neither limb nor furniture hides it.
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
        // Where the scan cuts the limb no skin is to be seen, but what is behind is hidden.
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
