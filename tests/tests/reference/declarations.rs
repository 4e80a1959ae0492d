//! Parses declarations of types that serde reads or writes from sources formatted by rustfmt.

/// A field or a variant.
#[derive(Default)]
pub struct Item {
    pub name: String,
    pub ty: String,
    pub docs: String,
    pub attributes: String,
    pub fields: Vec<Item>,
}

pub struct Type {
    pub file: String,
    pub item: Item,
    pub is_enum: bool,
}

/// Value of a key in attributes, such as that of `rename = "x"`.
pub fn value<'a>(attributes: &'a str, key: &str) -> Option<&'a str> {
    attributes
        .split(&format!("{key} = \""))
        .nth(1)?
        .split('"')
        .next()
}

pub fn snake(name: &str) -> String {
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
pub fn types(file: &str, text: &str) -> Vec<Type> {
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
pub fn items(lines: &[&str]) -> Vec<Item> {
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

/// The name of a variant in files.
pub fn variant_name(ty: &Type, variant: &Item) -> String {
    match value(&variant.attributes, "rename") {
        Some(name) => name.to_owned(),
        None if ty.item.attributes.contains("snake_case") => snake(&variant.name),
        None if ty.item.attributes.contains("kebab-case") => snake(&variant.name).replace('_', "-"),
        None if ty.item.attributes.contains("lowercase") => variant.name.to_lowercase(),
        None => variant.name.clone(),
    }
}
