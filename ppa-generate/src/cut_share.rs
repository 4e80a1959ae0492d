//! Share of a pose's images in which the limb is cut off by the field of view of its scan.

use nalgebra::{Isometry3, Point3};
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_dataset::layout::LimbId;
use ppa_depth::{
    Body, Camera, CameraError, CameraModel, CameraSpec, DepthError, DepthMode, MeshBody,
    PlacedBody, Roi, WallDepth, render, render_before, roi_around,
};
use ppa_mesh::{CutWalls, Mesh, WallMeasure};
use ppa_xray::{Detector, Projection, TransportError};

use crate::cut_error::{CutError, ExceededLimit, MAX_CUT_SHARE, PoseImage};
use crate::pose_error::PoseError;
use crate::scene_setup::PlacedCamera;

/// Columns or rows at which a radiograph's rays are sampled; fewer if its detector has fewer.
const MOST_RAYS: u32 = 512;

/// Walls of a limb as cameras and the x-ray tube see them.
pub(crate) struct CutFaces {
    /// Corners of the walls in the `ct` frame.
    corners: Vec<Point3<f32>>,
    /// The walls alone, and the tube as a camera; `None` if no face of the scan cuts the limb.
    from_tube: Option<(Body, Camera)>,
}

impl CutFaces {
    /// Prepares the walls of a skin for the detector of all its radiographs.
    pub fn new(
        walls: &CutWalls,
        skin: &Mesh,
        detector: &Detector,
        source_detector_mm: f64,
    ) -> Result<Self, PoseError> {
        let projection = Projection::new(Isometry3::identity(), source_detector_mm, *detector);
        projection.validate().map_err(TransportError::from)?;
        if walls.is_empty() {
            return Ok(Self {
                corners: Vec::new(),
                from_tube: None,
            });
        }
        let vertices = walls.vertices(skin);
        let mut used = walls.triangles.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        let alone = MeshBody::new(&vertices, &walls.triangles)?.into();
        Ok(Self {
            corners: used.iter().map(|&id| vertices[id as usize]).collect(),
            from_tube: Some((alone, tube(detector, source_detector_mm)?)),
        })
    }

    /// Whether no face of the scan cuts the limb.
    pub fn is_empty(&self) -> bool {
        self.from_tube.is_none()
    }

    /// Share of the region's pixels at whose centre the camera sees a wall, with nothing in front of it. `in_room` moves points of the scan
    /// as the limb was moved.
    pub fn in_region(
        &self,
        camera: &PlacedCamera,
        roi: &Roi,
        limb: PlacedBody,
        in_room: impl FnOnce(&[Point3<f32>]) -> Vec<Point3<f32>>,
    ) -> Result<f64, DepthError> {
        if self.is_empty() || is_beside(camera, roi, &in_room(&self.corners)) {
            return Ok(0.0);
        }
        let background = &camera.background;
        let seen = render_before(&camera.camera, &[limb], background, WallDepth::Flat)?;
        Ok(share(roi, background.width, &seen.wall_pixels))
    }

    /// Share of the rays of a radiograph's region that pass through a wall: they enter or leave the scan inside the limb, so that part of
    /// what they pass through is missing. The region is the square of `roi_mm` around the joint (`ct` frame), projected on the detector, or
    /// the entire detector if it misses that.
    pub fn in_radiograph(
        &self,
        ct_from_device: &Isometry3<f64>,
        joint: &Point3<f64>,
        roi_mm: f64,
    ) -> f64 {
        let Some((walls, tube)) = &self.from_tube else {
            return 0.0;
        };
        let device_from_ct = ct_from_device.inverse();
        let walls = PlacedBody {
            body: walls,
            camera_from_body: device_from_ct,
        };
        let image = render(tube, &[walls]);
        let crossed = (0..).zip(&image.z_mm).filter(|(_, z_mm)| **z_mm > 0.0);
        let crossed: Vec<u32> = crossed.map(|(pixel, _)| pixel).collect();
        match roi_around(tube, &(device_from_ct * joint), roi_mm) {
            Ok(roi) => share(&roi, image.width, &crossed),
            Err(_) => crossed.len() as f64 / image.z_mm.len() as f64,
        }
    }
}

/// Share of a region's pixels that are among `pixels`, row-major indices in an image of this width.
pub(crate) fn share(roi: &Roi, width: u32, pixels: &[u32]) -> f64 {
    let within = |start: u32, at: u32| (start..start + roi.size).contains(&at);
    let inside = pixels
        .iter()
        .filter(|&pixel| within(roi.x_start, pixel % width) && within(roi.y_start, pixel / width));
    inside.count() as f64 / f64::from(roi.size).powi(2)
}

