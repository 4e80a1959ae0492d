//! A camera, a rig or a calibration file: the first byte selects which, and the depth mode.

#![no_main]

use libfuzzer_sys::fuzz_target;
use ppa_depth::{Camera, CameraSpec, DepthMode, RigSpec};

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let name = ["camera.json", "camera.yml"][usize::from(kind % 2)];
    ppa_fuzz::with_file(name, data, |path| {
        let mode = match kind / 2 % 4 {
            0 => DepthMode::NfovUnbinned,
            1 => DepthMode::NfovBinned,
            2 => DepthMode::WfovUnbinned,
            _ => DepthMode::WfovBinned,
        };
        let read = [CameraSpec::read(path), CameraSpec::import(path, mode)];
        for camera in read.into_iter().flatten() {
            let _ = Camera::try_from(camera);
        }
        let _ = RigSpec::read(path);
    });
});
