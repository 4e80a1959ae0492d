//! The page: its sections and their order.

use std::path::Path;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use ppa_core::text::{count, error_chain, numbers};
use ppa_dataset::findings::{Findings, Severity};
use ppa_dataset::manifest::Manifest;
use ppa_dataset::published::{Flaw, Published, inspect};
use ppa_dataset::split::Split;

use super::error::QaError;
use super::findings;
use super::limb::{LimbPart, limb_part};
use super::scene::Scene;
use super::verdict::Tally;

/// Writes the quality report of the finished dataset in `root` as one HTML page without external addresses: verdict, findings, checks of
/// all files, contact sheets, regions and joints in whole images, labels against angle, depths, heights and tilts with outliers, origin.
///
/// # Errors
/// [`QaError`] naming the file at fault. Flaws of single images are listed on the page, with a cross in place of the image.
pub fn qa_page(root: &Path) -> Result<String, QaError> {
    let manifest = Manifest::read(root)?;
    let inspection = inspect(root)?;
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
    let mut limbs = Vec::new();
    for limb in manifest.limbs() {
        let LimbPart {
            html,
            outliers,
            is_empty,
        } = limb_part(root, &manifest, &dataset, &scene, limb)?;
        tally.outliers += outliers;
        tally.empty_limbs += usize::from(is_empty);
        limbs.push(html);
    }
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "Quality report of a dataset" }
                style { (PreEscaped(include_str!("../page.css"))) }
            }
            body {
                main {
                    h1 { "Dataset of " (count(inspection.patients, "person")) }
                    p {
                        (count(inspection.limbs, "limb")) ", " (count(inspection.pairs, "image pair")) ", "
                        (count(inspection.depth_images, "depth image")) ", "
                        (count(inspection.radiographs, "radiograph")) ", "
                        (count(inspection.labelled, "pair")) " with a label."
                    }
                    (tally.html())
                    (findings::table(&findings))
                    (checks(root, &inspection.flaws))
                    (splits(root, &dataset.patients())?)
                    @for limb in limbs { (limb) }
                    (provenance(&scene))
                }
            }
        }
    };
    Ok(page.into_string())
}

fn checks(root: &Path, flaws: &[Flaw]) -> Markup {
    const SHOWN: usize = 50;
    html! {
        @if flaws.is_empty() {
            p { "Every image could be decoded and matches manifest.jsonl; no region reaches beyond its image." }
        } @else {
            div class="bad" {
                p {
                    (count(flaws.len(), "flaw"))
                    @if flaws.len() > SHOWN { ", the first " (SHOWN) }
                    ":"
                }
                ul { @for flaw in flaws.iter().take(SHOWN) { li { (without_folder(flaw, root)) } } }
            }
        }
    }
}

/// An error with its causes, without the dataset's folder, because the page may be passed on.
fn without_folder(error: &dyn std::error::Error, root: &Path) -> String {
    let folder = root.join("").display().to_string();
    error_chain(error).replace(&folder, "")
}

fn splits(root: &Path, patients: &[u32]) -> Result<Markup, QaError> {
    let names = Split::names(root)?;
    let read = |name: &str| {
        let split = Split::read(&Split::path(root, name))?;
        split.check(patients).map(|()| split)
    };
    Ok(html! {
        @if names.is_empty() {
            p { "No split yet." }
        } @else {
            h2 { "Splits by person" }
            table {
                @for name in &names {
                    @match read(name) {
                        Err(error) => tr class="bad" { td { (name) } td { (without_folder(&error, root)) } },
                        Ok(split) => tr {
                            td { (name) }
                            td {
                                @for (at, (part, of)) in split.parts.iter().enumerate() {
                                    @if at > 0 { "; " }
                                    (part) ": " (numbers(of.iter().copied()))
                                }
                            }
                        },
                    }
                }
            }
        }
    })
}

fn provenance(scene: &Scene) -> Markup {
    html! {
        h2 { "Origin" }
        p {
            "Made by " (scene.generator) " from sources " code { (scene.code) } " with seed " (scene.seed)
            ". All settings are in dataset.json, the pose and hash of every image in manifest.jsonl."
        }
        table {
            tr { th { "limb" } th { "SHA-256 of the scan's voxels" } }
            @for limb in &scene.limbs {
                tr { td { "patient " (limb.patient) " " (limb.side) } td { code { (limb.volume_sha256) } } }
            }
        }
    }
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
