//! What the code key of a dataset builds on: the identity of a type reveals how its crate was compiled.
//!
//! Neither Cargo nor the compiler promises it, so it is tried here with crates of a few lines.

use std::fs;
use std::path::Path;
use std::process::Command;

/// A program that prints the identity of a type of `middle`, which depends on `lowest`.
fn write_workspace(root: &Path, version_of_lowest: &str, features: &str) {
    let package = |name: &str, version: &str, rest: &str, source: &str, code: &str| {
        let folder = root.join(name);
        fs::create_dir_all(folder.join("src")).unwrap();
        let manifest = format!(
            "[package]\nname = \"{name}\"\nversion = \"{version}\"\nedition = \"2024\"\n{rest}"
        );
        fs::write(folder.join("Cargo.toml"), manifest).unwrap();
        fs::write(folder.join("src").join(source), code).unwrap();
    };
    let members =
        "[workspace]\nresolver = \"3\"\nmembers = [\"program\", \"middle\", \"lowest\"]\n";
    fs::write(root.join("Cargo.toml"), members).unwrap();
    package(
        "lowest",
        version_of_lowest,
        "[features]\nmore = []\n",
        "lib.rs",
        "",
    );
    let needs =
        format!("[dependencies]\nlowest = {{ path = \"../lowest\", features = [{features}] }}\n");
    package("middle", "0.1.0", &needs, "lib.rs", "pub struct Here;\n");
    let needs = "[dependencies]\nmiddle = { path = \"../middle\" }\n";
    let code = "fn main() { println!(\"{:?}\", std::any::TypeId::of::<middle::Here>()); }\n";
    package("program", "0.1.0", needs, "main.rs", code);
}

fn printed(root: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--offline", "--package", "program"])
        .args(arguments)
        .env_remove("CARGO_TARGET_DIR")
        .current_dir(root)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_type_tells_versions_features_and_profile_of_its_crates() {
    let [here, there] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    write_workspace(here.path(), "0.1.0", "");
    let first = printed(here.path(), &[]);
    assert_eq!(printed(here.path(), &[]), first);
    assert_ne!(printed(here.path(), &["--release"]), first);
    write_workspace(there.path(), "0.1.0", "");
    assert_eq!(printed(there.path(), &[]), first, "in another folder");
    write_workspace(here.path(), "0.1.1", "");
    assert_ne!(printed(here.path(), &[]), first, "another version");
    write_workspace(here.path(), "0.1.0", "\"more\"");
    assert_ne!(printed(here.path(), &[]), first, "another feature");
}

/// Without it, `cargo install` takes the newest versions instead of those in Cargo.lock.
#[test]
fn every_documented_install_line_is_locked() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for file in ["README.md", "docs/book/training.md"] {
        let text = fs::read_to_string(root.join(file)).unwrap();
        let lines = text.matches("cargo install").count();
        assert!(lines >= 1, "{file}");
        assert_eq!(text.matches("cargo install --locked").count(), lines);
    }
}
