//! A tally.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::with_file("run.tally", data, |path| {
        let _ = ppa_xray::AnalogTally::read(path);
    });
});
