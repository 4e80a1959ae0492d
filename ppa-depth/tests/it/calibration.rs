//! The same camera from the files of several manufacturers, and its depth modes.

use nalgebra::{Point2, Point3};
use ppa_depth::{Camera, CameraError, CameraModel, CameraSpec, DepthMode};

/// Unit-scale numbers of `ut_calibration_data.h` of the public Azure Kinect Sensor SDK.
const DEVICE: &str = r#"{"CalibrationInformation": {"Cameras": [
    {"Purpose": "CALIBRATION_CameraPurposePhotoVideo", "MetricRadius": 1.5,
     "Intrinsics": {"ModelType": "CALIBRATION_LensDistortionModelBrownConrady", "ModelParameterCount": 14,
                    "ModelParameters": [0.5, 0.5, 0.5, 0.5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]}},
    {"Purpose": "CALIBRATION_CameraPurposeDepth", "MetricRadius": 1.737323045730591, "SensorWidth": 1024,
     "Intrinsics": {"ModelType": "CALIBRATION_LensDistortionModelBrownConrady", "ModelParameterCount": 14,
                    "ModelParameters": [0.50218582153320312, 0.50179535150527954, 0.49281969666481018,
                        0.49292713403701782, 0.58251643180847168, 0.0061361165717244148, -0.0013186802389100194,
                        0.92561346292495728, 0.12568977475166321, -0.0065302476286888123, 0, 0,
                        -2.0833556845900603e-05, -0.00012877916742581874]}}]}}"#;

const OPENCV: &str = "%YAML:1.0
---
calibration_time: \"any: day\"
image_width: 640
image_height: 576
flags: 16384
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.0464736938476562e+02, 0., 321.73828125, 0.,
       5.0475738525390625e+02, 333.33843994140625, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 8
   dt: d
   data: [ 0.58251643180847168, 0.0061361165717244148, -0.00012877916742581874,
       -2.0833556845900603e-05, -0.0013186802389100194, 0.92561346292495728,
       0.12568977475166321, -0.0065302476286888123 ]
avg_reprojection_error: 0.2
";

fn import(name: &str, text: &str, mode: DepthMode) -> Result<CameraSpec, CameraError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    CameraSpec::import(&path, mode)
}

/// Checks that both describe one camera at points all over its field.
fn same_camera(a: &CameraSpec, b: &CameraSpec) {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let [a, b] = [a, b].map(|spec| Camera::try_from(spec.clone()).unwrap());
    for (x, y) in [(0.0, 0.0), (500.0, -100.0), (-550.0, 500.0), (20.0, -620.0)] {
        let pixel = |camera: &Camera| camera.project(&Point3::new(x, y, 1000.0)).unwrap();
        assert!((pixel(&a) - pixel(&b)).norm() < 1e-6, "at {x}, {y}");
    }
}

#[test]
fn device_orbbec_and_opencv_files_tell_the_same_camera() {
    let ours = CameraSpec::azure_kinect(DepthMode::NfovUnbinned);
    let device = import("raw.json", DEVICE, DepthMode::NfovUnbinned).unwrap();
    assert_eq!(device.metric_radius, ours.metric_radius);
    // The SDK writes the calibration with its final NUL.
    let terminated = format!("{DEVICE}\0");
    let same = import("raw.json", &terminated, DepthMode::NfovUnbinned).unwrap();
    assert_eq!(same, device);
    same_camera(&device, &ours);
    let opencv = import("camera.yml", OPENCV, DepthMode::WfovBinned).unwrap();
    assert_eq!(opencv.metric_radius, None);
    same_camera(&opencv, &ours);
    let ros = OPENCV.replace("flags: 16384", "distortion_model: rational_polynomial");
    same_camera(
        &import("ros.yaml", &ros, DepthMode::NfovBinned).unwrap(),
        &ours,
    );
    let CameraSpec { fx, fy, cx, cy, .. } = ours;
    let CameraSpec { k1, k2, k3, k4, .. } = ours;
    let CameraSpec { k5, k6, p1, p2, .. } = ours;
    let orbbec = serde_json::json!({
        "depthIntrinsic": {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "width": 640, "height": 576},
        "depthDistortion": {"k1": k1, "k2": k2, "k3": k3, "k4": k4, "k5": k5, "k6": k6, "p1": p1, "p2": p2, "model": 4},
        "rgbIntrinsic": {},
    });
    let orbbec = import("orbbec.json", &orbbec.to_string(), DepthMode::NfovBinned).unwrap();
    same_camera(&orbbec, &ours);
    let plain = serde_json::to_string(&ours).unwrap();
    assert_eq!(
        import("ours.json", &plain, DepthMode::NfovBinned).unwrap(),
        ours
    );
}

