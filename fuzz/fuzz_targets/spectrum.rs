//! A spectrum as CSV or of MC-GPU, and a filter.

#![no_main]

use libfuzzer_sys::fuzz_target;
use ppa_xray::{Filter, Spectrum};

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data) {
        let _ = text.parse::<Filter>();
    }
    ppa_fuzz::with_file("spectrum.csv", data, |path| {
        let _ = Spectrum::from_csv(path);
        let _ = Spectrum::from_spc(path);
    });
});
