//! No import cycles between the modules of a crate, nor between the files of a module.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Top-level modules of a crate, and the other modules that each names outside its tests.
type Imports = BTreeMap<String, BTreeSet<String>>;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        match path.is_dir() {
            true if name != "tests" => sources(&path, found),
            false if name.ends_with(".rs") && !name.ends_with("tests.rs") => found.push(path),
            _ => {}
        }
    }
}

/// A source without comments and without the tests at its end.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let lines = text.lines().map(|line| line.split("//").next().unwrap());
    lines.collect::<Vec<_>>().join("\n")
}

/// The names that follow a prefix such as `crate::`, including those of a braced list.
fn names_after(code: &str, prefix: &str) -> BTreeSet<String> {
    let name = |text: &str| -> String {
        let is_part = |c: &char| c.is_ascii_lowercase() || c.is_ascii_digit() || *c == '_';
        text.trim_start().chars().take_while(is_part).collect()
    };
    let mut names = BTreeSet::new();
    for rest in code.split(prefix).skip(1) {
        match rest.strip_prefix('{') {
            None => _ = names.insert(name(rest)),
            Some(list) => {
                let list = list.split("};").next().unwrap();
                names.extend(list.split(',').map(name));
            }
        }
    }
    names
}

/// The files and folders in one folder of a crate, with the others there that each imports.
fn imports(src: &Path, folder: &Path) -> Imports {
    let inside = folder.strip_prefix(src).unwrap();
    let parents = inside.iter().map(|part| part.to_str().unwrap());
    let prefix = ["crate"].into_iter().chain(parents).chain([""]);
    let prefix = prefix.collect::<Vec<_>>().join("::");
    let mut files = Vec::new();
    sources(folder, &mut files);
    let mut imports = Imports::new();
    for file in files {
        let parts: Vec<_> = file.strip_prefix(folder).unwrap().iter().collect();
        let module = parts[0]
            .to_str()
            .unwrap()
            .trim_end_matches(".rs")
            .to_owned();
        let code = code(&file);
        let mut names = names_after(&code, &prefix);
        // `super` is the folder for the files in it.
        if parts.len() == 1 {
            names.extend(names_after(&code, "super::"));
        }
        names.remove(&module);
        if !["lib", "main", "mod"].contains(&module.as_str()) {
            imports.entry(module).or_default().extend(names);
        }
    }
    imports
}

/// Folders whose files still import each other in cycles, with the reason.
const ONE_MODULE: [(&str, &str); 3] = [
    (
        "ppa-ct/src/dicom_series",
        "header, attributes and file follow one walk through the elements",
    ),
    (
        "ppa-learn/src/experiment",
        "cells, tables and errors name each other's types",
    ),
    (
        "ppa-learn/src/train",
        "`run` owns the state that `steps` moves",
    ),
];

fn folders(folder: &Path, found: &mut Vec<PathBuf>) {
    found.push(folder.to_owned());
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && path.file_name().unwrap() != "tests" {
            folders(&path, found);
        }
    }
}

/// Whether the last module of `path` leads into a cycle, which is then left in `path`.
fn circle(imports: &Imports, path: &mut Vec<String>, done: &mut BTreeSet<String>) -> bool {
    let last = path.last().unwrap().clone();
    for next in imports.get(&last).into_iter().flatten() {
        if let Some(at) = path.iter().position(|module| module == next) {
            path.drain(..at);
            return true;
        }
        if imports.contains_key(next) && !done.contains(next) {
            path.push(next.clone());
            if circle(imports, path, done) {
                return true;
            }
            path.pop();
        }
    }
    done.insert(last);
    false
}

fn first_circle(imports: &Imports) -> Option<String> {
    let mut done = BTreeSet::new();
    let mut starts = imports.keys().map(|module| vec![module.clone()]);
    let found = starts.find_map(|mut path| circle(imports, &mut path, &mut done).then_some(path));
    found.map(|path| path.join(" -> "))
}

#[test]
fn modules_of_a_crate_import_in_one_direction() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut modules = 0;
    for entry in fs::read_dir(&root).unwrap() {
        let crate_root = entry.unwrap().path();
        let name = crate_root.file_name().unwrap().to_str().unwrap().to_owned();
        let src = crate_root.join("src");
        // The demo's output, ppa-demo/, is not a crate.
        if !name.starts_with("ppa-") || !src.is_dir() {
            continue;
        }
        let mut found = Vec::new();
        folders(&src, &mut found);
        for folder in found {
            let imports = imports(&src, &folder);
            modules += imports.len();
            let place = folder.strip_prefix(&root).unwrap().to_str().unwrap();
            let circle = first_circle(&imports);
            match ONE_MODULE.iter().any(|(listed, _)| *listed == place) {
                false => assert_eq!(circle, None, "{place}"),
                true => assert!(circle.is_some(), "{place} is listed, but has no circle"),
            }
        }
    }
    assert!(modules > 500, "{modules} modules");
}

#[test]
fn a_circle_of_three_modules_is_found() {
    let of = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let mut imports = Imports::from([
        ("a".to_owned(), of(&["b"])),
        ("b".to_owned(), of(&["c"])),
        ("c".to_owned(), of(&[])),
    ]);
    assert_eq!(first_circle(&imports), None);
    imports.insert("c".to_owned(), of(&["a"]));
    assert_eq!(first_circle(&imports).unwrap(), "a -> b -> c");
}
