//! A plan.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::with_file("plan.toml", data, |path| {
        let _ = ppa_generate::Plan::read(path);
    });
});
