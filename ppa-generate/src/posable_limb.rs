//! One pose of one limb: its depth images and its radiograph.

use std::path::Path;

use nalgebra::{Isometry3, Point3};
use ppa_dataset::BodyShape;
use ppa_dataset::files::{FileError, sha256_of_file};
use ppa_dataset::findings::Finding;
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::{FileKind, FileRow, RoiFile, RoiRow};
use ppa_depth::{
    Body, PlacedBody, Roi, WallDepth, WalledImage, render_before, roi_around, rows_from_isometry,
};
use ppa_mesh::{Displacement, Mesh};
use ppa_scene::{Placement, PoseAngle};
use rayon::prelude::*;

use crate::analog_histories::AnalogHistories;
use crate::closed_skin::closed_skin;
use crate::cut_error::PoseImage;
use crate::cut_share::{self, CutFaces, PoseCuts};
use crate::exposable_limb::{ExposableLimb, PosedExposure};
use crate::off_detector::off_detector;
use crate::plan::Plan;
use crate::pose_error::PoseError;
use crate::prepared_limb::PreparedLimb;
use crate::record::PoseJob;
use crate::scene_setup::{PlacedCamera, SceneSetup};
use crate::seed::{Purpose, item_seed};
use crate::shaped_skin::body_shape;

struct ShapedSkin {
    shape: BodyShape,
    mesh: Mesh,
    body: Body,
    /// Change of the enclosed volume against the skin of the scan; `None` for that skin.
    volume_change_mm3: Option<f64>,
}

/// The images of a pose, with regions of interest and findings.
pub(crate) struct Images {
    /// Rows of its images, which are already written.
    pub files: Vec<FileRow>,
    /// Regions of interest in them.
    pub rois: RoiFile,
    /// Findings about the limb and about this pose.
    pub findings: Vec<Finding>,
}

/// A limb with everything that all its poses share.
pub(crate) struct PosableLimb<'a> {
    id: LimbId,
    plan: &'a Plan,
    setup: &'a SceneSetup,
    limb: ExposableLimb,
    shapes: Vec<ShapedSkin>,
    cut_faces: CutFaces,
    /// How much of each image is cut, by pose of the plan; empty if no face of the scan cuts the limb.
    cuts: Vec<PoseCuts>,
}

impl<'a> PosableLimb<'a> {
    pub(crate) fn new(
        id: LimbId,
        plan: &'a Plan,
        setup: &'a SceneSetup,
        prepared: PreparedLimb,
    ) -> Result<Self, PoseError> {
        let (skin, walls) = (&prepared.limb.mesh, &prepared.limb.walls);
        let shaped = |&shape: &BodyShape| {
            let (landmarks, settings) = (&prepared.landmarks, &plan.shapes);
            let mesh = body_shape(skin, landmarks, shape, settings, id, plan.seed)?;
            let body = closed_skin(&walls.vertices(&mesh), &mesh, walls)?;
            let change = || Displacement::between(skin, &mesh).volume_mm3;
            let volume_change_mm3 = (shape != BodyShape::Orig).then(change);
            Ok::<_, PoseError>(ShapedSkin {
                shape,
                mesh,
                body,
                volume_change_mm3,
            })
        };
        let source_detector_mm = setup.table.room.device.source_detector_mm;
        let cut_faces = CutFaces::new(walls, skin, &plan.xray.detector, source_detector_mm)?;
        let shapes = plan.shapes.variants.iter().map(shaped);
        let mut posable = Self {
            id,
            plan,
            setup,
            shapes: shapes.collect::<Result<_, _>>()?,
            limb: ExposableLimb::new(prepared, plan, setup.table.clone(), setup.spectrum.clone())?,
            cut_faces,
            cuts: Vec::new(),
        };
        posable.cuts = posable.checked_cuts()?;
        Ok(posable)
    }

    /// Computes the cuts of all poses of the plan before the first of them is made, and refuses a limb that is cut too much.
    fn checked_cuts(&self) -> Result<Vec<PoseCuts>, PoseError> {
        if self.cut_faces.is_empty() {
            return Ok(Vec::new());
        }
        let (skin, walls) = (
            &self.limb.prepared.limb.mesh,
            &self.limb.prepared.limb.walls,
        );
        let rigid = closed_skin(&walls.vertices(skin), skin, walls)?;
        let poses = self.plan.rotation.poses()?;
        // A pose that cannot be made is reported later, with its angle.
        let cuts: Vec<PoseCuts> = poses
            .par_iter()
            .filter_map(|&pose| self.pose_cuts(pose, &rigid).ok())
            .collect();
        let limits = [self.plan.depth.max_cut_share, self.plan.xray.max_cut_share];
        cut_share::check(self.id, &cuts, limits)?;
        Ok(cuts)
    }

