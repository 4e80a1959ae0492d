//! A calibration from HU to materials, and a composition.

#![no_main]

use libfuzzer_sys::fuzz_target;
use ppa_xray::{HuCalibration, Material};

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data) {
        let _ = HuCalibration::parse(text);
        let _ = Material::parse_composition("fuzzed", 1.0, text);
    }
});
