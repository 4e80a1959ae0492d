//! A NIfTI file, plain or gzip.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::with_file("scan.nii", data, |path| {
        let _ = ppa_ct::read(path);
    });
});
