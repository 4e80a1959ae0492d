//! Grades returned by readers, and the key of their pictures.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::read_grades(data);
});
