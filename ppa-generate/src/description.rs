//! `dataset.json`: the settings common to all images, without paths or identities.

use ppa_core::TransformRows;
use ppa_dataset::files::{FileError, hex, sha256_of_file};
use ppa_dataset::findings::FindingCode;
use ppa_dataset::layout::{LimbId, View};
use ppa_depth::{CameraSpec, RigSpec, SensorSpec, WallDepth, rows_from_isometry};
use ppa_mesh::LimbSettings;
use ppa_scene::{LandmarkOverrides, PlaneSettings, Positioning, RoomSpec, SoftTissue, Sweep};
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::case::Case;
use crate::compiled::code;
use crate::plan::{Plan, XraySettings};
use crate::scene_setup::SceneSetup;
use crate::seal::sealed;
use crate::shaped_skin::ShapeSettings;

/// The settings of a plan that determine the bytes of its images; files are represented by their hashes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Settings {
    /// Program and version that made the images.
    generator: &'static str,
    /// Hash of sources, physics data and compiled crates, see `compiled.rs`.
    code: &'static str,
    /// Seed of the plan.
    seed: u64,
    /// Body shapes.
    shapes: ShapeSettings,
    /// Indentation of heel and calf where they rest on the table.
    soft_tissue: SoftTissue,
    /// Positioning errors; left out if there are none.
    #[serde(skip_serializing_if = "Positioning::is_default")]
    positioning: Positioning,
    /// SHA-256 of the point cloud of a recorded room; `null` for the built-in one.
    room_ply_sha256: Option<String>,
    /// The built-in room, and the x-ray device in either room.
    room: RoomSpec,
    /// How the table plane is searched for; `null` if it is the surface that the central beam hits first.
    table: Option<PlaneSettings>,
    /// Pose of the x-ray device in a recorded room, row-major, mm; `null` if the plan gives none.
    room_from_device: Option<TransformRows>,
    /// SHA-256 of the camera rig's file; `null` without a file.
    rig_sha256: Option<String>,
    /// The camera rig, if it is given in the plan or its room file.
    #[serde(skip_serializing_if = "Option::is_none")]
    cameras: Option<RigSpec>,
    /// Side of the square region of interest around the joint, mm at the joint.
    roi_mm: f64,
    /// Errors of the cameras' sensors; left out for ideal images.
    #[serde(skip_serializing_if = "Option::is_none")]
    sensor: Option<SensorSpec>,
    /// Depth where the field of view of the scan cuts the limb off.
    cut_faces: WallDepth,
    /// How radiographs are made. `max_cut_share`, which changes no image, is left out.
    xray: XraySettings,
}

impl Settings {
    pub fn of(plan: &Plan) -> Result<Self, FileError> {
        let hash =
            |path: &Option<std::path::PathBuf>| path.as_deref().map(sha256_of_file).transpose();
        Ok(Self {
            generator: concat!("ppa ", env!("CARGO_PKG_VERSION")),
            code: code(),
            seed: plan.seed,
            shapes: plan.shapes.clone(),
            soft_tissue: plan.soft_tissue,
            positioning: plan.positioning,
            room_ply_sha256: hash(&plan.room.ply)?,
            room: plan.room.parametric,
            table: plan.room.table.clone(),
            room_from_device: plan.room.room_from_device,
            rig_sha256: hash(&plan.depth.rig)?,
            cameras: plan.depth.cameras.clone(),
            roi_mm: plan.depth.roi_mm,
            sensor: plan.depth.sensor.clone(),
            cut_faces: plan.depth.cut_faces,
            // Limits decide which images are made, not their content.
            xray: XraySettings {
                max_cut_share: XraySettings::default().max_cut_share,
                ..plan.xray.clone()
            },
        })
    }

    /// Hash of everything that determines the images of a limb, except the pose.
    pub fn limb_key(&self, id: LimbId, case: &Case) -> String {
        let address = (
            self,
            id,
            &case.source.volume_sha256,
            &case.surface,
            &case.choices,
        );
        let text = serde_json::to_string(&address).expect("settings hold only JSON values");
        hex(&Sha256::digest(text.as_bytes()))
    }
}

/// `dataset.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Description<'a> {
    /// Format of this file.
    version: u32,
    /// Units of lengths and angles.
    units: &'static str,
    /// Medial rotations about the limb's axis.
    rotation: Sweep,
    /// Settings that determine the bytes of the images.
    settings: &'a Settings,
    /// Pose of the x-ray device in the room, row-major, mm.
    room_from_device: TransformRows,
    /// Distance of the detector from the source along the central beam, mm.
    source_detector_mm: f64,
    /// Plane of the table top in the room.
    table: Table,
    /// The depth cameras as placed in the room.
    cameras: Vec<CameraRow>,
    /// The limbs of the dataset.
    limbs: Vec<LimbRow<'a>>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Table {
    /// Unit normal, upwards.
    normal: [f64; 3],
    /// Distance of the plane from the room's origin along the normal, mm.
    offset_mm: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct CameraRow {
    /// Left or right camera.
    view: View,
    /// Its intrinsics.
    intrinsics: CameraSpec,
    /// Rigid motion from the camera frame to the room, row-major, mm.
    room_from_camera: TransformRows,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct LimbRow<'a> {
    /// Person and side.
    #[serde(flatten)]
    limb: LimbId,
    /// Hash of everything that the images of this limb depend on, except the pose.
    key: String,
    /// SHA-256 over size, affine and Hounsfield units of the scan.
    volume_sha256: &'a str,
    /// How the skin is found and separated from the couch.
    surface: &'a LimbSettings,
    /// Landmarks chosen by a person.
    choices: &'a LandmarkOverrides,
    /// Codes of findings that a person has accepted.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    acknowledged: &'a [FindingCode],
}

impl<'a> Description<'a> {
    pub fn of(
        rotation: Sweep,
        settings: &'a Settings,
        setup: &SceneSetup,
        cases: impl Iterator<Item = (LimbId, &'a Case)>,
    ) -> Self {
        let cameras = setup.cameras.iter().map(|camera| CameraRow {
            view: camera.view,
            intrinsics: camera.camera.spec().clone(),
            room_from_camera: rows_from_isometry(&camera.camera_from_room.inverse()),
        });
        let limbs = cases.map(|(limb, case)| LimbRow {
            limb,
            key: settings.limb_key(limb, case),
            volume_sha256: &case.source.volume_sha256,
            surface: &case.surface,
            choices: &case.choices,
            acknowledged: &case.acknowledged,
        });
        Self {
            version: 2,
            units: "mm; depth images: Z in mm, 0 invalid; tallies: eV/cm2 per history; \
                    transforms: row-major target_from_source; ct frame: LPS; dose_histories: null \
                    where the radiographs carry no noise",
            rotation,
            settings,
            room_from_device: setup
                .table
                .room
                .device
                .room_from_device
                .to_homogeneous_rows(),
            source_detector_mm: setup.table.room.device.source_detector_mm,
            table: Table {
                normal: setup.table.plane.plane.normal.into_inner().into(),
                offset_mm: setup.table.plane.plane.offset_mm,
            },
            cameras: cameras.collect(),
            limbs: limbs.collect(),
        }
    }

    /// The file's text, with its seal.
    pub fn to_text(&self) -> String {
        sealed(&serde_json::to_string_pretty(self).expect("settings hold only JSON values"))
    }
}