/// Whether the convex hull of points of the room is outside a camera's region: no ray of the region is inside the box around the points in
/// X/Z and Y/Z. Holds for points in front of the camera and any lens.
fn is_beside(camera: &PlacedCamera, roi: &Roi, points: &[Point3<f32>]) -> bool {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in points {
        let at = camera.camera_from_room * point.cast::<f64>();
        if at.z <= 0.0 {
            return false;
        }
        for (axis, slope) in [at.x / at.z, at.y / at.z].into_iter().enumerate() {
            low[axis] = low[axis].min(slope);
            high[axis] = high[axis].max(slope);
        }
    }
    let width = camera.camera.width();
    let rows = roi.y_start..roi.y_start + roi.size;
    let pixels = rows.flat_map(|row| {
        (roi.x_start..roi.x_start + roi.size).map(move |column| row * width + column)
    });
    let rays = camera.camera.rays();
    pixels.filter_map(|pixel| rays[pixel as usize]).all(|ray| {
        [ray.x, ray.y]
            .into_iter()
            .enumerate()
            .any(|(axis, slope)| slope < low[axis] || slope > high[axis])
    })
}

/// The tube as a pinhole camera whose image plane holds the detector: columns along device x, rows along device y.
fn tube(detector: &Detector, source_detector_mm: f64) -> Result<Camera, CameraError> {
    let binned = detector
        .columns
        .max(detector.rows)
        .div_ceil(MOST_RAYS)
        .max(1);
    let [width, height] = [detector.columns, detector.rows].map(|pixels| pixels.div_ceil(binned));
    let pixel_mm = detector.pixel_mm * f64::from(binned);
    // Distance of the central beam from the first pixel's centre, in pixels; the last pixel may be cut.
    let first = |pixels: u32, centre_mm: f64| {
        0.5 * f64::from(pixels) / f64::from(binned) - 0.5 - centre_mm / pixel_mm
    };
    Camera::try_from(CameraSpec {
        model: CameraModel::Pinhole,
        width,
        height,
        fx: source_detector_mm / pixel_mm,
        fy: source_detector_mm / pixel_mm,
        cx: first(detector.columns, detector.centre_mm[0]),
        cy: first(detector.rows, detector.centre_mm[1]),
        k1: 0.0,
        k2: 0.0,
        k3: 0.0,
        k4: 0.0,
        k5: 0.0,
        k6: 0.0,
        p1: 0.0,
        p2: 0.0,
        metric_radius: None,
        ..CameraSpec::azure_kinect(DepthMode::NfovUnbinned)
    })
}

/// How much of each image of a pose is cut.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PoseCuts {
    pub step: u32,
    pub shares: Vec<(PoseImage, f64)>,
}

impl PoseCuts {
    /// Share of the radiograph's region that is cut.
    pub fn of_radiograph(&self) -> f64 {
        let of =
            |(image, share): &(PoseImage, f64)| (*image == PoseImage::Radiograph).then_some(*share);
        self.shares.iter().find_map(of).unwrap_or_default()
    }

    /// Finding about the image with the largest cut, if that exceeds [`MAX_CUT_SHARE`]; shares are in whole percent, so that similar poses
    /// have one finding. Its place is the centre of the cut nearest to the joint.
    pub fn finding(&self, walls: &CutWalls, skin: &Mesh, joint: &Point3<f64>) -> Option<Finding> {
        let (image, share) = self.shares.iter().copied().reduce(worse)?;
        if share <= MAX_CUT_SHARE {
            return None;
        }
        let percent = (100.0 * share).round();
        let far = |wall: &WallMeasure| (wall.centre - joint).norm();
        let nearest = walls
            .measured(skin)
            .into_iter()
            .min_by(|a, b| far(a).total_cmp(&far(b)));
        Some(Finding {
            code: FindingCode::CutInRegion,
            severity: Severity::Severe,
            text: format!(
                "about {percent} % of the {image} lies where the field of view of the scan cuts the limb off, expected at most {} %",
                100.0 * MAX_CUT_SHARE
            ),
            value: Some(percent / 100.0),
            place_mm: nearest.map(|wall| wall.centre.into()),
        })
    }
}

