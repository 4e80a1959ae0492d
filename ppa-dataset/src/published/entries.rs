//! `labels.json` of the specimen layout, and `roi_depth.json` of either.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::{Label, PublishedError};
use crate::files::{FileError, read_text};
use crate::labels::{LabelSource, Sources, name_of};
use crate::layout::View;
use crate::manifest::RoiRow;

/// A label of the specimen layout; `crate::labels::LabelFile` holds those of the synthetic one.
#[derive(Deserialize)]
struct LabelEntry {
    label: f64,
    std: f64,
    image_number: Option<u32>,
    label_source: Option<LabelSource>,
}

#[derive(Deserialize)]
struct RoiEntry {
    camera: View,
    image_number: Option<u32>,
    x_start: u32,
    y_start: u32,
    size: u32,
}

/// Labels of the specimen layout by number of the pose; empty if the file is missing. `of_key` gives the number in a radiograph's name.
pub(super) fn labels(
    path: &Path,
    of_key: impl Fn(&str) -> Option<u32>,
) -> Result<BTreeMap<u32, Label>, PublishedError> {
    let mut labels = BTreeMap::new();
    let mut sources = Sources::default();
    for (key, entry) in entries::<LabelEntry>(path)? {
        let wrong = |message| PublishedError::Entry {
            path: path.to_owned(),
            key: key.clone(),
            message,
        };
        let number = one_number(entry.image_number, of_key(&key)).map_err(wrong)?;
        if let Err(expected) = sources.take(entry.label_source) {
            let found = name_of(entry.label_source);
            return Err(wrong(format!(
                "the label comes from {found}, but earlier ones from {expected}"
            )));
        }
        if !(1.0..=3.0).contains(&entry.label) {
            let found = entry.label;
            return Err(wrong(format!("the label is {found}, expected 1 to 3")));
        }
        if !(entry.std.is_finite() && entry.std >= 0.0) {
            return Err(wrong(format!("std is {}, expected at least 0", entry.std)));
        }
        let label = Label {
            label: entry.label,
            std: entry.std,
            source: entry.label_source,
        };
        if labels.insert(number, label).is_some() {
            return Err(wrong(format!("pose {number} has two labels")));
        }
    }
    Ok(labels)
}

/// Regions by camera and number of the pose; empty if the file is missing. `of_key` gives camera and number from the name of a depth image.
pub(super) fn rois(
    path: &Path,
    of_key: impl Fn(&str) -> Option<(View, u32)>,
) -> Result<BTreeMap<(View, u32), RoiRow>, PublishedError> {
    let mut rois = BTreeMap::new();
    for (key, entry) in entries::<RoiEntry>(path)? {
        let wrong = |message| PublishedError::Entry {
            path: path.to_owned(),
            key: key.clone(),
            message,
        };
        let (named, numbered) = of_key(&key).unzip();
        let image_number = one_number(entry.image_number, numbered).map_err(wrong)?;
        let camera = entry.camera;
        if named.is_some_and(|view| view != camera) {
            return Err(wrong(format!(
                "the camera is {}, not that of the key",
                camera.name()
            )));
        }
        if entry.size == 0 {
            return Err(wrong("size is 0, expected at least one pixel".to_owned()));
        }
        let roi = RoiRow {
            camera,
            image_number,
            x_start: entry.x_start,
            y_start: entry.y_start,
            size: entry.size,
        };
        // The specimen layout may repeat the region of a pose for each of its images.
        if let Some(other) = rois.insert((camera, image_number), roi.clone())
            && other != roi
        {
            let text = format!("pose {image_number} has two regions for {}", camera.name());
            return Err(wrong(text));
        }
    }
    Ok(rois)
}

/// The number of a pose, which both the entry and its key may state.
fn one_number(entry: Option<u32>, key: Option<u32>) -> Result<u32, String> {
    match (entry, key) {
        (Some(entry), Some(key)) if entry != key => Err(format!(
            "the entry is for pose {entry}, but its key is for pose {key}"
        )),
        (Some(number), _) | (None, Some(number)) => Ok(number),
        (None, None) => Err("neither key nor entry gives the number of the pose".to_owned()),
    }
}

/// A JSON object whose keys are all different; empty if the file is missing.
fn entries<T: DeserializeOwned>(path: &Path) -> Result<Vec<(String, T)>, FileError> {
    if !std::fs::exists(path).map_err(FileError::at("read", path))? {
        return Ok(Vec::new());
    }
    let text = read_text(path)?;
    let parsed: UniqueKeys<T> =
        serde_json::from_str(&text).map_err(|e| FileError::at("parse", path)(e.into()))?;
    Ok(parsed.0)
}

/// The entries of an object in order. A map would silently keep only the last of two entries with the same key.
struct UniqueKeys<T>(Vec<(String, T)>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for UniqueKeys<T> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(std::marker::PhantomData<T>);
        impl<'de, T: Deserialize<'de>> serde::de::Visitor<'de> for Entries<T> {
            type Value = UniqueKeys<T>;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("an object with one entry per image")
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(
                self,
                mut map: A,
            ) -> Result<Self::Value, A::Error> {
                let mut entries = BTreeMap::new();
                while let Some((key, value)) = map.next_entry::<String, T>()? {
                    if entries.contains_key(&key) {
                        let text = format!("the entry {key:?} is listed twice");
                        return Err(serde::de::Error::custom(text));
                    }
                    entries.insert(key, value);
                }
                Ok(UniqueKeys(entries.into_iter().collect()))
            }
        }
        deserializer.deserialize_map(Entries(std::marker::PhantomData))
    }
}
