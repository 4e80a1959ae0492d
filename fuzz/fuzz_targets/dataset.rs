//! The lists of a dataset: the first byte selects one of them.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    ppa_fuzz::read_dataset(*kind, data);
});
