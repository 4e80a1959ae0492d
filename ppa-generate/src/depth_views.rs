//! Depth images of a limb at one angle from the cameras of a plan, as in the plan's dataset.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use ppa_dataset::BodyShape;
use ppa_dataset::layout::{LimbId, View};
use ppa_depth::{Body, Camera, DepthImage, PlacedBody, Roi, WallDepth, roi_around};
use ppa_mesh::Mesh;
use ppa_scene::Placement;

use crate::closed_skin::closed_skin;
use crate::plan::Plan;
use crate::posable_limb::depth_image;
use crate::pose_error::PoseError;
use crate::prepared_limb::PreparedLimb;
use crate::scene_setup::{PlacedCamera, SceneSetup};
use crate::shaped_skin::body_shape;

/// What one camera sees.
#[derive(Debug, Clone)]
pub struct DepthView {
    /// Left or right camera.
    pub view: View,
    /// Lens of the camera.
    pub camera: Camera,
    /// The limb in the room; depths in mm, 0 where nothing is seen.
    pub image: DepthImage,
    /// Square around the joint, as in `roi_depth.json`; `None` if it is not in the image.
    pub region: Option<Roi>,
}

/// A limb with its skin as in the scan or in another body shape, ready to be rendered in any pose.
pub struct VisibleLimb {
    prepared: Arc<PreparedLimb>,
    shape: BodyShape,
    /// The skin of another body shape; `None` for that of the scan.
    shaped: Option<Mesh>,
    /// The closed skin in the `ct` frame.
    rigid: Arc<Body>,
}

/// The skin of a placed limb, for any number of cameras.
pub struct PosedSkin {
    shape: BodyShape,
    body: Arc<Body>,
    room_from_body: Isometry3<f64>,
    cut_faces: WallDepth,
    joint_in_room: Point3<f64>,
    /// Side of the square around the joint, mm.
    region_mm: f64,
}

impl VisibleLimb {
    /// Closes the skin of a limb.
    ///
    /// # Errors
    /// [`PoseError`] for a skin that cannot be rendered.
    pub fn new(prepared: impl Into<Arc<PreparedLimb>>) -> Result<Self, PoseError> {
        let prepared = prepared.into();
        let (skin, walls) = (&prepared.limb.mesh, &prepared.limb.walls);
        let rigid = Arc::new(closed_skin(&walls.vertices(skin), skin, walls)?);
        Ok(Self {
            prepared,
            shape: BodyShape::Orig,
            shaped: None,
            rigid,
        })
    }

    /// Returns the same limb in a body shape, as limb `limb` of a plan's dataset.
    ///
    /// # Errors
    /// [`PoseError`] if the skin cannot be shaped or rendered.
    pub fn with_shape(
        &self,
        shape: BodyShape,
        plan: &Plan,
        limb: LimbId,
    ) -> Result<Self, PoseError> {
        let (skin, walls) = (&self.prepared.limb.mesh, &self.prepared.limb.walls);
        let (landmarks, settings) = (&self.prepared.landmarks, &plan.shapes);
        let shaped = body_shape(skin, landmarks, shape, settings, limb, plan.seed)?;
        let rigid = Arc::new(closed_skin(&walls.vertices(&shaped), &shaped, walls)?);
        Ok(Self {
            prepared: self.prepared.clone(),
            shape,
            shaped: Some(shaped),
            rigid,
        })
    }

    fn room_from_ct(&self, placement: &Placement) -> Isometry3<f64> {
        let patient_from_ct = self.prepared.landmarks.patient_from_ct();
        *(placement.room_from_patient * patient_from_ct).isometry()
    }

    fn joint_in_room(&self, placement: &Placement) -> Point3<f64> {
        self.room_from_ct(placement) * Point3::from(self.prepared.landmarks.joint_centre)
    }

    fn skin(&self) -> &Mesh {
        self.shaped.as_ref().unwrap_or(&self.prepared.limb.mesh)
    }

    /// The limb.
    pub fn prepared(&self) -> &Arc<PreparedLimb> {
        &self.prepared
    }

    /// Returns the skin of the placed limb, flattened if soft tissue yields.
    ///
    /// Pixels that see a cut face of the field of view follow [`DepthSettings::cut_faces`](crate::DepthSettings) of `plan`.
    ///
    /// # Errors
    /// [`PoseError`] when the skin cannot be rendered.
    pub fn posed(&self, placement: &Placement, plan: &Plan) -> Result<PosedSkin, PoseError> {
        let (skin, landmarks) = (self.skin(), &self.prepared.landmarks);
        let (body, room_from_body) = if placement.flattening.is_some() {
            let walls = &self.prepared.limb.walls;
            let in_room = placement.in_room(&walls.vertices(skin), landmarks);
            let body = closed_skin(&in_room, skin, walls)?;
            (Arc::new(body), Isometry3::identity())
        } else {
            (self.rigid.clone(), self.room_from_ct(placement))
        };
        Ok(PosedSkin {
            shape: self.shape,
            body,
            room_from_body,
            cut_faces: plan.depth.cut_faces,
            joint_in_room: self.joint_in_room(placement),
            region_mm: plan.depth.roi_mm,
        })
    }

    /// Renders the limb, rotated by `angle_deg` and laid on the table of a scene setup; left camera first.
    ///
    /// `plan` is the plan of the scene setup. Ideal images equal those of the plan's dataset; those of a sensor have noise from `seed`.
    ///
    /// # Errors
    /// [`PoseError`] when the limb does not rest on the table, hides a camera, or a sensor measures nothing.
    pub fn depth_views(
        &self,
        setup: &SceneSetup,
        plan: &Plan,
        angle_deg: f64,
        seed: u64,
    ) -> Result<Vec<DepthView>, PoseError> {
        let landmarks = &self.prepared.landmarks;
        let angle_rad = angle_deg.to_radians();
        let settings = plan.place_settings();
        let place = |skin| (setup.table).place(skin, landmarks, angle_rad, &settings);
        let mut skin = self.posed(&place(self.skin())?, plan)?;
        if self.shaped.is_some() {
            // The skin of the scan determines the regions, as in the dataset.
            skin.joint_in_room = self.joint_in_room(&place(&self.prepared.limb.mesh)?);
        }
        let cameras = setup.cameras.iter();
        cameras.map(|camera| skin.seen_by(camera, seed)).collect()
    }
}

impl PosedSkin {
    /// Renders what a camera sees of the skin; a sensor has noise from `seed`.
    ///
    /// # Errors
    /// [`PoseError`] when the limb hides the camera, or its sensor measures nothing.
    pub fn seen_by(&self, placed: &PlacedCamera, seed: u64) -> Result<DepthView, PoseError> {
        let body = PlacedBody {
            body: &self.body,
            camera_from_body: placed.camera_from_room * self.room_from_body,
        };
        let joint = placed.camera_from_room * self.joint_in_room;
        Ok(DepthView {
            region: roi_around(&placed.camera, &joint, self.region_mm).ok(),
            view: placed.view,
            camera: placed.camera.clone(),
            image: depth_image(self.shape, body, placed, seed, self.cut_faces)?.image,
        })
    }
}