/// Refuses a limb with a region that is cut by more than its limit; `limits` are those of depth images and radiographs.
pub(crate) fn check(limb: LimbId, poses: &[PoseCuts], limits: [f64; 2]) -> Result<(), CutError> {
    let is_radiograph = |image| image == PoseImage::Radiograph;
    let worst = [false, true].into_iter().zip(limits);
    let worst: Vec<ExceededLimit> = worst
        .filter_map(|(radiographs, limit)| {
            let is_meant = |cut: &&(PoseImage, f64)| is_radiograph(cut.0) == radiographs;
            let above = |pose: &PoseCuts| {
                let cuts = pose.shares.iter().filter(is_meant);
                let above = cuts.filter(|cut| cut.1 > limit).copied();
                above.reduce(worse)
            };
            let above: Vec<_> = poses
                .iter()
                .filter_map(|pose| Some((pose.step, above(pose)?)))
                .collect();
            // The first of equal ones is taken, so that the message is always the same.
            let &(step, (image, share)) = above
                .iter()
                .reduce(|a, b| if b.1.1 > a.1.1 { b } else { a })?;
            Some(ExceededLimit {
                step,
                image,
                share,
                limit,
                exceeding: above.len(),
                poses: poses.len(),
            })
        })
        .collect();
    match worst.is_empty() {
        true => Ok(()),
        false => Err(CutError { limb, worst }),
    }
}

/// The image with the larger cut; the first of equal ones.
fn worse(a: (PoseImage, f64), b: (PoseImage, f64)) -> (PoseImage, f64) {
    if b.1 > a.1 { b } else { a }
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::{Side, View};

    use super::*;

    const LIMB: LimbId = LimbId {
        patient: 3,
        side: Side::Right,
    };

    #[test]
    fn the_worst_image_of_all_poses_is_named() {
        let pose = |step, depth, radiograph| PoseCuts {
            step,
            shares: vec![
                (PoseImage::Depth(View::Left), 0.0),
                (PoseImage::Depth(View::Right), depth),
                (PoseImage::Radiograph, radiograph),
            ],
        };
        let poses = [
            pose(0, 0.005, 0.0),
            pose(1, 0.02, 0.0),
            pose(2, 0.034, 0.03),
            pose(3, 0.034, 0.0),
        ];
        let error = check(LIMB, &poses, [0.01, 0.02]).unwrap_err();
        let worst = |error: &CutError| {
            let worst = error.worst.iter();
            let worst = worst.map(|worst| (worst.step, worst.image, worst.exceeding));
            worst.collect::<Vec<_>>()
        };
        let depth = (2, PoseImage::Depth(View::Right), 3);
        let radiograph = (2, PoseImage::Radiograph, 1);
        assert_eq!(worst(&error), [depth, radiograph]);
        let said = error.to_string();
        for part in [
            "limb r of patient 3",
            "1.0 degrees",
            "3.4 %",
            "1.0 %",
            "right camera",
            "3 of 4 poses",
            "depth.max_cut_share",
            "radiograph",
            "1 of 4 poses",
            "xray.max_cut_share",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
        let error = check(LIMB, &poses, [0.1, 0.02]).unwrap_err();
        assert_eq!(worst(&error), [radiograph]);
        assert_eq!(check(LIMB, &poses, [0.034, 0.03]), Ok(()));
    }

    /// A square wall of 40 mm, halfway to the detector, covers 80 mm of it.
    #[test]
    fn rays_through_a_wall_are_counted_on_the_detector() {
        let corners = [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]];
        let skin = Mesh {
            vertices: corners
                .map(|[x, y]| Point3::new(x + 10.0, y, 0.0_f32))
                .to_vec(),
            ..Mesh::default()
        };
        let walls = CutWalls {
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..CutWalls::default()
        };
        // 200 x 160 mm, shifted together with the wall; once with many pixels, once with few.
        for (columns, rows, pixel_mm) in [(2000, 1600, 0.1), (100, 80, 2.0)] {
            let detector = Detector::centred(columns, rows, pixel_mm).with_centre_mm([20.0, 0.0]);
            let cut = CutFaces::new(&walls, &skin, &detector, 1000.0).unwrap();
            let before = Isometry3::translation(0.0, 0.0, -500.0);
            let of = |roi_mm, x| cut.in_radiograph(&before, &Point3::new(x, 0.0, 0.0), roi_mm);
            let close = |share: f64, expected: f64| {
                assert!((share - expected).abs() < 0.01, "{share} {expected}")
            };
            close(of(40.0, 10.0), 1.0);
            close(of(60.0, 10.0), 4.0 / 9.0);
            close(of(40.0, 30.0), 0.5);
            // Outside the detector: all of it counts.
            close(of(40.0, 500.0), 80.0 * 80.0 / (200.0 * 160.0));
            let behind = Isometry3::translation(0.0, 0.0, 100.0);
            let joint = Point3::new(0.0, 0.0, 700.0);
            assert_eq!(cut.in_radiograph(&behind, &joint, 40.0), 0.0);
        }
    }
}