    /// How much of each image is cut; `rigid` is the closed skin of the scan.
    fn pose_cuts(&self, pose: PoseAngle, rigid: &Body) -> Result<PoseCuts, PoseError> {
        let skin = &self.limb.prepared.limb.mesh;
        let exposure = self.limb.pose(pose.angle_rad())?;
        let placement = exposure.placement;
        let flattened = self.flattened(skin, &placement)?;
        let in_room =
            |points: &[Point3<f32>]| placement.in_room(points, &self.limb.prepared.landmarks);
        let mut shares = Vec::new();
        for camera in &self.setup.cameras {
            let roi = self.roi(camera, &placement)?;
            let limb = self.placed(camera, &placement, flattened.as_ref(), rigid);
            let share = self.cut_faces.in_region(camera, &roi, limb, in_room)?;
            shares.push((PoseImage::Depth(camera.view), share));
        }
        let (ct_from_device, roi_mm) = (exposure.projection.ct_from_device, self.plan.depth.roi_mm);
        let share = (self.cut_faces).in_radiograph(&ct_from_device, &self.joint(), roi_mm);
        shares.push((PoseImage::Radiograph, share));
        Ok(PoseCuts {
            step: pose.step,
            shares,
        })
    }

    fn cuts_at(&self, pose: PoseAngle) -> Option<&PoseCuts> {
        self.cuts.iter().find(|cuts| cuts.step == pose.step)
    }

    /// Centre of the joint in the `ct` frame.
    fn joint(&self) -> Point3<f64> {
        self.limb.prepared.landmarks.joint_centre.into()
    }

    /// Makes all images of one pose under `root`; `histories` keeps those of a stopped analog radiograph.
    pub(crate) fn make(
        &self,
        pose_job: &PoseJob,
        root: &Path,
        histories: Option<&AnalogHistories>,
    ) -> Result<Images, PoseError> {
        let pose = pose_job.pose;
        let mut files = Vec::new();
        let noise_seed = item_seed(self.plan.seed, Purpose::DepthNoise, self.id, pose.step);
        // The skin of the scan determines the pose of the radiograph and the regions of interest.
        let exposure = self.limb.pose(pose.angle_rad())?;
        let placement = exposure.placement;
        let cameras = self.setup.cameras.iter();
        let rois: Vec<Roi> = cameras
            .map(|camera| self.roi(camera, &placement))
            .collect::<Result<_, _>>()?;
        for shaped in &self.shapes {
            let placement = match shaped.shape {
                BodyShape::Orig => placement,
                _ => self.limb.place(&shaped.mesh, pose.angle_rad())?,
            };
            let flattened = self.flattened(&shaped.mesh, &placement)?;
            for (camera, roi) in self.setup.cameras.iter().zip(&rois) {
                let file = self.id.depth(shaped.shape, camera.view, pose.step);
                let placed = self.placed(camera, &placement, flattened.as_ref(), &shaped.body);
                let walls = self.plan.depth.cut_faces;
                let WalledImage { image, wall_pixels } =
                    depth_image(shaped.shape, placed, camera, noise_seed, walls)?;
                let cut = cut_share::share(roi, image.width, &wall_pixels);
                let path = prepare_folder(root, &file)?;
                let too_far_pixels = image.write_png(&path)?;
                files.push(FileRow {
                    camera: Some(camera.view),
                    seed: camera.sensor.is_some().then_some(noise_seed),
                    shape: shaped.shape,
                    volume_change_mm3: shaped.volume_change_mm3,
                    too_far_pixels,
                    cut_share: (cut > 0.0).then_some(cut),
                    ..self.row(root, file, FileKind::Depth, pose, &placement)?
                });
            }
        }
        files.extend(self.radiograph(pose_job, &exposure, root, histories)?);
        let mut findings = self.limb.prepared.findings.clone();
        findings.extend(self.cuts_at(pose).and_then(|cuts| {
            let (skin, joint) = (&self.limb.prepared.limb.mesh, self.joint());
            cuts.finding(&self.limb.prepared.limb.walls, skin, &joint)
        }));
        findings.extend(off_detector(&exposure.projection, &self.joint()));
        let rows = self.setup.cameras.iter().zip(&rois);
        let rows = rows.map(|(camera, roi)| roi_row(camera, roi, pose));
        Ok(Images {
            files,
            rois: rows.collect(),
            findings,
        })
    }

    /// T^V_CT: from the scan through patient and room to the camera.
    fn camera_from_ct(&self, camera: &PlacedCamera, placement: &Placement) -> Isometry3<f64> {
        let room_from_ct =
            placement.room_from_patient * self.limb.prepared.landmarks.patient_from_ct();
        camera.camera_from_room * room_from_ct.isometry()
    }

