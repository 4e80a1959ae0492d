//! Text files of every kind: target, name, kind if the target takes several, and content.

/// A calibration as stored in an Azure Kinect, with numbers from the tests of its public software.
const DEVICE: &str = r#"{"CalibrationInformation": {"Cameras": [
    {"Purpose": "CALIBRATION_CameraPurposeDepth", "MetricRadius": 1.737323045730591, "SensorWidth": 1024,
     "Intrinsics": {"ModelType": "CALIBRATION_LensDistortionModelBrownConrady", "ModelParameterCount": 14,
                    "ModelParameters": [0.502, 0.501, 0.492, 0.493, 0.58, 0.006, -0.0013, 0.92, 0.12, -0.0065, 0, 0, -2e-5, -1e-4]}}]}}"#;

const OPENCV: &str = "%YAML:1.0
---
image_width: 640
image_height: 576
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 504.6, 0., 321.7, 0., 504.7, 333.3, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 8
   dt: d
   data: [ 0.58, 0.006, -1e-4, -2e-5, -0.0013, 0.92, 0.12, -0.0065 ]
";

const CASE: &str = r#"version = 1
side = "r"
[source]
path = "scan.nii"
volume_sha256 = "00"
[surface]
[choices]
"#;

const PLAN: &str = r#"version = 1
seed = 1
[[case]]
file = "leg.case.toml"
patient = 0
[rotation]
from_deg = 0.0
to_deg = 10.0
step_deg = 2.5
[depth.sensor]
random = { floor_mm = 0, at_unit_signal_mm = 1.14 }
invalid = { min_signal = 0.067, max_angle_deg = 85, min_contrast = 0.9 }
[xray]
detector = { columns = 50, rows = 50, pixel_mm = 4.0 }
[xray.source]
collimation = { rectangle = { size_mm = [180, 220] } }
[xray.receptor]
grid = { ratio = 8, lines_per_cm = 40, focus_mm = 1100 }
"#;

const INPUT: &str = "#[SECTION SIMULATION CONFIG v.2009-05-12]\n2e5\n1\n0\n128\n150\n\
    #[SECTION SOURCE v.2011-07-12]\nbeam.spc\n2 -50 2\n0 1 0\n-1 -1\n\
    #[SECTION IMAGE DETECTOR v.2009-12-02]\nimage.dat\n10 10\n10 10\n60\n\
    #[SECTION CT SCAN TRAJECTORY v.2011-10-25]\n2\n90\n0 720\n52\n0\n\
    #[SECTION DOSE DEPOSITION v.2012-12-12]\nYES\nYES\ndose.dat\n1 4\n1 4\n1 4\n\
    #[SECTION VOXELIZED GEOMETRY FILE v.2009-11-30]\nbox.vox\n\
    #[SECTION MATERIAL FILE LIST v.2009-11-30]\nppa:water\n";

const VOXELS: &str = "[SECTION VOXELS HEADER v.2008-04-13]\n2 1 1\n1 1 1\n1\n2\n0\n[END OF VXH SECTION]\n1 1.0\n2 0.5\n";

const LABELS: &str = r#"{"0": {"label": 1.5, "label_std": 0.2, "label_source": "readers"}}"#;
const REGIONS: &str = r#"{"depth_cam_left_0.0.png": {"camera": "cam_left", "image_number": 0, "x_start": 1, "y_start": 2, "size": 3}}"#;
const SPLIT: &str = r#"{"version": 1, "seed": 1, "parts": {"train": [0, 1], "test": [2]}}"#;

pub const TEXTS: &[(&str, &str, Option<u8>, &str)] = &[
    ("camera", "device.json", Some(0), DEVICE),
    ("camera", "opencv.yml", Some(1), OPENCV),
    ("case", "case.toml", None, CASE),
    ("plan", "plan.toml", None, PLAN),
    (
        "room",
        "room.toml",
        None,
        "version = 1\n[room.parametric]\ntable_width_mm = 700.0\n",
    ),
    ("dataset", "labels.json", Some(1), LABELS),
    ("dataset", "roi_depth.json", Some(2), REGIONS),
    ("dataset", "split.json", Some(3), SPLIT),
    (
        "grades",
        "grades.csv",
        None,
        "image,reader,grade\nx.png,Anna,1.5\n",
    ),
    ("grades", "key.csv", None, "name,image,sha256\na,x.png,00\n"),
    (
        "spectrum",
        "spectrum.csv",
        None,
        "energy_kev,weight\n20,1\n30,2\n40,0.5\n",
    ),
    ("spectrum", "beam.spc", None, "20e3 1\n30e3 2\n40e3 -1\n"),
    ("spectrum", "filter", None, "Al:2.5"),
    (
        "calibration",
        "calibration.toml",
        None,
        include_str!("../../../ppa-xray/data/hu_calibration.toml"),
    ),
    ("calibration", "composition", None, "H:0.112 O:0.888"),
    ("mcgpu", "run.in", Some(0), INPUT),
    ("mcgpu", "phantom.vox", Some(2), VOXELS),
    ("tally", "start", None, "ppaTally"),
    ("words", "shard", None, "2/7"),
    ("words", "series", None, "1.2.3"),
];
