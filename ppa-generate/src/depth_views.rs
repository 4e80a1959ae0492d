//! Depth images of a limb at one angle from the cameras of a plan, as in the plan's dataset.

use ppa_dataset::BodyShape;
use ppa_dataset::layout::View;
use ppa_depth::{Camera, DepthImage, PlacedBody};

use crate::closed_skin::closed_skin;
use crate::plan::Plan;
use crate::posable_limb::depth_image;
use crate::pose_error::PoseError;
use crate::prepare::PreparedLimb;
use crate::scene_setup::SceneSetup;

/// What one camera sees.
#[derive(Debug, Clone)]
pub struct DepthView {
    /// Which camera.
    pub view: View,
    /// Its lens.
    pub camera: Camera,
    /// The limb in the room; depths in mm, 0 where nothing is seen.
    pub image: DepthImage,
}

/// Depth images of a limb, its skin as in the scan, turned by `angle_deg` and laid on the table of a scene setup; left camera first.
/// Pixels that see a cut face of the field of view are as [`DepthSettings::cut_faces`](crate::DepthSettings) says.
///
/// `plan` is the plan of the scene setup. Ideal images are those of the plan's dataset; those of a sensor have noise of `seed`.
///
/// # Errors
/// [`PoseError`] when the limb does not rest on the table, hides a camera, or a sensor measures nothing.
pub fn depth_views(
    setup: &SceneSetup,
    plan: &Plan,
    limb: &PreparedLimb,
    angle_deg: f64,
    seed: u64,
) -> Result<Vec<DepthView>, PoseError> {
    let (skin, landmarks) = (&limb.limb.mesh, &limb.landmarks);
    let angle_rad = angle_deg.to_radians();
    let placement = (setup.table).place(skin, landmarks, angle_rad, &plan.soft_tissue)?;
    let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
    let is_soft = placement.flattening.is_some();
    let vertices = limb.limb.walls.vertices(skin);
    let body = if is_soft {
        closed_skin(
            &placement.in_room(&vertices, landmarks),
            skin,
            &limb.limb.walls,
        )?
    } else {
        closed_skin(&vertices, skin, &limb.limb.walls)?
    };
    let see = |placed: &crate::scene_setup::PlacedCamera| {
        let camera_from_body = if is_soft {
            placed.camera_from_room
        } else {
            placed.camera_from_room * room_from_ct.isometry()
        };
        let body = PlacedBody {
            body: &body,
            camera_from_body,
        };
        Ok(DepthView {
            view: placed.view,
            camera: placed.camera.clone(),
            image: depth_image(BodyShape::Orig, body, placed, seed, plan.depth.cut_faces)?.image,
        })
    };
    setup.cameras.iter().map(see).collect()
}
