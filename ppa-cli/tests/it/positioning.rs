//! Plans whose limbs are tilted or off the central beam.

use std::fs;

use ppa_depth::DepthImage;

use crate::{contains, fail, phantom, succeed, write_plan};

/// With a short piece of limb in the voxels, that piece is in the middle of the image, wherever the beam meets the limb.
#[test]
fn voxels_are_those_around_a_shifted_beam() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let case = phantom().join("p01.toml");
    for along_mm in [0.0, 60.0] {
        let plan = write_plan(folder, "").with_file_name("shifted.toml");
        let text = format!(
            "version = 1\n[[case]]\nfile = {case:?}\npatient = 1\n[positioning]\nbeam_shift_mm = [0, {along_mm}]\n\
             [xray]\nhalf_length_mm = 20\ndetector = {{ columns = 9, rows = 21, pixel_mm = 5.0 }}\n\
             engine = {{ dose_histories = inf, scatter_histories = 100 }}\n"
        );
        fs::write(&plan, text).unwrap();
        succeed(
            folder,
            &format!(
                "xray simulate {} --plan shifted.toml --replace --out x.png",
                case.display()
            ),
        );
        let image = DepthImage::read_png(&folder.join("x.png")).unwrap();
        let row = |y: usize| image.z_mm[9 * y..][..9].iter().sum::<f32>();
        // The unattenuated field is black.
        let [head, middle, feet] = [row(1), row(10), row(19)];
        assert!(
            middle > 1000.0 && head < 0.05 * middle && feet < 0.05 * middle,
            "{along_mm} mm: {head}, {middle}, {feet}"
        );
    }
}

#[test]
fn a_shift_past_the_limb_and_a_wild_tilt_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (positioning, expected) in [
        (
            "beam_shift_mm = [0, 300]",
            "within 20 mm of the central beam",
        ),
        (
            "tilt_deg = 90",
            "positioning.tilt_deg is 90 degrees, expected -45 to 45",
        ),
    ] {
        write_plan(folder, &format!("[positioning]\n{positioning}\n"));
        let message = fail(folder, "generate plan.toml --out data --progress quiet");
        contains(&message, &[expected]);
        assert!(!folder.join("data/patient_3").exists());
    }
}
