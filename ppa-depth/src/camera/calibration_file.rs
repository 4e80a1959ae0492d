//! Cameras from the calibration files of devices: Azure Kinect, Orbbec, OpenCV.

use std::path::Path;

use serde::Deserialize;

use crate::camera::depth_mode::DepthMode;
use crate::camera::opencv_yaml;
use crate::camera::spec::{CameraError, CameraModel, CameraSpec};

/// The calibration that an Azure Kinect keeps, in units of the sensor's side: `k4a_device_get_raw_calibration`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct DeviceCalibration {
    calibration_information: CalibrationInformation,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct CalibrationInformation {
    cameras: Vec<DeviceCamera>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct DeviceCamera {
    purpose: String,
    intrinsics: DeviceIntrinsics,
    #[serde(default)]
    metric_radius: f64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct DeviceIntrinsics {
    model_type: String,
    model_parameters: Vec<f64>,
}

/// Depth part of an Orbbec `OBCameraParam`, in pixels, with the names of either language binding.
#[derive(Debug, Deserialize)]
struct OrbbecParam {
    #[serde(alias = "depthIntrinsic")]
    depth_intrinsic: OrbbecIntrinsic,
    #[serde(alias = "depthDistortion")]
    depth_distortion: OrbbecDistortion,
}

#[derive(Debug, Deserialize)]
struct OrbbecIntrinsic {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
}

#[derive(Debug, Deserialize)]
struct OrbbecDistortion {
    k1: f64,
    k2: f64,
    k3: f64,
    k4: f64,
    k5: f64,
    k6: f64,
    p1: f64,
    p2: f64,
    /// `OBCameraDistortionModel`, as a number or a name; older bindings leave it out.
    #[serde(default)]
    model: Option<serde_json::Value>,
}

/// Names of the supported Orbbec models: with three and with six radial coefficients.
const ORBBEC_MODELS: &[&str] = &[
    "OB_DISTORTION_BROWN_CONRADY",
    "OB_DISTORTION_BROWN_CONRADY_K6",
];

/// Value for a metric radius that the factory could not determine (public Azure Kinect Sensor SDK, `calibration.c`).
const DEFAULT_METRIC_RADIUS: f64 = 1.7;

impl CameraSpec {
    /// Reads the description of a depth camera from a camera JSON of ours, the raw calibration JSON of an Azure Kinect or of
    /// an Orbbec camera that emulates one, an Orbbec `OBCameraParam` as JSON (`depth_intrinsic`, `depth_distortion`), or an
    /// OpenCV file storage in YAML (`.yml`, `.yaml`).
    ///
    /// The Orbbec reader follows the field names of the public SDK and assumes a `brown_conrady` lens; no file from a device was available.
    /// Compare a few pixels with the SDK before trusting it.
    ///
    /// Only the raw calibration depends on the `mode`: it holds for the whole sensor. The numbers are checked by
    /// `Camera::try_from`.
    ///
    /// # Errors
    /// [`CameraError`] names the file and what is missing in it.
    pub fn import(path: &Path, mode: DepthMode) -> Result<Self, CameraError> {
        let text =
            ppa_core::regular_file::read_to_string(path).map_err(|source| CameraError::Read {
                path: path.into(),
                source,
            })?;
        let yaml = path
            .extension()
            .is_some_and(|ext| ext.eq_ignore_ascii_case("yml") || ext.eq_ignore_ascii_case("yaml"));
        let refused = |message| CameraError::Calibration {
            path: path.into(),
            message,
        };
        if yaml {
            return opencv_yaml::camera(&text).map_err(refused);
        }
        let bad_json = |source| CameraError::Json {
            path: path.into(),
            source,
        };
        // The SDK's raw calibration ends with a NUL.
        let text = text.trim_end_matches('\0');
        let value: serde_json::Value = serde_json::from_str(text).map_err(bad_json)?;
        if value.get("CalibrationInformation").is_some() {
            let found: DeviceCalibration = serde_json::from_value(value).map_err(bad_json)?;
            found.camera(mode).map_err(refused)
        } else if value.get("depth_intrinsic").is_some() || value.get("depthIntrinsic").is_some() {
            let found: OrbbecParam = serde_json::from_value(value).map_err(bad_json)?;
            found.camera().map_err(refused)
        } else {
            serde_json::from_value(value).map_err(bad_json)
        }
    }
}

impl DeviceCalibration {
    fn camera(&self, mode: DepthMode) -> Result<CameraSpec, String> {
        let cameras = &self.calibration_information.cameras;
        let depth = cameras
            .iter()
            .find(|camera| camera.purpose == "CALIBRATION_CameraPurposeDepth")
            .ok_or("none of its cameras has the Purpose CALIBRATION_CameraPurposeDepth")?;
        let model = match depth.intrinsics.model_type.as_str() {
            "CALIBRATION_LensDistortionModelBrownConrady" => CameraModel::BrownConrady,
            "CALIBRATION_LensDistortionModelRational6KT" => CameraModel::Rational6Kt,
            other => {
                return Err(format!(
                    "its ModelType is {other}, expected CALIBRATION_LensDistortionModelBrownConrady or …Rational6KT"
                ));
            }
        };
        let parameters = &depth.intrinsics.model_parameters;
        let &[
            cx,
            cy,
            fx,
            fy,
            k1,
            k2,
            k3,
            k4,
            k5,
            k6,
            codx,
            cody,
            p2,
            p1,
            ..,
        ] = parameters.as_slice()
        else {
            return Err(format!(
                "it has {} ModelParameters, expected 14",
                parameters.len()
            ));
        };
        if codx != 0.0 || cody != 0.0 {
            return Err(format!(
                "its centre of distortion is ({codx}, {cody}), expected (0, 0)"
            ));
        }
        let window = mode.window();
        // Unit scale has pixel borders at whole numbers; here pixel (0, 0) is a centre.
        let centre = |unit: f64, crop: f64| unit * window.sensor - crop - 0.5;
        let camera = CameraSpec::brown_conrady(
            window.size,
            [
                fx * window.sensor,
                fy * window.sensor,
                centre(cx, window.crop[0]),
                centre(cy, window.crop[1]),
            ],
            [k1, k2, k3, k4, k5, k6],
            [p1, p2],
        );
        Ok(CameraSpec {
            model,
            metric_radius: Some(if depth.metric_radius <= 1e-4 {
                DEFAULT_METRIC_RADIUS
            } else {
                depth.metric_radius
            }),
            ..camera
        })
    }
}

impl OrbbecParam {
    fn camera(&self) -> Result<CameraSpec, String> {
        let model = self.depth_distortion.model.as_ref();
        let known = |model: &serde_json::Value| match model {
            serde_json::Value::String(name) => ORBBEC_MODELS.contains(&name.as_str()),
            number => number == 3 || number == 4,
        };
        if let Some(model) = model.filter(|model| !known(model)) {
            return Err(format!(
                "its distortion model is {model}, expected 3 or 4 (Brown-Conrady)"
            ));
        }
        let (intrinsic, lens) = (&self.depth_intrinsic, &self.depth_distortion);
        Ok(CameraSpec::brown_conrady(
            [intrinsic.width, intrinsic.height],
            [intrinsic.fx, intrinsic.fy, intrinsic.cx, intrinsic.cy],
            [lens.k1, lens.k2, lens.k3, lens.k4, lens.k5, lens.k6],
            [lens.p1, lens.p2],
        ))
    }
}
