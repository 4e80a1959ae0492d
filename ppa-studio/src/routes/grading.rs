//! Grading by readers: the pictures of a key, one at a time, and a reader's grades.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, PoisonError};

use axum::Json;
use axum::extract::{Path, Query, State as Extracted};
use axum::response::Response;
use ppa_dataset::Manifest;
use ppa_label::{
    GradeSheet, Imported, PageError, ReaderCase, check_key, import_grades, read_key,
    reader_picture, write_key,
};
use serde::{Deserialize, Serialize};

use super::answer::{png_file, work};
use crate::commands::{GradingCommands, of_grading};
use crate::error::StudioError;
use crate::state::{State, named_folder};

/// A dataset and the folder for readers next to it.
#[derive(Deserialize)]
pub(super) struct Place {
    /// Name of the dataset's folder.
    folder: String,
    /// Name of the folder for readers; the key has the same name with `.key.csv` added.
    readers: String,
}

impl Place {
    fn root(&self, state: &State) -> Result<PathBuf, StudioError> {
        state.dataset(&self.folder)
    }

    /// Reads the list of the dataset's images.
    fn manifest(&self, state: &State) -> Result<Manifest, StudioError> {
        let root = self.root(state)?;
        if !root.join(Manifest::FILE).exists() {
            return Err(StudioError::NotMade(root));
        }
        Ok(Manifest::read(&root)?)
    }

    /// Returns the folder for readers.
    fn sheets(&self, state: &State) -> Result<PathBuf, StudioError> {
        let root = self.root(state)?;
        let beside = root.parent().unwrap_or(&root);
        let folder = named_folder(beside, &self.readers, "the dataset")?;
        if folder == root {
            return Err(StudioError::Invalid(format!(
                "{} is the dataset itself",
                self.readers
            )));
        }
        Ok(folder)
    }

    fn key(&self, state: &State) -> Result<PathBuf, StudioError> {
        let name = format!("{}.key.csv", self.readers);
        let key = self.sheets(state)?.with_file_name(name);
        if key.is_symlink() {
            return Err(StudioError::Invalid(format!("{} is a link", key.display())));
        }
        Ok(key)
    }
}

/// Request to begin or continue a reader's grading.
#[derive(Deserialize)]
pub(super) struct Begin {
    #[serde(flatten)]
    place: Place,
    reader: String,
    /// For a new key: poses at multiples of this angle. `seed` is that of names and order.
    every_deg: f64,
    seed: u64,
}

/// The pictures to grade, under meaningless names, and the grades so far.
#[derive(Serialize)]
pub(super) struct Grading {
    pictures: Vec<String>,
    grades: BTreeMap<String, f64>,
    /// The file of the grades.
    file: PathBuf,
    /// Whether the key existed already.
    key_found: bool,
    commands: GradingCommands,
}

/// Opens or makes the key of a folder for readers, and opens the grades of a reader.
pub(super) async fn begin(
    Extracted(state): Extracted<Arc<State>>,
    Json(begin): Json<Begin>,
) -> Result<Json<Grading>, Response> {
    work(state, move |state| {
        let Begin {
            place,
            reader,
            every_deg,
            seed,
        } = begin;
        let _turn = state.grading.lock().unwrap_or_else(PoisonError::into_inner);
        let (root, sheets, key) = (place.root(state)?, place.sheets(state)?, place.key(state)?);
        let manifest = place.manifest(state)?;
        let key_found = key.exists();
        let shown = if key_found {
            read_key(&key)?
        } else {
            if !(every_deg >= 0.5 && (2.0 * every_deg).fract() == 0.0) {
                return Err(StudioError::Invalid(format!(
                    "poses at multiples of {every_deg} degrees, expected a multiple of 0.5"
                )));
            }
            ReaderCase::of_dataset(&manifest, seed, every_deg)
        };
        if shown.is_empty() {
            return Err(PageError::Empty.into());
        }
        check_key(&manifest, &shown)?;
        let sheet = GradeSheet::open(&sheets, &reader, &shown)?;
        if !key_found {
            write_key(&key, &shown)?;
        }
        Ok(Json(Grading {
            pictures: shown.iter().map(|case| case.name.clone()).collect(),
            grades: sheet.grades().clone(),
            commands: of_grading(&root, &sheets, &key),
            file: sheet.path().to_owned(),
            key_found,
        }))
    })
    .await
}

/// Answers with the picture of a name, PNG.
pub(super) async fn picture(
    Extracted(state): Extracted<Arc<State>>,
    Path(name): Path<String>,
    Query(place): Query<Place>,
) -> Result<Response, Response> {
    let png = work(state, move |state| {
        let shown = read_key(&place.key(state)?)?;
        let case = shown.iter().find(|case| case.name == name);
        let case = case.ok_or_else(|| ppa_label::GradeSheetError::Unknown(name.clone()))?;
        Ok::<_, StudioError>(reader_picture(&place.root(state)?, case)?)
    })
    .await?;
    Ok(png_file(png))
}

/// A grade of a reader.
#[derive(Deserialize)]
pub(super) struct Given {
    #[serde(flatten)]
    place: Place,
    reader: String,
    image: String,
    grade: f64,
}

/// Writes a grade to the reader's file.
pub(super) async fn grade(
    Extracted(state): Extracted<Arc<State>>,
    Json(given): Json<Given>,
) -> Result<Json<()>, Response> {
    work(state, move |state| {
        let _turn = state.grading.lock().unwrap_or_else(PoisonError::into_inner);
        let place = &given.place;
        let shown = read_key(&place.key(state)?)?;
        let mut sheet = GradeSheet::open(&place.sheets(state)?, &given.reader, &shown)?;
        sheet.give(&given.image, given.grade)?;
        Ok(Json(()))
    })
    .await
}

/// Makes labels from the grades of all readers in the folder.
pub(super) async fn import(
    Extracted(state): Extracted<Arc<State>>,
    Json(place): Json<Place>,
) -> Result<Json<Imported>, Response> {
    work(state, move |state| {
        let _turn = state.grading.lock().unwrap_or_else(PoisonError::into_inner);
        let shown = read_key(&place.key(state)?)?;
        let manifest = place.manifest(state)?;
        let sheets = GradeSheet::files(&place.sheets(state)?)?;
        Ok(Json(import_grades(&manifest, &shown, &sheets)?))
    })
    .await
}
