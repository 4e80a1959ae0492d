//! What readers hand in, and the key of their pictures.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    ppa_fuzz::with_file("grades.csv", data, |path| {
        let _ = ppa_dataset::labels::read_key(path);
        let nothing = ppa_dataset::Manifest::default();
        let _ = ppa_dataset::labels::import_grades(&nothing, &[], &[path.to_owned()]);
    });
});
