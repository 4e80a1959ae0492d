//! The page: its sections and their order.

use std::path::{Path, PathBuf};

use ppa_core::text::{count, error_chain, numbers};
use ppa_dataset::files::FileError;
use ppa_dataset::findings::{Findings, Severity};
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::Manifest;
use ppa_dataset::published::{Flaw, Published, PublishedError, inspect};
use ppa_dataset::split::{Split, SplitError};

use super::findings;
use super::limb::{LimbPart, limb_part};
use super::scene::Scene;
use super::verdict::Tally;
use crate::contact_sheet::ContactSheetError;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum QaError {
    /// The list of images that the page follows is missing.
    #[error(
        "{} has no manifest.jsonl, which the page needs: `ppa generate` and `ppa merge` write it once all poses are made, \
         datasets of other programs have none",
        .0.display()
    )]
    NoManifest(PathBuf),
    /// A file of the dataset.
    #[error(transparent)]
    File(#[from] FileError),
    /// Its layout or lists.
    #[error(transparent)]
    Published(#[from] PublishedError),
    /// One of its splits.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// Its contact sheets.
    #[error(transparent)]
    ContactSheet(#[from] ContactSheetError),
}

/// The dataset in `root`, which `ppa generate` finished, as one page of HTML without any address outside of it: verdict, findings, checks of all
/// files, contact sheets, regions and joints in whole images, labels against angle, depths, heights and tilts with outliers, origin.
///
/// # Errors
/// [`QaError`] naming the file at fault. Flaws of single images stand on the page, and a cross in their place.
pub fn qa_page(root: &Path) -> Result<String, QaError> {
    if root.is_dir() && !root.join(Manifest::FILE).exists() {
        return Err(QaError::NoManifest(root.to_owned()));
    }
    let inspection = inspect(root)?;
    let manifest = Manifest::read(root)?;
    let dataset = Published::list(root)?;
    let scene = Scene::read(root)?;
    let findings = Findings::read(root)?;
    let severe = findings
        .0
        .iter()
        .filter(|finding| finding.is_open())
        .count();
    let doubts = findings.0.iter();
    let doubts = doubts
        .filter(|finding| finding.finding.severity > Severity::Note)
        .count();
    let mut tally = Tally {
        flaws: inspection.flaws.len(),
        severe,
        other_findings: doubts - severe,
        ..Tally::default()
    };
    let mut limbs = String::new();
    for limb in manifest.limbs() {
        let LimbPart {
            html,
            outliers,
            is_empty,
        } = limb_part(root, &manifest, &dataset, &scene, limb)?;
        tally.outliers += outliers;
        tally.empty_limbs += usize::from(is_empty);
        limbs += &html;
    }
    let head = format!(
        "<h1>Dataset of {}</h1><p>{}, {}, {}, {}, {} with a label.</p>",
        count(inspection.patients, "person"),
        count(inspection.limbs, "limb"),
        count(inspection.pairs, "image pair"),
        count(inspection.depth_images, "depth image"),
        count(inspection.radiographs, "radiograph"),
        count(inspection.labelled, "pair")
    );
    let parts = [
        HEAD.to_owned(),
        head,
        tally.html(),
        findings::table(&findings),
        checks(root, &inspection.flaws),
        splits(root, &dataset.patients())?,
        limbs,
        provenance(&scene),
        "</main></body></html>\n".to_owned(),
    ];
    Ok(parts.concat())
}

const HEAD: &str = concat!(
    "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">",
    "<title>Quality report of a dataset</title><style>",
    include_str!("page.css"),
    "</style></head><body><main>"
);

fn checks(root: &Path, flaws: &[Flaw]) -> String {
    const TOLD: usize = 50;
    if flaws.is_empty() {
        return "<p>Every image could be decoded and is as in manifest.jsonl; no region reaches beyond its image.</p>".to_owned();
    }
    let report = flaws.iter().take(TOLD);
    let report = report.map(|flaw| format!("<li>{}</li>", escaped(&without_folder(flaw, root))));
    format!(
        "<div class=\"bad\"><p>{}{}:</p><ul>{}</ul></div>",
        count(flaws.len(), "flaw"),
        match flaws.len() > TOLD {
            true => format!(", the first {TOLD}"),
            false => String::new(),
        },
        report.collect::<String>()
    )
}

/// An error with its causes. The page may be passed on: where the dataset lay is nobody's business.
fn without_folder(error: &dyn std::error::Error, root: &Path) -> String {
    let folder = root.join("").display().to_string();
    error_chain(error).replace(&folder, "")
}

fn splits(root: &Path, patients: &[u32]) -> Result<String, QaError> {
    let mut rows = String::new();
    for name in Split::names(root)? {
        let read = Split::read(&Split::path(root, &name))
            .and_then(|split| split.check(patients).map(|()| split));
        rows += &match read {
            Err(error) => format!(
                "<tr class=\"bad\"><td>{}</td><td>{}</td></tr>",
                escaped(&name),
                escaped(&without_folder(&error, root))
            ),
            Ok(split) => {
                let parts = split.parts.iter().map(|(part, of)| {
                    format!("{}: {}", escaped(part), numbers(of.iter().copied()))
                });
                format!(
                    "<tr><td>{}</td><td>{}</td></tr>",
                    escaped(&name),
                    parts.collect::<Vec<_>>().join("; ")
                )
            }
        };
    }
    if rows.is_empty() {
        return Ok("<p>No split yet.</p>".to_owned());
    }
    Ok(format!("<h2>Splits by person</h2><table>{rows}</table>"))
}

pub(super) fn side(limb: LimbId) -> &'static str {
    if limb.side_letter() == "l" {
        "left"
    } else {
        "right"
    }
}

pub(super) fn figure(caption: &str, content: String) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<figure>{content}<figcaption>{caption}</figcaption></figure>")
}

fn provenance(scene: &Scene) -> String {
    let scans = scene.limbs.iter().map(|limb| {
        let name = format!("patient {} {}", limb.patient, escaped(&limb.side));
        format!(
            "<tr><td>{name}</td><td><code>{}</code></td></tr>",
            escaped(&limb.volume_sha256)
        )
    });
    format!(
        "<h2>Origin</h2><p>Made by {} from sources <code>{}</code> with seed {}. All settings stand in dataset.json, pose and \
         hash of every image in manifest.jsonl.</p><table><tr><th>limb</th><th>SHA-256 of the scan's voxels</th></tr>{}</table>",
        escaped(&scene.generator),
        escaped(&scene.code),
        scene.seed,
        scans.collect::<String>()
    )
}

pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_a_dataset_lay_is_not_told() {
        for root in ["/home/name/data", "/home/name/data/"] {
            let path = Path::new(root).join("splits/x.json");
            let error = ppa_dataset::files::read_text(&path).unwrap_err();
            let report = without_folder(&error, Path::new(root));
            assert!(
                report.contains("splits/x.json") && !report.contains("name"),
                "{report}"
            );
        }
    }
}
