//! Sources of all crates: resolves type names used in a file, and their defaults.

use std::fs;
use std::path::{Path, PathBuf};

use super::declarations::{Type, types, variant_name};

pub struct Sources {
    pub types: Vec<Type>,
    pub texts: Vec<(String, String)>,
}

impl Sources {
    pub fn read() -> Self {
        let mut files = Vec::new();
        for entry in fs::read_dir(root()).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            if name.starts_with("ppa-") && path.join("src").is_dir() {
                sources(&path.join("src"), &mut files);
            }
        }
        files.sort();
        let mut all = Self {
            types: Vec::new(),
            texts: Vec::new(),
        };
        for path in files {
            let file = path
                .strip_prefix(root())
                .unwrap()
                .to_str()
                .unwrap()
                .to_owned();
            let text = fs::read_to_string(&path).unwrap();
            all.types.extend(types(&file, &text));
            all.texts.push((file, text));
        }
        all
    }

    pub fn text(&self, file: &str) -> &str {
        &self.texts.iter().find(|(name, _)| name == file).unwrap().1
    }

    /// Resolves a type name in a file: a type of the file itself, of a crate it imports the name from, or of its own crate.
    pub fn find(&self, file: &str, name: &str) -> Option<&Type> {
        let named: Vec<_> = self
            .types
            .iter()
            .filter(|ty| ty.item.name == name)
            .collect();
        let folder = |file: &str| file.split('/').next().unwrap().to_owned();
        let uses: Vec<_> = self
            .text(file)
            .split("\nuse ")
            .skip(1)
            .filter_map(|u| u.split(';').next())
            .collect();
        let imported = |ty: &&&Type| {
            let name_of_crate = folder(&ty.file).replace('-', "_");
            uses.iter().any(|u| {
                u.starts_with(&name_of_crate)
                    && u.split(|c: char| !c.is_alphanumeric() && c != '_')
                        .any(|word| word == name)
            })
        };
        named
            .iter()
            .find(|ty| ty.file == file)
            .or_else(|| named.iter().find(imported))
            .or_else(|| named.iter().find(|ty| folder(&ty.file) == folder(file)))
            .copied()
    }

    /// The default that `impl Default` gives a field, if it is a plain value.
    pub fn default_of(&self, ty: &Type, field: &str) -> Option<String> {
        let text = self.text(&ty.file);
        let body = text
            .split(&format!("impl Default for {} {{", ty.item.name))
            .nth(1)?
            .split("\n}")
            .next()?;
        let value = body
            .split(&format!(" {field}: "))
            .nth(1)?
            .split(",\n")
            .next()?
            .trim();
        let plain = value
            .replace(".to_owned()", "")
            .replace("vec!", "")
            .replace("None", "");
        let constant = format!("const {plain}: f64 = ");
        let is_name = plain.starts_with(|c: char| c.is_ascii_uppercase());
        let mut texts = self.texts.iter().filter(|_| is_name);
        let defined = texts.find_map(|(_, text)| text.split(&constant).nth(1));
        let plain = defined.map_or(plain, |text| text.split(';').next().unwrap().to_owned());
        (!plain.is_empty() && !plain.contains(['(', ':', '\n'])).then_some(plain)
    }

    /// The default of a type as given by `Default`.
    pub fn plain_default(&self, shown: &str, ty: Option<&Type>) -> String {
        match (shown, ty) {
            ("f64" | "f32" | "u32" | "u64" | "usize" | "i32", _) => "`0`".to_owned(),
            ("bool", _) => "`false`".to_owned(),
            _ if shown.starts_with("Vec<") => "see `ppa plan init`".to_owned(),
            _ if shown.starts_with('[') => "zeros".to_owned(),
            (_, Some(ty)) if ty.is_enum => {
                let fields = &ty.item.fields;
                let chosen = fields
                    .iter()
                    .find(|variant| variant.attributes.contains("#[default]"));
                chosen.map_or("see `ppa plan init`".to_owned(), |variant| {
                    format!("`{}`", variant_name(ty, variant))
                })
            }
            (_, Some(ty)) if ty.item.attributes.contains("(default") => {
                "those of its keys".to_owned()
            }
            _ => "see `ppa plan init`".to_owned(),
        }
    }
}

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_owned()
}

pub fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, found),
            false if path.extension().is_some_and(|e| e == "rs") => found.push(path),
            false => {}
        }
    }
}