    /// The skin flattened by the table, in the room; `None` for a rigid one.
    fn flattened(&self, skin: &Mesh, placement: &Placement) -> Result<Option<Body>, PoseError> {
        if placement.flattening.is_none() {
            return Ok(None);
        }
        let walls = &self.limb.prepared.limb.walls;
        let in_room = placement.in_room(&walls.vertices(skin), &self.limb.prepared.landmarks);
        Ok(Some(closed_skin(&in_room, skin, walls)?))
    }

    /// A skin placed in the camera frame: flattened in the room, or rigid in the scan.
    fn placed<'b>(
        &self,
        camera: &PlacedCamera,
        placement: &Placement,
        flattened: Option<&'b Body>,
        rigid: &'b Body,
    ) -> PlacedBody<'b> {
        match flattened {
            Some(body) => PlacedBody {
                body,
                camera_from_body: camera.camera_from_room,
            },
            None => PlacedBody {
                body: rigid,
                camera_from_body: self.camera_from_ct(camera, placement),
            },
        }
    }

    fn roi(&self, camera: &PlacedCamera, placement: &Placement) -> Result<Roi, PoseError> {
        let joint_in_camera = self.camera_from_ct(camera, placement) * self.joint();
        Ok(roi_around(
            &camera.camera,
            &joint_in_camera,
            self.plan.depth.roi_mm,
        )?)
    }

    fn radiograph(
        &self,
        pose_job: &PoseJob,
        exposure: &PosedExposure,
        root: &Path,
        histories: Option<&AnalogHistories>,
    ) -> Result<[FileRow; 2], PoseError> {
        let pose = pose_job.pose;
        let cut = self.cuts_at(pose).map_or(0.0, PoseCuts::of_radiograph);
        let seed = item_seed(self.plan.seed, Purpose::Radiograph, self.id, pose.step);
        let radiograph = match (histories, self.plan.xray.analog) {
            (Some(histories), Some(settings)) => {
                histories.radiograph(pose_job, exposure, &settings.with_seed(seed))?
            }
            _ => exposure.radiograph(seed)?,
        };
        let png = self.id.radiograph_png(pose.step);
        radiograph.write_png(&prepare_folder(root, &png)?, &self.plan.xray.presentation)?;
        let exr = self.id.radiograph_exr(pose.step);
        radiograph.write_exr(&root.join(&exr))?;
        let receptor = &exposure.projection.receptor;
        let exposure_index = radiograph.exposure_index(receptor).ok().flatten();
        let row = |file, kind| {
            Ok::<_, PoseError>(FileRow {
                ct_from_device: Some(rows_from_isometry(&exposure.projection.ct_from_device)),
                seed: Some(seed),
                cut_share: (cut > 0.0).then_some(cut),
                mas: radiograph.mas().filter(|mas| mas.is_finite()),
                exposure_index,
                ..self.row(root, file, kind, pose, &exposure.placement)?
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
    ) -> Result<FileRow, PoseError> {
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
            cut_share: None,
            patient_from_ct: self
                .limb
                .prepared
                .landmarks
                .patient_from_ct()
                .to_homogeneous_rows(),
            room_from_patient: placement.room_from_patient.to_homogeneous_rows(),
            ct_from_device: None,
            mas: None,
            exposure_index: None,
            seed: None,
        })
    }
}

fn roi_row(camera: &PlacedCamera, roi: &Roi, pose: PoseAngle) -> (String, RoiRow) {
    let row = RoiRow {
        camera: camera.view,
        image_number: pose.step,
        x_start: roi.x_start,
        y_start: roi.y_start,
        size: roi.size,
    };
    (LimbId::depth_name(camera.view, pose.step), row)
}

pub(crate) fn depth_image(
    shape: BodyShape,
    placed: PlacedBody,
    camera: &PlacedCamera,
    noise_seed: u64,
    walls: WallDepth,
) -> Result<WalledImage, PoseError> {
    placed.require_camera_outside()?;
    if let Some((sensor, backdrop)) = &camera.sensor {
        let seen = backdrop.before_with_walls(&camera.camera, &[placed], walls)?;
        // One frame per body shape and camera.
        let frame = 2 * shape as u64 + camera.view as u64;
        let image = sensor.observe(&camera.camera, &seen, noise_seed, frame)?;
        image.require_measured(seen.image.valid_pixels())?;
        return Ok(WalledImage {
            image,
            wall_pixels: seen.wall_pixels,
        });
    }
    Ok(render_before(
        &camera.camera,
        &[placed],
        &camera.background,
        walls,
    )?)
}

fn prepare_folder(root: &Path, file: &str) -> Result<std::path::PathBuf, FileError> {
    let path = root.join(file);
    let folder = path.parent().expect("files lie in folders of the dataset");
    std::fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
    Ok(path)
}
