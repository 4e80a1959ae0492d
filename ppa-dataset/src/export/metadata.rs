//! Facts about a dataset that its author has to provide for the metadata.

use std::collections::BTreeSet;

use serde::Deserialize;

/// Facts about a dataset that a program cannot determine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Metadata {
    /// Its name.
    pub name: String,
    /// URL of its licence, such as `https://creativecommons.org/licenses/by/4.0/`.
    pub license: String,
    /// Day of publication, such as `2026-11-21`.
    pub date: String,
}

impl Metadata {
    /// Checks that search engines and archives accept the values; the error says what is wrong.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.name.trim().is_empty() {
            return Err("the name is empty".to_owned());
        }
        let address = ["https://", "http://"]
            .into_iter()
            .find_map(|scheme| self.license.strip_prefix(scheme));
        if address.is_none_or(|rest| rest.is_empty() || rest.contains(char::is_whitespace)) {
            return Err(format!(
                "the licence is {:?}, expected its URL, https://…",
                self.license
            ));
        }
        if !is_day(&self.date) {
            return Err(format!(
                "the date is {:?}, expected a day as YYYY-MM-DD",
                self.date
            ));
        }
        Ok(())
    }
}

/// Whether a text is a day of the Gregorian calendar such as `2026-11-21`.
fn is_day(text: &str) -> bool {
    let number = |part: &str, digits: usize| -> Option<u32> {
        let plain = part.len() == digits && part.bytes().all(|byte| byte.is_ascii_digit());
        plain.then(|| part.parse().ok())?
    };
    let [year, month, day] = text.split('-').collect::<Vec<_>>()[..] else {
        return false;
    };
    let (Some(year), Some(month), Some(day)) = (number(year, 4), number(month, 2), number(day, 2))
    else {
        return false;
    };
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let days = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    (1..=days).contains(&day)
}

/// Provenance of the images from `dataset.json`.
#[derive(Deserialize)]
pub(super) struct Provenance {
    pub settings: Generator,
    pub limbs: Vec<Scan>,
}

#[derive(Deserialize)]
pub(super) struct Generator {
    /// Program and version.
    pub generator: String,
    /// Hash of its sources.
    pub code: String,
}

#[derive(Deserialize)]
pub(super) struct Scan {
    pub patient: u32,
    pub side: String,
    pub volume_sha256: String,
}

impl Provenance {
    /// Hashes of the scans, each once.
    pub fn scans(&self) -> BTreeSet<&str> {
        self.limbs
            .iter()
            .map(|limb| limb.volume_sha256.as_str())
            .collect()
    }
}

/// Description of every dataset in both formats.
pub(super) const DESCRIPTION: &str = "Depth images that two Time-of-Flight cameras on an x-ray device would see of a limb lying \
    on the table, and the radiograph of the same pose, simulated from computed tomography for many rotations of the limb and several body shapes. \
    Depth images: 16-bit PNG, Z in mm, 0 invalid. Radiographs: 16-bit PNG for viewing, EXR with tallies in eV/cm2 per history.";

/// The paper that describes the method.
pub(super) const PAPER: &str = "https://doi.org/10.59275/j.melba.2026-c874";

/// The table described by the metadata.
pub(super) const TABLE: &str = "manifest.csv";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_days_of_the_calendar_and_addresses_are_taken() {
        for day in ["2026-11-21", "2024-02-29", "2000-02-29", "0001-12-31"] {
            assert!(is_day(day), "{day}");
        }
        for other in [
            "2026-02-29",
            "1900-02-29",
            "2026-04-31",
            "2026-00-01",
            "2026-13-01",
            "2026-01-00",
            "+026-01-01",
            "2026-+1-+1",
            "2026-1-1",
            "2026-11",
            "2026-11-21-",
            "21.11.2026",
        ] {
            assert!(!is_day(other), "{other}");
        }
        let metadata = |name: &str, license: &str| Metadata {
            name: name.to_owned(),
            license: license.to_owned(),
            date: "2026-11-21".to_owned(),
        };
        let by = "https://creativecommons.org/licenses/by/4.0/";
        assert_eq!(metadata("ankles", by).check(), Ok(()));
        for (name, license, expected) in [
            (" ", by, "the name is empty"),
            ("ankles", "CC-BY", "the licence is \"CC-BY\""),
            ("ankles", "./", "the licence is"),
            ("ankles", "https://", "the licence is"),
        ] {
            let said = metadata(name, license).check().unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
    }
}
