//! An NRRD file with its voxels.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::with_file("scan.nrrd", data, |path| {
        let _ = ppa_ct::read(path);
    });
});
