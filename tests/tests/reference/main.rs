//! The reference pages list every key of the files that users write or read, as declared by the types in the sources.
//!
//! The sources are read as text formatted by rustfmt, so no crate needs a feature or a dependency for its documentation.

mod declarations;
mod page;
mod sources;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use declarations::value;
use page::Page;
use sources::{Sources, root};

const REWRITE: &str = "PPA_WRITE_REFERENCE=1 cargo test -p ppa-tests --test reference";

const PAGES: &[Page] = &[
    (
        "plan.md",
        "Keys of plan.toml, room files and camera rigs",
        &[
            ("plan.toml", "ppa-generate/src/plan/mod.rs", "Plan"),
            (
                "room.toml",
                "ppa-generate/src/plan/room_file.rs",
                "RoomFile",
            ),
            (
                "Camera rig (JSON)",
                "ppa-depth/src/camera/rig.rs",
                "RigSpec",
            ),
        ],
    ),
    (
        "case.md",
        "Keys of case.toml",
        &[("case.toml", "ppa-generate/src/case.rs", "Case")],
    ),
    (
        "dataset.md",
        "Keys of the files of a dataset",
        &[
            (
                "dataset.json",
                "ppa-generate/src/description.rs",
                "Description",
            ),
            (
                "manifest.jsonl, one object per line",
                "ppa-dataset/src/manifest.rs",
                "FileRow",
            ),
            (
                "roi_depth.json, by image",
                "ppa-dataset/src/manifest.rs",
                "RoiRow",
            ),
            (
                "labels.json, by image",
                "ppa-dataset/src/labels/file.rs",
                "Entry",
            ),
        ],
    ),
];

/// Fails unless a file contains this text; writes it first if `PPA_WRITE_REFERENCE` is set.
fn require_current(path: &Path, text: &str) {
    if std::env::var_os("PPA_WRITE_REFERENCE").is_some() {
        fs::write(path, text).unwrap();
    }
    let found = fs::read_to_string(path).unwrap_or_default();
    assert!(
        found == text,
        "{} is out of date; {REWRITE} rewrites it",
        path.display()
    );
}

#[test]
fn reference_pages_are_those_of_the_types() {
    let sources = Sources::read();
    for page in PAGES {
        let path = root().join("docs/book/reference").join(page.0);
        let text = sources.page(page).text;
        require_current(&path, &text);
    }
}

/// `ppa studio` makes its form for plans from this file: key, type, meaning, and names with their meanings.
#[test]
fn the_form_of_plans_has_the_keys_of_the_types() {
    let plan: Page = ("plan.md", "", &PAGES[0].2[..1]);
    let page = Sources::read().page(&plan);
    let mut text = String::new();
    for row in &page.rows {
        let names = row.names.iter().flat_map(|(name, docs)| [name, docs]);
        let columns = [&row.key, &row.kind, &row.meaning].into_iter().chain(names);
        text += &columns.map(String::as_str).collect::<Vec<_>>().join("\t");
        text += "\n";
    }
    let path = root().join("ppa-studio/src/plan_keys.tsv");
    require_current(&path, &text);
}

#[test]
fn every_key_that_a_case_may_have_is_on_the_page() {
    let sources = Sources::read();
    let keys = sources.page(&PAGES[1]).keys;
    let file = sources
        .find("ppa-generate/src/case.rs", "CaseFile")
        .unwrap();
    for field in &file.item.fields {
        let key = value(&field.attributes, "rename").unwrap_or(&field.name);
        assert!(keys.contains(key), "{key} is missing in case.md");
    }
}

#[test]
fn every_key_of_the_plans_is_on_the_page() {
    let keys = Sources::read().page(&PAGES[0]).keys;
    let keys: BTreeSet<_> = keys.iter().map(|key| key.replace("[]", "")).collect();
    for plan in [
        "paper/plan.toml",
        "experiments/clinic.toml",
        "experiments/synthetic.toml",
        "experiments/preparations.toml",
    ] {
        let text = fs::read_to_string(root().join("plans").join(plan)).unwrap();
        let mut table = String::new();
        for line in text.lines() {
            let key = match (line.strip_prefix('['), line.split_once(" = ")) {
                (Some(name), _) => {
                    table = name
                        .trim_start_matches('[')
                        .split(']')
                        .next()
                        .unwrap()
                        .to_owned();
                    table.clone()
                }
                (None, Some((key, _))) if !line.starts_with(['#', ' ']) => match table.as_str() {
                    "" => key.trim().to_owned(),
                    table => format!("{table}.{}", key.trim()),
                },
                _ => continue,
            };
            assert!(keys.contains(&key), "{plan}: {key} is missing in plan.md");
        }
    }
}
