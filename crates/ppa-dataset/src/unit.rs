//! One pose of one limb: its depth images and its radiograph.

use std::path::Path;

use nalgebra::{Isometry3, Point3};
use ppa_depth::{Body, DepthImage, MeshBody, PlacedBody, roi_around, rows_from_isometry};
use ppa_mesh::{Displacement, Mesh};
use ppa_scene::{Placement, PoseAngle, place_soft};
use ppa_xray::{FastSettings, VoxelPhantom};

use crate::body_shape::BodyShape;
use crate::files::{FileError, sha256_of_file};
use crate::findings::Finding;
use crate::layout::LimbId;
use crate::manifest::{FileKind, FileRow, RoiFile, RoiRow};
use crate::plan::Plan;
use crate::prepare::PreparedLimb;
use crate::radiograph::{JointError, joint_phantom, projection};
use crate::seed::{Purpose, item_seed};
use crate::shaped_skin::body_shape;
use crate::stage::{PlacedCamera, Stage};

/// Why a pose could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnitError {
    /// A body shape.
    #[error(transparent)]
    Shape(#[from] ppa_mesh::ShapeError),
    /// A skin that cannot be rendered.
    #[error(transparent)]
    Body(#[from] ppa_depth::BodyError),
    /// The limb could not be laid on the table.
    #[error(transparent)]
    Place(#[from] ppa_scene::PlaceError),
    /// A depth image.
    #[error(transparent)]
    Depth(#[from] ppa_depth::DepthError),
    /// A region of interest.
    #[error(transparent)]
    Roi(#[from] ppa_depth::RoiError),
    /// The voxels of the joint.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The radiograph.
    #[error(transparent)]
    Transport(#[from] ppa_xray::TransportError),
    /// The radiograph's files.
    #[error(transparent)]
    Output(#[from] ppa_xray::OutputError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}

struct ShapedSkin {
    shape: BodyShape,
    mesh: Mesh,
    body: Body,
    /// How much more it encloses than the skin of the scan; `None` for that itself.
    volume_change_mm3: Option<f64>,
}

/// What a pose is made of.
pub(crate) struct Images {
    /// Its images, already written.
    pub files: Vec<FileRow>,
    /// Regions of interest in them.
    pub rois: RoiFile,
    /// Doubts about the limb and about this pose.
    pub findings: Vec<Finding>,
}

/// A limb with everything that all its poses share.
pub(crate) struct PosableLimb<'a> {
    id: LimbId,
    plan: &'a Plan,
    stage: &'a Stage,
    prepared: PreparedLimb,
    shapes: Vec<ShapedSkin>,
    phantom: VoxelPhantom,
}

impl<'a> PosableLimb<'a> {
    pub(crate) fn new(
        id: LimbId,
        plan: &'a Plan,
        stage: &'a Stage,
        prepared: PreparedLimb,
    ) -> Result<Self, UnitError> {
        let skin = &prepared.limb.mesh;
        let shaped = |&shape: &BodyShape| {
            let (landmarks, settings) = (&prepared.landmarks, &plan.shapes);
            let mesh = body_shape(skin, landmarks, shape, settings, id, plan.seed)?;
            let body = Body::Mesh(MeshBody::new(&mesh.vertices, &mesh.triangles)?);
            let change = || Displacement::between(skin, &mesh).volume_mm3;
            let volume_change_mm3 = (shape != BodyShape::Orig).then(change);
            Ok::<_, UnitError>(ShapedSkin {
                shape,
                mesh,
                body,
                volume_change_mm3,
            })
        };
        let shapes = plan.shapes.variants.iter().map(shaped);
        Ok(Self {
            id,
            plan,
            stage,
            shapes: shapes.collect::<Result<_, _>>()?,
            phantom: joint_phantom(&prepared, &plan.xray)?,
            prepared,
        })
    }

    /// Makes all images of one pose under `root`.
    pub(crate) fn make(&self, pose: PoseAngle, root: &Path) -> Result<Images, UnitError> {
        let mut files = Vec::new();
        let noise_seed = item_seed(self.plan.seed, Purpose::DepthNoise, self.id, pose.step);
        // The skin of the scan decides the pose of the radiograph and the regions of interest.
        let placement = self.place(&self.prepared.limb.mesh, pose)?;
        for shaped in &self.shapes {
            let placement = match shaped.shape {
                BodyShape::Orig => placement,
                _ => self.place(&shaped.mesh, pose)?,
            };
            let flattened = self.flattened(&shaped.mesh, &placement)?;
            for camera in &self.stage.cameras {
                let file = self.id.depth(shaped.shape, camera.view, pose.step);
                let placed = match &flattened {
                    Some(body) => PlacedBody {
                        body,
                        camera_from_body: camera.camera_from_room,
                    },
                    None => PlacedBody {
                        body: &shaped.body,
                        camera_from_body: self.camera_from_ct(camera, &placement),
                    },
                };
                let image = depth_image(shaped.shape, placed, camera, noise_seed)?;
                let path = prepare_folder(root, &file)?;
                let too_far_pixels = image.write_png(&path)?;
                files.push(FileRow {
                    camera: Some(camera.view),
                    seed: camera.sensor.is_some().then_some(noise_seed),
                    shape: shaped.shape,
                    volume_change_mm3: shaped.volume_change_mm3,
                    too_far_pixels,
                    ..self.row(root, file, FileKind::Depth, pose, &placement)?
                });
            }
        }
        files.extend(self.radiograph(pose, &placement, root)?);
        let rois = self
            .stage
            .cameras
            .iter()
            .map(|camera| self.roi(camera, &placement, pose));
        let rois = rois.collect::<Result<_, _>>()?;
        Ok(Images {
            files,
            rois,
            findings: self.prepared.findings.clone(),
        })
    }

    fn place(&self, skin: &Mesh, pose: PoseAngle) -> Result<Placement, UnitError> {
        let table = &self.stage.table;
        Ok(place_soft(
            &skin.vertices,
            &self.prepared.landmarks,
            pose.angle_rad(),
            &table.plane.plane,
            &table.room.device,
            &self.plan.soft_tissue,
        )?)
    }

    /// T^V_CT: through the patient and the room into the camera.
    fn camera_from_ct(&self, camera: &PlacedCamera, placement: &Placement) -> Isometry3<f64> {
        let room_from_ct = placement.room_from_patient * self.prepared.landmarks.patient_from_ct();
        camera.camera_from_room * room_from_ct.isometry()
    }

    /// A skin that the table flattens, in the room; `None` for a rigid one.
    fn flattened(&self, skin: &Mesh, placement: &Placement) -> Result<Option<Body>, UnitError> {
        if placement.flattening.is_none() {
            return Ok(None);
        }
        let in_room = placement.in_room(&skin.vertices, &self.prepared.landmarks);
        Ok(Some(Body::Mesh(MeshBody::new(&in_room, &skin.triangles)?)))
    }

    fn roi(
        &self,
        camera: &PlacedCamera,
        placement: &Placement,
        pose: PoseAngle,
    ) -> Result<(String, RoiRow), UnitError> {
        let joint = Point3::from(self.prepared.landmarks.joint_centre);
        let joint_in_camera = self.camera_from_ct(camera, placement) * joint;
        let roi = roi_around(&camera.camera, &joint_in_camera, self.plan.depth.roi_mm)?;
        let row = RoiRow {
            camera: camera.view,
            image_number: pose.step,
            x_start: roi.x_start,
            y_start: roi.y_start,
            size: roi.size,
        };
        Ok((LimbId::depth_name(camera.view, pose.step), row))
    }

    fn radiograph(
        &self,
        pose: PoseAngle,
        placement: &Placement,
        root: &Path,
    ) -> Result<[FileRow; 2], UnitError> {
        let settings = &self.plan.xray;
        let device = &self.stage.table.room.device;
        let projection = projection(placement, &self.prepared.landmarks, device, settings);
        let seed = item_seed(self.plan.seed, Purpose::Radiograph, self.id, pose.step);
        let engine = FastSettings {
            seed,
            ..settings.engine
        };
        let radiograph = ppa_xray::fast(&self.phantom, &self.stage.spectrum, &projection, &engine)?;
        let png = self.id.radiograph_png(pose.step);
        radiograph.write_png(&prepare_folder(root, &png)?, &settings.presentation)?;
        let exr = self.id.radiograph_exr(pose.step);
        radiograph.write_exr(&root.join(&exr))?;
        let row = |file, kind| {
            Ok::<_, UnitError>(FileRow {
                ct_from_device: Some(rows_from_isometry(&projection.ct_from_device)),
                seed: Some(seed),
                ..self.row(root, file, kind, pose, placement)?
            })
        };
        Ok([
            row(png, FileKind::Radiograph)?,
            row(exr, FileKind::RadiographTallies)?,
        ])
    }

    fn row(
        &self,
        root: &Path,
        file: String,
        kind: FileKind,
        pose: PoseAngle,
        placement: &Placement,
    ) -> Result<FileRow, UnitError> {
        Ok(FileRow {
            sha256: sha256_of_file(&root.join(&file))?,
            file,
            kind,
            limb: self.id,
            step: pose.step,
            angle_deg: pose.angle_deg,
            camera: None,
            shape: BodyShape::Orig,
            volume_change_mm3: None,
            too_far_pixels: 0,
            patient_from_ct: self
                .prepared
                .landmarks
                .patient_from_ct()
                .to_homogeneous_rows(),
            room_from_patient: placement.room_from_patient.to_homogeneous_rows(),
            ct_from_device: None,
            seed: None,
        })
    }
}

pub(crate) fn depth_image(
    shape: BodyShape,
    placed: PlacedBody,
    camera: &PlacedCamera,
    noise_seed: u64,
) -> Result<DepthImage, UnitError> {
    placed.require_camera_outside()?;
    if let Some((sensor, backdrop)) = &camera.sensor {
        let seen = backdrop.before(&camera.camera, &[placed])?;
        // One frame per body shape and camera.
        let frame = 2 * shape as u64 + camera.view as u64;
        let image = sensor.observe(&camera.camera, &seen, noise_seed, frame);
        image.require_measured(seen.image.valid_pixels())?;
        return Ok(image);
    }
    let limb = ppa_depth::render(&camera.camera, &[placed]);
    Ok(limb.before(&camera.background)?)
}

fn prepare_folder(root: &Path, file: &str) -> Result<std::path::PathBuf, FileError> {
    let path = root.join(file);
    let folder = path.parent().expect("files lie in folders of the dataset");
    std::fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
    Ok(path)
}
