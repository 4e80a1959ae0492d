//! A frame packed with JPEG: baseline, extended or lossless.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::read_frame("1.2.840.10008.1.2.4.70", data);
});
