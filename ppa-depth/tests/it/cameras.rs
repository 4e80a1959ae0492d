//! Cameras for tests.

use ppa_depth::{Camera, CameraModel, CameraSpec, DepthMode};

/// The default camera at a quarter of its resolution, which is enough for a test.
pub fn small_kinect() -> Camera {
    let full = CameraSpec::azure_kinect(DepthMode::NfovUnbinned);
    let quarter = |pixels: f64| (pixels + 0.5) / 4.0 - 0.5;
    let (cx, cy) = (quarter(full.cx), quarter(full.cy));
    let spec = CameraSpec {
        width: 160,
        height: 144,
        fx: full.fx / 4.0,
        fy: full.fy / 4.0,
        cx,
        cy,
        ..full
    };
    Camera::try_from(spec).unwrap()
}

/// A camera without distortion that looks along the middle of its image.
pub fn pinhole(width: u32, height: u32, focal: f64) -> Camera {
    let text = format!(
        r#"{{"model": "pinhole", "width": {width}, "height": {height}, "fx": {focal}, "fy": {focal}, "cx": {}, "cy": {}}}"#,
        f64::from(width - 1) / 2.0,
        f64::from(height - 1) / 2.0
    );
    let spec: CameraSpec = serde_json::from_str(&text).unwrap();
    assert_eq!(spec.model, CameraModel::Pinhole);
    Camera::try_from(spec).unwrap()
}
