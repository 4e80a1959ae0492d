//! Values of single arguments: a shard, a series.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data) {
        let _ = text.parse::<ppa_xray::Part>();
        let _ = text.parse::<ppa_ct::SeriesChoice>();
    }
});
