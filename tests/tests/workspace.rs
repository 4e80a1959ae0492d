//! Structure of the workspace: which crates may depend on which.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Crates of the workspace with the crates on which each may depend outside its tests.
const ARROWS: &[(&str, &[&str])] = &[
    ("ppa-core", &[]),
    ("ppa-ct", &["ppa-core"]),
    ("ppa-phantom", &["ppa-core", "ppa-ct"]),
    ("ppa-mesh", &["ppa-core", "ppa-ct"]),
    ("ppa-scene", &["ppa-core", "ppa-ct", "ppa-mesh"]),
    ("ppa-depth", &["ppa-core"]),
    ("ppa-xray", &["ppa-core", "ppa-ct"]),
    ("ppa-dataset", &["ppa-core"]),
    (
        "ppa-generate",
        &[
            "ppa-core",
            "ppa-ct",
            "ppa-mesh",
            "ppa-scene",
            "ppa-depth",
            "ppa-xray",
            "ppa-dataset",
        ],
    ),
    (
        "ppa-label",
        &[
            "ppa-core",
            "ppa-ct",
            "ppa-scene",
            "ppa-depth",
            "ppa-xray",
            "ppa-dataset",
        ],
    ),
    (
        "ppa-report",
        &[
            "ppa-core",
            "ppa-ct",
            "ppa-mesh",
            "ppa-scene",
            "ppa-depth",
            "ppa-xray",
            "ppa-dataset",
            "ppa-generate",
        ],
    ),
    ("ppa-metrics", &[]),
    ("ppa-cluster", &["ppa-core"]),
    ("ppa-learn", &["ppa-core", "ppa-dataset", "ppa-metrics"]),
    (
        "ppa-studio",
        &[
            "ppa-core",
            "ppa-ct",
            "ppa-phantom",
            "ppa-mesh",
            "ppa-scene",
            "ppa-depth",
            "ppa-xray",
            "ppa-dataset",
            "ppa-generate",
            "ppa-label",
            "ppa-report",
            "ppa-cluster",
            "ppa-learn",
        ],
    ),
    (
        "ppa-cli",
        &[
            "ppa-core",
            "ppa-ct",
            "ppa-phantom",
            "ppa-mesh",
            "ppa-scene",
            "ppa-depth",
            "ppa-xray",
            "ppa-dataset",
            "ppa-generate",
            "ppa-cluster",
            "ppa-label",
            "ppa-report",
            "ppa-learn",
            "ppa-metrics",
            "ppa-studio",
        ],
    ),
];

/// Foreign crates that a crate must not pull in, by prefix.
const FORBIDDEN: &[(&str, &[&str])] = &[
    // Names and conventions only: no formulas, readers or frontends.
    (
        "ppa-core",
        &[
            "candle", "clap", "dicom", "exr", "image", "nalgebra", "nifti", "parry", "png", "rayon",
        ],
    ),
    ("ppa-phantom", &["dicom", "nifti", "candle"]),
    ("ppa-mesh", &["dicom", "nifti", "candle"]),
    ("ppa-depth", &["dicom", "nifti", "candle", "clap"]),
    ("ppa-xray", &["dicom", "nifti", "candle", "clap"]),
    ("ppa-dataset", &["dicom", "nifti", "clap", "candle"]),
    ("ppa-generate", &["clap", "indicatif", "candle"]),
    (
        "ppa-cluster",
        &["dicom", "nifti", "candle", "clap", "rayon"],
    ),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn manifest(path: &Path) -> toml::Table {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text.parse()
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn members() -> BTreeMap<String, toml::Table> {
    let workspace = manifest(&root().join("Cargo.toml"));
    let names = workspace["workspace"]["members"].as_array().unwrap();
    let names = names.iter().map(|name| name.as_str().unwrap());
    names
        .filter(|name| name.starts_with("ppa-"))
        .map(|name| {
            let manifest = manifest(&root().join(name).join("Cargo.toml"));
            assert_eq!(manifest["package"]["name"].as_str(), Some(name));
            (name.to_owned(), manifest)
        })
        .collect()
}

fn dependencies<'a>(manifest: &'a toml::Table, section: &str) -> Vec<&'a str> {
    let table = manifest.get(section).and_then(toml::Value::as_table);
    table
        .into_iter()
        .flat_map(|t| t.keys().map(String::as_str))
        .collect()
}

#[test]
fn crates_depend_only_along_the_arrows() {
    let members = members();
    let listed: Vec<_> = ARROWS.iter().map(|(name, _)| *name).collect();
    for name in members.keys() {
        assert!(
            listed.contains(&name.as_str()),
            "{name} has no entry in ARROWS"
        );
    }
    for (name, allowed) in ARROWS {
        for dependency in dependencies(&members[*name], "dependencies") {
            assert!(
                !dependency.starts_with("ppa-") || allowed.contains(&dependency),
                "{name} must not depend on {dependency}"
            );
        }
    }
}

/// The dependencies shared by all crates must not grow unnoticed.
#[test]
fn the_shared_crate_has_exactly_its_listed_dependencies() {
    let manifest = &members()["ppa-core"];
    let mut found = dependencies(manifest, "dependencies");
    found.sort_unstable();
    let listed = ["atomic-write-file", "serde", "sha2", "thiserror"];
    assert_eq!(found, listed);
    let targets = manifest["target"].as_table().unwrap();
    let of_targets = targets.values().map(|target| target.as_table().unwrap());
    let of_targets: Vec<_> = of_targets
        .flat_map(|target| dependencies(target, "dependencies"))
        .collect();
    assert_eq!(of_targets, ["rustix"]);
}

/// Uses the lock file, so a feature that was switched on by mistake is found as well.
#[test]
fn libraries_used_alone_pull_in_no_reader_network_or_frontend() {
    for (name, forbidden) in FORBIDDEN {
        for line in tree(&["--package", name]) {
            for prefix in *forbidden {
                assert!(!line.starts_with(prefix), "{name} pulls in {line}");
            }
        }
    }
}

/// Names and versions of all crates linked into a crate, one per line.
fn tree(which: &[&str]) -> Vec<String> {
    let tree = std::process::Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--edges", "normal", "--prefix", "none"])
        .args(which)
        .current_dir(root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&tree.stderr);
    assert!(tree.status.success(), "{said}");
    let text = String::from_utf8(tree.stdout).unwrap();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn every_crate_is_ready_to_publish() {
    for (name, manifest) in members() {
        let package = manifest["package"].as_table().unwrap();
        for key in [
            "description",
            "keywords",
            "documentation",
            "readme",
            "license",
            "repository",
        ] {
            assert!(package.contains_key(key), "{name} lacks package.{key}");
        }
        assert!(
            root().join(&name).join("README.md").is_file(),
            "{name} has no README.md"
        );
        assert!(
            manifest.contains_key("lints"),
            "{name} does not take the workspace's lints"
        );
    }
}

#[test]
fn versions_stand_only_in_the_root_manifest() {
    for (name, manifest) in members() {
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let Some(table) = manifest.get(section).and_then(toml::Value::as_table) else {
                continue;
            };
            for (dependency, value) in table {
                let inherited = value
                    .get("workspace")
                    .and_then(toml::Value::as_bool)
                    .unwrap_or(false);
                assert!(
                    inherited,
                    "{name}: {section}.{dependency} states its own version"
                );
            }
        }
    }
}