/// 2 x 2 pixels in one halve the distance from the border of the first pixel; the wide modes show the whole sensor.
#[test]
fn modes_are_windows_of_one_sensor() {
    let at = |mode| {
        let spec = import("raw.json", DEVICE, mode).unwrap();
        same_camera(&spec, &CameraSpec::azure_kinect(mode));
        let camera = Camera::try_from(spec).unwrap();
        camera.project(&Point3::new(300.0, -200.0, 900.0)).unwrap()
    };
    let border = |pixel: Point2<f64>| pixel + nalgebra::Vector2::new(0.5, 0.5);
    let full = border(at(DepthMode::WfovUnbinned));
    let shifted = full - nalgebra::Vector2::new(192.0, 180.0);
    assert!((border(at(DepthMode::NfovUnbinned)) - shifted).norm() < 1e-4);
    assert!((border(at(DepthMode::NfovBinned)) - shifted / 2.0).norm() < 1e-4);
    assert!((border(at(DepthMode::WfovBinned)) - full / 2.0).norm() < 1e-4);
}

#[test]
fn a_mask_leaves_pixels_without_a_ray() {
    let share = |mode: DepthMode| {
        let mut spec = CameraSpec::azure_kinect(mode);
        let count = |spec: &CameraSpec| {
            let camera = Camera::try_from(spec.clone()).unwrap();
            camera.rays().iter().filter(|ray| ray.is_some()).count() as f64
        };
        let all = count(&spec);
        spec.mask = Some(mode.mask());
        count(&spec) / all
    };
    // The hexagon cuts two triangles of a quarter of the width each side off a rectangle, a little of which the image
    // does not hold; the metric radius already leaves the wide image round.
    assert!((0.72..0.80).contains(&share(DepthMode::NfovBinned)));
    assert!((0.9..1.0).contains(&share(DepthMode::WfovBinned)));
    let text = r#"{"model": "pinhole", "width": 4, "height": 4, "fx": 4, "fy": 4, "cx": 2, "cy": 2,
                   "mask": {"circle": {"diameter_deg": 200}}}"#;
    let spec: CameraSpec = serde_json::from_str(text).unwrap();
    assert!(matches!(
        Camera::try_from(spec),
        Err(CameraError::Mask { found: 200.0, .. })
    ));
}

#[test]
fn the_early_variant_and_a_radius_that_was_never_measured() {
    let early = DEVICE
        .replace("ModelBrownConrady", "ModelRational6KT")
        .replace("1.737323045730591", "0");
    let spec = import("raw.json", &early, DepthMode::NfovUnbinned).unwrap();
    assert_eq!(
        (spec.model, spec.metric_radius),
        (CameraModel::Rational6Kt, Some(1.7))
    );
}

#[test]
fn files_that_are_no_depth_camera_say_why() {
    let message = |name: &str, text: &str| {
        let error = import(name, text, DepthMode::NfovUnbinned).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
        match error {
            CameraError::Calibration { message, .. } => message,
            other => std::error::Error::source(&other).unwrap().to_string(),
        }
    };
    let cases = [
        (
            "raw.json",
            DEVICE.replace("PurposeDepth", "PurposeOther"),
            "Purpose",
        ),
        (
            "raw.json",
            DEVICE.replace("ModelBrownConrady", "ModelTheta"),
            "Theta",
        ),
        (
            "raw.json",
            DEVICE.replace(", 0, 0,\n", ", 0.1, 0,\n"),
            "centre of distortion",
        ),
        (
            "raw.json",
            DEVICE.replace("0.50218582153320312, ", ""),
            "13 ModelParameters",
        ),
        (
            "camera.json",
            "{\"model\": \"fisheye\"}".to_owned(),
            "fisheye",
        ),
        (
            "orbbec.json",
            "{\"depth_intrinsic\": {}}".to_owned(),
            "missing field",
        ),
        (
            "a.yaml",
            OPENCV.replace("camera_matrix", "matrix"),
            "camera_matrix",
        ),
        (
            "a.yaml",
            OPENCV.replace("image_height: 576", "image_height: tall"),
            "tall",
        ),
        ("a.yaml", OPENCV.replace("321.73828125", "wide"), "wide"),
        (
            "a.yaml",
            OPENCV.replace("flags: 16384", "distortion_model: equidistant"),
            "equidistant",
        ),
        (
            "orbbec.json",
            r#"{"depth_intrinsic": {"fx": 500, "fy": 500, "cx": 320, "cy": 288, "width": 640, "height": 576},
                "depth_distortion": {"k1": 0, "k2": 0, "k3": 0, "k4": 0, "k5": 0, "k6": 0, "p1": 0, "p2": 0, "model": 5}}"#
                .to_owned(),
            "distortion model is 5",
        ),
        (
            "a.yaml",
            OPENCV.replace("-2.0833556845900603e-05, ", ""),
            "7 distortion coefficients",
        ),
    ];
    for (name, text, expected) in cases {
        let message = message(name, &text);
        assert!(message.contains(expected), "{message} lacks {expected}");
    }
}
