//! Grades of readers, and the radiographs they refer to.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use ppa_dataset::is_formula;
use ppa_dataset::manifest::{FileKind, FileRow, Manifest};
use serde::{Deserialize, Serialize};

use super::import_error::ImportError;
use super::reader_case::ReaderCase;
use crate::table::read_table;

/// A reader's grade of a radiograph; a row of `grades.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Grade {
    /// The name of a reader case, or the path of the radiograph from the dataset's root.
    pub image: String,
    /// The reader who gave it.
    pub reader: String,
    /// From 1 (ideal) to 3 (inadequate) in half steps.
    pub grade: f64,
    /// SHA-256 of the radiograph as it was graded; may be missing in readers' files.
    #[serde(default)]
    pub sha256: Option<String>,
}

/// A grade with its file and the position of its picture among those shown.
pub(super) struct Given<'a> {
    pub grade: Grade,
    file: &'a Path,
    pub radiograph: &'a FileRow,
    place: usize,
}

impl Given<'_> {
    /// Whether it was given to a picture of the key.
    fn by_name(&self) -> bool {
        self.place < usize::MAX
    }

    /// The grade as stored: it names the radiograph and its hash.
    pub fn by_radiograph(&self) -> Grade {
        Grade {
            image: self.radiograph.file.clone(),
            sha256: Some(self.radiograph.sha256.clone()),
            ..self.grade.clone()
        }
    }
}

/// The pictures that may be graded.
pub(super) struct Pictures<'a> {
    radiographs: HashMap<&'a str, &'a FileRow>,
    /// By name: position among those shown, and radiograph.
    shown: HashMap<&'a str, (usize, &'a FileRow)>,
}

impl<'a> Pictures<'a> {
    pub fn of(manifest: &'a Manifest, shown: &'a [ReaderCase]) -> Result<Self, ImportError> {
        let rows = manifest.files.iter();
        let radiographs: HashMap<_, _> = rows
            .filter(|row| row.kind == FileKind::Radiograph)
            .map(|row| (row.file.as_str(), row))
            .collect();
        let place = |(place, reader_case): (usize, &'a ReaderCase)| {
            let found = radiographs.get(reader_case.image.as_str());
            match found.filter(|row| row.sha256 == reader_case.sha256) {
                Some(&row) => Ok((reader_case.name.as_str(), (place, row))),
                None => Err(ImportError::Changed(reader_case.image.clone())),
            }
        };
        let shown = shown.iter().enumerate().map(place);
        Ok(Self {
            shown: shown.collect::<Result<_, _>>()?,
            radiographs,
        })
    }

    /// The grades of several files, sorted by reader and the order of the reader cases.
    pub fn all_of<'f>(&self, files: &'f [PathBuf]) -> Result<Vec<Given<'f>>, ImportError>
    where
        'a: 'f,
    {
        let mut all = Vec::new();
        for file in files {
            for grade in read_grades(file)? {
                all.push(self.find(grade, file)?);
            }
        }
        // The sort is stable: grades of radiographs keep the order of their file.
        all.sort_by(|a, b| {
            let by_reader = a.grade.reader.cmp(&b.grade.reader);
            by_reader.then(a.place.cmp(&b.place))
        });
        let mut times: HashMap<(&str, &str), (u32, &Given)> = HashMap::new();
        let mut names = HashSet::new();
        for given in &all {
            let reader = given.grade.reader.as_str();
            let (times, first) = times
                .entry((reader, &given.radiograph.file))
                .or_insert((0, given));
            *times += 1;
            let again = given.by_name() && !names.insert((reader, given.grade.image.as_str()));
            // The pages of one export show a picture and its repeat, each saved to its own file.
            let elsewhere = first.file != given.file && !(first.by_name() && given.by_name());
            if again || *times > 2 || elsewhere {
                return Err(ImportError::Twice {
                    reader: reader.to_owned(),
                    image: given.grade.image.clone(),
                    first: first.file.to_owned(),
                    second: given.file.to_owned(),
                });
            }
        }
        Ok(all)
    }

    fn find<'f>(&self, grade: Grade, file: &'f Path) -> Result<Given<'f>, ImportError>
    where
        'a: 'f,
    {
        let found = self.shown.get(grade.image.as_str()).copied();
        let itself = || Some((usize::MAX, *self.radiographs.get(grade.image.as_str())?));
        match found.or_else(itself) {
            Some((_, row))
                if grade
                    .sha256
                    .as_ref()
                    .is_some_and(|hash| *hash != row.sha256) =>
            {
                Err(ImportError::OtherRadiograph {
                    path: file.to_owned(),
                    reader: grade.reader,
                    image: row.file.clone(),
                    found: grade.sha256.unwrap_or_default(),
                    expected: row.sha256.clone(),
                })
            }
            Some((place, radiograph)) => Ok(Given {
                grade,
                file,
                radiograph,
                place,
            }),
            None => Err(ImportError::Unknown {
                path: file.to_owned(),
                image: grade.image,
            }),
        }
    }
}

/// Whether a grade is from 1 (ideal) to 3 (inadequate) in half steps.
pub(super) fn is_on_scale(grade: f64) -> bool {
    (1.0..=3.0).contains(&grade) && (2.0 * grade).fract() == 0.0
}

/// Checks that a key belongs to the radiographs of a dataset.
///
/// # Errors
/// [`ImportError::Changed`] naming the first radiograph that is missing in the dataset or has another hash.
pub fn check_key(manifest: &Manifest, shown: &[ReaderCase]) -> Result<(), ImportError> {
    Pictures::of(manifest, shown).map(|_| ())
}

pub(super) fn read_grades(path: &Path) -> Result<Vec<Grade>, ImportError> {
    let grades: Vec<Grade> = read_table(path)?;
    if let Some(row) = grades.iter().find(|row| is_formula(&row.reader)) {
        return Err(ImportError::Formula {
            path: path.to_owned(),
            reader: row.reader.clone(),
        });
    }
    match grades.iter().find(|row| !is_on_scale(row.grade)) {
        None => Ok(grades),
        Some(wrong) => Err(ImportError::Grade {
            path: path.to_owned(),
            reader: wrong.reader.clone(),
            image: wrong.image.clone(),
            grade: wrong.grade,
        }),
    }
}
