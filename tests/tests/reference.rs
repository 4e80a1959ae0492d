//! The reference pages list every key of the files that users write or read, as the types in the sources declare them.
//!
//! The sources are read as text, as rustfmt leaves them, so that no crate needs a feature or a dependency for its documentation.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const REWRITE: &str = "PPA_WRITE_REFERENCE=1 cargo test -p ppa-tests --test reference";

/// A page: its file, title, introduction, and the types at the root of each file with the key they stand under.
type Page = (&'static str, &'static str, &'static [Root]);
/// Heading, file that declares the type, the type.
type Root = (&'static str, &'static str, &'static str);

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

/// A field or a variant.
#[derive(Default)]
struct Item {
    name: String,
    ty: String,
    docs: String,
    attributes: String,
    fields: Vec<Item>,
}

struct Type {
    file: String,
    item: Item,
    is_enum: bool,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_owned()
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, found),
            false if path.extension().is_some_and(|e| e == "rs") => found.push(path),
            false => {}
        }
    }
}

/// Value of a key in attributes, such as that of `rename = "x"`.
fn value<'a>(attributes: &'a str, key: &str) -> Option<&'a str> {
    attributes
        .split(&format!("{key} = \""))
        .nth(1)?
        .split('"')
        .next()
}

fn snake(name: &str) -> String {
    let mut text = String::new();
    for (i, c) in name.char_indices() {
        if c.is_uppercase() && i > 0 {
            text.push('_');
        }
        text.extend(c.to_lowercase());
    }
    text
}

/// The structures and enumerations of a file that serde reads or writes.
fn types(file: &str, text: &str) -> Vec<Type> {
    let mut types = Vec::new();
    let mut lines = text.lines();
    let (mut docs, mut attributes) = (String::new(), String::new());
    while let Some(line) = lines.next() {
        if let Some(doc) = line.strip_prefix("///") {
            docs += doc.strip_prefix(' ').unwrap_or(doc);
            docs.push('\n');
        } else if line.starts_with("#[") {
            attributes += line;
        } else {
            let words: Vec<_> = line.split_whitespace().collect();
            let at = words
                .iter()
                .position(|word| ["struct", "enum"].contains(word));
            if let (Some(at), true) = (at, line.ends_with('{') && attributes.contains("erialize")) {
                let name = words[at + 1].split('<').next().unwrap().to_owned();
                let body: Vec<_> = lines.by_ref().take_while(|line| *line != "}").collect();
                let fields = items(&body);
                let (docs, attributes) = (docs.clone(), attributes.clone());
                let item = Item {
                    name,
                    docs,
                    attributes,
                    fields,
                    ..Item::default()
                };
                types.push(Type {
                    file: file.to_owned(),
                    item,
                    is_enum: words[at] == "enum",
                });
            }
            docs.clear();
            attributes.clear();
        }
    }
    types
}

/// The fields or variants between the braces.
fn items(lines: &[&str]) -> Vec<Item> {
    let mut items = Vec::new();
    let mut item = Item::default();
    let mut at = 0;
    while at < lines.len() {
        let line = lines[at].trim();
        at += 1;
        if let Some(doc) = line.strip_prefix("///") {
            item.docs += doc.strip_prefix(' ').unwrap_or(doc);
            item.docs.push('\n');
        } else if line.starts_with("#[") {
            item.attributes += line;
        } else if !line.is_empty() && !line.starts_with("//") && !line.starts_with(')') {
            let line = line
                .trim_start_matches("pub(crate) ")
                .trim_start_matches("pub ");
            let end = line.find([':', '(', '{', ',']).unwrap_or(line.len());
            line[..end].trim().clone_into(&mut item.name);
            if line.ends_with('{') {
                let indent =
                    &lines[at - 1][..lines[at - 1].len() - lines[at - 1].trim_start().len()];
                let close = format!("{indent}}},");
                let length = lines[at..]
                    .iter()
                    .take_while(|line| **line != close)
                    .count();
                item.fields = self::items(&lines[at..at + length]);
                at += length + 1;
            } else {
                let ty = line[end..]
                    .trim_start_matches(':')
                    .trim_end_matches(',')
                    .trim();
                ty.clone_into(&mut item.ty);
            }
            items.push(std::mem::take(&mut item));
        }
    }
    items
}

