//! A DICOM file of any kind: elements, geometry and pixels.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::with_file("scan.dcm", data, |path| {
        let _ = ppa_ct::read_with(path, &ppa_fuzz::forced());
    });
});
