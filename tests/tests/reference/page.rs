//! A reference page: tables of keys with their types, defaults and documentation.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::declarations::{Item, Type, value, variant_name};
use super::sources::Sources;

/// A page: its file, title, introduction, and the root types of each file with their keys.
pub type Page = (&'static str, &'static str, &'static [Root]);
/// Heading, file that declares the type, the type.
pub type Root = (&'static str, &'static str, &'static str);

/// A page under construction.
pub struct Table {
    pub text: String,
    pub keys: BTreeSet<String>,
    /// Rows without markup.
    pub rows: Vec<Row>,
    /// Whether the files are written by ppa rather than by users.
    pub is_written: bool,
}

/// A key with its type and meaning.
pub struct Row {
    pub key: String,
    pub kind: String,
    pub meaning: String,
    /// The allowed names with their meanings.
    pub names: Vec<(String, String)>,
}

impl Sources {
    /// Rows of the table for the fields of a type, including those of nested types.
    pub fn rows(&self, ty: &Type, prefix: &str, page: &mut Table) {
        let other = if page.is_written { "into" } else { "try_from" };
        let ty = value(&ty.item.attributes, other)
            .and_then(|name| self.find(&ty.file, name))
            .unwrap_or(ty);
        let all_default = ty.item.attributes.contains("(default");
        self.fields(ty, &ty.item.fields, all_default, prefix, page);
    }

    pub fn fields(
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
            let mut row = Row {
                key: format!("{key}{list}"),
                kind: kind(shown, named),
                meaning: meaning.clone(),
                names: Vec::new(),
            };
            let below = match word {
                Some(below) if below.is_enum => {
                    let named = below.item.fields.iter();
                    let name = |variant| (variant_name(below, variant), one_line(&variant.docs));
                    row.names = named.map(name).collect();
                    for (name, docs) in &row.names {
                        let _ = write!(meaning, " `{name}`: {docs}");
                    }
                    None
                }
                other => other,
            };
            let _ = writeln!(
                page.text,
                "| `{key}{list}` | {} | {default} | {meaning} |",
                row.kind
            );
            page.rows.push(row);
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

    pub fn page(&self, (file, title, roots): &Page) -> Table {
        let is_written = *file == "dataset.md";
        let text = format!(
            "# {title}\n\nA test generates this page from the sources. `[]` marks a list; a dot leads into a table.\n"
        );
        let mut page = Table {
            text,
            keys: BTreeSet::new(),
            rows: Vec::new(),
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

/// The type in words of TOML and JSON; `named` describes a type of this workspace.
pub fn kind(ty: &str, named: &str) -> String {
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
pub fn one_line(docs: &str) -> String {
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