struct Sources {
    types: Vec<Type>,
    texts: Vec<(String, String)>,
}

/// A page as it grows.
struct Table {
    text: String,
    keys: BTreeSet<String>,
    /// Whether ppa writes the files and no person does.
    is_written: bool,
}

impl Sources {
    fn read() -> Self {
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

    fn text(&self, file: &str) -> &str {
        &self.texts.iter().find(|(name, _)| name == file).unwrap().1
    }

    /// The type that a file means by a name: its own, that of a crate it imports the name from, or one of its own crate.
    fn find(&self, file: &str, name: &str) -> Option<&Type> {
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

    /// The default that `impl Default` gives a field, where it is a plain value.
    fn default_of(&self, ty: &Type, field: &str) -> Option<String> {
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

    /// The default of a type, as `Default` has it.
    fn plain_default(&self, shown: &str, ty: Option<&Type>) -> String {
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

    /// Rows of the table for the fields of a type, those of the types below it included.
    fn rows(&self, ty: &Type, prefix: &str, page: &mut Table) {
        let other = if page.is_written { "into" } else { "try_from" };
        let ty = value(&ty.item.attributes, other)
            .and_then(|name| self.find(&ty.file, name))
            .unwrap_or(ty);
        let all_default = ty.item.attributes.contains("(default");
        self.fields(ty, &ty.item.fields, all_default, prefix, page);
    }

    fn fields(
        &self,
        ty: &Type,
        fields: &[Item],
        all_default: bool,
        prefix: &str,
        page: &mut Table,
    ) {
        for field in fields {
            let shown = &field.ty;
            let word = shown
                .split(|c: char| !c.is_alphanumeric() && c != '_')
                .filter(|word| !["Option", "Vec", "Box", "BTreeMap"].contains(word))
                .find_map(|word| self.find(&ty.file, word));
            if let (true, Some(below)) = (field.attributes.contains("flatten"), word) {
                self.rows(below, prefix, page);
                continue;
            }
            let name =
                value(&field.attributes, "rename").unwrap_or(field.name.trim_start_matches("r#"));
            let key = format!("{prefix}{name}");
            let optional = shown.starts_with("Option<");
            let by_serde = all_default || field.attributes.contains("default");
            let default = match self.default_of(ty, &field.name) {
                _ if page.is_written && field.attributes.contains("skip_serializing_if") => {
                    "may be left out".to_owned()
                }
                _ if page.is_written && optional => "may be `null`".to_owned(),
                _ if page.is_written => "always".to_owned(),
                Some(value) => format!("`{value}`"),
                None if optional => "none".to_owned(),
                None if value(&field.attributes, "default").is_some() => {
                    let function = value(&field.attributes, "default").unwrap();
                    let code = self
                        .text(&ty.file)
                        .split(&format!("fn {function}() -> "))
                        .nth(1);
                    let body = code.and_then(|code| code.split(['{', '}']).nth(1));
                    format!(
                        "`{}`",
                        body.unwrap_or(function).trim().replace(".to_owned()", "")
                    )
                }
                None if by_serde => self.plain_default(shown, word),
                None if field.attributes.contains("Vec::is_empty") => "empty list".to_owned(),
                None => "required".to_owned(),
            };
            let mut meaning = one_line(&field.docs);
            let list = if shown.starts_with("Vec<") { "[]" } else { "" };
            let named = match word {
                Some(ty) if ty.is_enum && ty.item.fields.iter().any(|v| !v.fields.is_empty()) => {
                    "name, or table with one of the names"
                }
                Some(ty) if ty.is_enum => "one of the names",
                Some(_) => "table",
                None => "text",
            };
            let below = match word {
                Some(below) if below.is_enum => {
                    for variant in &below.item.fields {
                        let name = variant_name(below, variant);
                        let _ = write!(meaning, " `{name}`: {}", one_line(&variant.docs));
                    }
                    None
                }
                other => other,
            };
            let _ = writeln!(
                page.text,
                "| `{key}{list}` | {} | {default} | {meaning} |",
                kind(shown, named)
            );
            page.keys.insert(key.clone());
            assert!(
                !meaning.is_empty(),
                "{key} of {} has no documentation",
                ty.file
            );
            if let Some(ty) = below {
                self.rows(ty, &format!("{key}{list}."), page);
            } else if let Some(ty) = word {
                for variant in &ty.item.fields {
                    let tag = variant_name(ty, variant);
                    self.fields(
                        ty,
                        &variant.fields,
                        false,
                        &format!("{key}{list}.{tag}."),
                        page,
                    );
                }
            }
        }
    }

    fn page(&self, (file, title, roots): &Page) -> Table {
        let is_written = *file == "dataset.md";
        let text = format!(
            "# {title}\n\nA test generates this page from the sources. `[]` marks a list; a dot leads into a table.\n"
        );
        let mut page = Table {
            text,
            keys: BTreeSet::new(),
            is_written,
        };
        let column = if is_written { "present" } else { "default" };
        for (heading, file, name) in *roots {
            let ty = self.find(file, name).unwrap();
            let _ = write!(
                page.text,
                "\n## {heading}\n\n{}\n\n| key | type | {column} | meaning |\n|---|---|---|---|\n",
                one_line(&ty.item.docs)
            );
            self.rows(ty, "", &mut page);
        }
        page
    }
}

/// What a variant is called in files.
fn variant_name(ty: &Type, variant: &Item) -> String {
    match value(&variant.attributes, "rename") {
        Some(name) => name.to_owned(),
        None if ty.item.attributes.contains("snake_case") => snake(&variant.name),
        None if ty.item.attributes.contains("kebab-case") => snake(&variant.name).replace('_', "-"),
        None if ty.item.attributes.contains("lowercase") => variant.name.to_lowercase(),
        None => variant.name.clone(),
    }
}

/// The type in words of TOML and JSON; `named` says what a type of ours is.
fn kind(ty: &str, named: &str) -> String {
    let inner = |start: &str| {
        ty.strip_prefix(start)
            .and_then(|rest| rest.strip_suffix('>'))
    };
    if let Some(inner) = inner("Option<") {
        return kind(inner, named);
    }
    if let Some(slice) = ty.strip_prefix("&'a [") {
        return format!("list of {}", kind(slice.trim_end_matches(']'), named));
    }
    if let Some(inner) = inner("Vec<") {
        return format!("list of {}", kind(inner, named));
    }
    match ty {
        "f64" | "f32" => "number".to_owned(),
        "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" => "integer".to_owned(),
        "bool" => "`true` or `false`".to_owned(),
        "PathBuf" => "path".to_owned(),
        "String" | "&'static str" | "&'a str" => "text".to_owned(),
        "TransformRows" | "[[f64; 4]; 4]" => "4 rows of 4 numbers".to_owned(),
        _ => match ty
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']')?.rsplit_once("; "))
        {
            Some((inner, count)) => format!("{count} × {}", kind(inner, named)),
            None => named.to_owned(),
        },
    }
}

/// Docs as one line of a table: without links to Rust items.
fn one_line(docs: &str) -> String {
    let words: Vec<_> = docs.split_whitespace().collect();
    let mut text = words.join(" ").replace('|', "\\|");
    while let Some(at) = text.find("](") {
        let end = text[at..].find(')').unwrap() + at;
        text.replace_range(at..=end, "]");
    }
    text.replace("[`", "`")
        .replace("`]", "`")
        .replace("Self::", "")
}

#[test]
fn reference_pages_are_those_of_the_types() {
    let sources = Sources::read();
    for page in PAGES {
        let path = root().join("docs/book/reference").join(page.0);
        let text = sources.page(page).text;
        if std::env::var_os("PPA_WRITE_REFERENCE").is_some() {
            fs::write(&path, &text).unwrap();
        }
        let found = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            found == text,
            "{} is out of date; {REWRITE} rewrites it",
            path.display()
        );
    }
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
