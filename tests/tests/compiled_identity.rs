//! Basis of the code key of a dataset: the identity of a type reveals how its crate was compiled.
//!
//! Neither Cargo nor the compiler guarantees this, so it is tested here with crates of a few lines.

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

/// A registry crate that is already compiled, in the version of Cargo.lock; this workspace has it in the cache.
const OF_REGISTRY: &str = "colorous";

fn locked_version(name: &str) -> String {
    let lock = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.lock"));
    let lock: toml::Table = lock.unwrap().parse().unwrap();
    let packages = lock["package"].as_array().unwrap();
    let package = packages
        .iter()
        .find(|p| p["name"].as_str() == Some(name))
        .unwrap();
    package["version"].as_str().unwrap().to_owned()
}

/// The identities of a type of a local crate and of a registry crate, in a program whose workspace does not contain the local crate.
fn identities_from_outside(root: &Path, arguments: &[&str]) -> [String; 2] {
    write_workspace(root, "0.1.0", "");
    let program = root.join("python");
    fs::create_dir_all(program.join("src")).unwrap();
    let version = locked_version(OF_REGISTRY);
    let manifest = format!(
        "[package]\nname = \"program\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[workspace]\n\
         [dependencies]\nmiddle = {{ path = \"../middle\" }}\n{OF_REGISTRY} = \"={version}\"\n"
    );
    fs::write(program.join("Cargo.toml"), manifest).unwrap();
    let code = "use std::any::TypeId;\nfn main() {\n    println!(\"{:?}\", TypeId::of::<middle::Here>());\n    \
                println!(\"{:?}\", TypeId::of::<colorous::Gradient>());\n}\n";
    fs::write(program.join("src/main.rs"), code).unwrap();
    let printed = printed(&program, arguments);
    let lines: Vec<&str> = printed.lines().collect();
    [lines[0].to_owned(), lines[1].to_owned()]
}

/// The code key uses only types of registry crates because pip builds the Python package outside the workspace, in a folder with a new
/// name.
#[test]
fn only_types_of_registries_are_free_of_folders() {
    let [here, there] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [folder, registry] = identities_from_outside(here.path(), &[]);
    let [other_folder, same_registry] = identities_from_outside(there.path(), &[]);
    assert_eq!(registry, same_registry);
    assert_ne!(folder, other_folder);
    let [_, released] = identities_from_outside(here.path(), &["--release"]);
    assert_ne!(released, registry, "another profile");
}

/// Crates that do not influence the bytes of an image: messages, measured time, exports, coloured previews, and moving files into place.
const WITHOUT_INFLUENCE: [&str; 7] = [
    "atomic-write-file",
    "colorous",
    "cpu-time",
    "csv",
    "parquet",
    "tar",
    "thiserror",
];

#[test]
fn the_code_key_knows_all_crates_that_make_images() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let read = |path: &str| fs::read_to_string(root.join(path)).unwrap();
    let crates = [
        "core", "ct", "dataset", "depth", "generate", "mesh", "scene", "xray",
    ];
    let build = read("ppa-generate/build.rs");
    let known: String = ["ct", "dataset", "depth", "mesh"]
        .map(|name| read(&format!("ppa-{name}/src/compiled_with.rs")))
        .concat()
        + &read("ppa-generate/src/compiled.rs");
    for name in crates {
        assert!(build.contains(&format!("\"ppa-{name}\"")), "{name}");
        let manifest: toml::Table = read(&format!("ppa-{name}/Cargo.toml")).parse().unwrap();
        for dependency in manifest["dependencies"].as_table().unwrap().keys() {
            if let Some(ours) = dependency.strip_prefix("ppa-") {
                assert!(crates.contains(&ours), "{dependency} of {name}");
            } else if !WITHOUT_INFLUENCE.contains(&dependency.as_str()) {
                let asked = match &**dependency {
                    "sha2" => "TypeId::of::<Sha256>".to_owned(),
                    other => format!("TypeId::of::<{}::", other.replace('-', "_")),
                };
                assert!(known.contains(&asked), "{dependency} of {name}");
            }
        }
    }
}

/// Without `--locked`, `cargo install` takes the newest versions instead of those in Cargo.lock.
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
