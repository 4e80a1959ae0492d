//! The verdict at the top of the page.

use maud::{Markup, html};
use ppa_core::text::count;

/// Counts of what was found in a dataset.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    /// Damaged or missing images and lists.
    pub flaws: usize,
    /// Severe findings that nobody acknowledged.
    pub severe: usize,
    /// Severe findings that were acknowledged, and cautions; notes are not counted.
    pub other_findings: usize,
    /// Poses that are outliers relative to their neighbours.
    pub outliers: usize,
    /// Limbs without depth images.
    pub empty_limbs: usize,
}

impl Tally {
    /// One bar: red if the dataset should not be used as it is, yellow if something should be checked, otherwise green.
    pub fn html(&self) -> Markup {
        let list = |counts: &[(usize, &str, &str)]| {
            let there = counts.iter().filter(|(n, ..)| *n > 0);
            let texts: Vec<_> = there
                .map(|(n, what, place)| count(*n, what) + place)
                .collect();
            texts.join(", ")
        };
        let bad = list(&[
            (self.severe, "severe finding", ""),
            (self.flaws, "flaw", " of files"),
            (self.empty_limbs, "limb", " without depth images"),
        ]);
        let doubts = list(&[
            (self.other_findings, "other finding", ""),
            (self.outliers, "outlier", " among the poses"),
        ]);
        let (class, text) = match (bad.is_empty(), doubts.is_empty()) {
            (false, true) => ("bad", format!("Do not use this dataset as it is: {bad}.")),
            (false, false) => (
                "bad",
                format!("Do not use this dataset as it is: {bad}. Also: {doubts}."),
            ),
            (true, false) => ("caution", format!("Check before use: {doubts}.")),
            (true, true) => (
                "good",
                "No severe or cautionary findings, no flaws of files, no outliers among the poses."
                    .to_owned(),
            ),
        };
        html! { p class={ "verdict " (class) } { (text) } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLEAN: Tally = Tally {
        flaws: 0,
        severe: 0,
        other_findings: 0,
        outliers: 0,
        empty_limbs: 0,
    };

    #[test]
    fn only_a_dataset_without_any_finding_gets_a_green_bar() {
        assert!(CLEAN.html().into_string().contains("verdict good"));
        let severe = Tally { severe: 1, ..CLEAN }.html().into_string();
        assert!(
            severe.contains("verdict bad") && severe.contains(": 1 severe finding."),
            "{severe}"
        );
        let flaws = Tally {
            flaws: 2,
            outliers: 1,
            ..CLEAN
        }
        .html()
        .into_string();
        assert!(
            flaws.contains("verdict bad")
                && flaws.contains("2 flaws of files. Also: 1 outlier among"),
            "{flaws}"
        );
        for doubtful in [
            Tally {
                other_findings: 3,
                ..CLEAN
            },
            Tally {
                outliers: 1,
                ..CLEAN
            },
        ] {
            let html = doubtful.html().into_string();
            assert!(html.contains("verdict caution"), "{html}");
        }
    }
}
