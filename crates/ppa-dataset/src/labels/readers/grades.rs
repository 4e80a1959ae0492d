//! Grades of readers: from their files to `grades.csv` and `labels.json` of a dataset.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::showing::Showing;
use crate::files::FileError;
use crate::labels::file::{LabelFile, LabelFileError};
use crate::labels::label::{LabelError, LabelRow, LabelSource};
use crate::labels::table::{TableError, read_table, write_table};
use crate::layout::LimbId;
use crate::manifest::{FileKind, FileRow, Manifest};

/// All grades of a dataset, as they were given.
const GRADES_FILE: &str = "grades.csv";

/// What a reader says of a radiograph; a row of `grades.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Grade {
    /// The name of a showing, or the radiograph itself, from the dataset's root.
    pub image: String,
    /// Who graded it.
    pub reader: String,
    /// From 1 (ideal) to 3 (inadequate) in half steps.
    pub grade: f64,
}

/// What [`import_grades`] did.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Imported {
    /// Readers.
    pub readers: usize,
    /// Radiographs that have a label now.
    pub labelled: usize,
    /// Second grades of a radiograph by one reader: kept, but without influence on the label.
    pub repeats: usize,
    /// Computed labels that gave way.
    pub replaced_computed: usize,
    /// Radiographs of the graded limbs that no reader graded; they have no label.
    pub without_label: usize,
}

/// Why grades do not become labels; nothing was written then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file of grades is none.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Off the scale.
    #[error("{}: {reader} grades {image} with {grade}, expected 1, 1.5, 2, 2.5 or 3", path.display())]
    Grade {
        /// The file.
        path: PathBuf,
        /// The reader.
        reader: String,
        /// The picture.
        image: String,
        /// The grade.
        grade: f64,
    },
    /// A picture that neither key nor dataset know.
    #[error("{}: {image} is neither a picture of the key nor a radiograph of the dataset", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// The picture.
        image: String,
    },
    /// The dataset has changed since the readers saw it.
    #[error("{0} is not the radiograph that the readers saw: its hash is not that of the key")]
    Changed(String),
    /// One picture graded twice, a radiograph a third time, or in two files.
    #[error("{reader} grades {image} in {} and again in {}", first.display(), second.display())]
    Twice {
        /// The reader.
        reader: String,
        /// The picture or radiograph.
        image: String,
        /// A file.
        first: PathBuf,
        /// Another one, or the same.
        second: PathBuf,
    },
    /// Grades that are there would be lost.
    #[error("{} holds {reader}'s grade of {image}, which none of the given files does: give {} as well", path.display(), path.display())]
    Lost {
        /// `grades.csv` of the dataset.
        path: PathBuf,
        /// The reader.
        reader: String,
        /// The radiograph.
        image: String,
    },
    /// Labels that are there are none.
    #[error(transparent)]
    Labels(#[from] LabelFileError),
    /// A label off the grid.
    #[error(transparent)]
    Label(#[from] LabelError),
}

/// A grade with the file that holds it and the place of its picture among those shown.
struct Given<'a> {
    grade: Grade,
    file: &'a Path,
    radiograph: &'a FileRow,
    place: usize,
}

/// Makes the labels of a dataset from readers' grades: mean and standard deviation (ddof 0) over the readers' first grades.
///
/// `files` are tables with the columns image, reader, grade, where image is a name of the key `shown` or a radiograph
/// of the dataset. All grades are kept in `grades.csv`, so that further ones can be added by giving that file as well.
/// Readers' labels take the place of computed ones, for whole limbs: the two never stand in one `labels.json`.
///
/// # Errors
/// [`ImportError`], before anything is written: grades off the scale, unknown pictures, radiographs that changed since
/// the key was made, two grades of one picture, and files without the grades that are there.
pub fn import_grades(
    manifest: &Manifest,
    shown: &[Showing],
    files: &[PathBuf],
) -> Result<Imported, ImportError> {
    let given = Pictures::of(manifest, shown)?.all_of(files)?;
    let path = manifest.root.join(GRADES_FILE);
    refuse_loss(&path, &given)?;

    let mut limbs: BTreeMap<LimbId, BTreeMap<u32, Vec<f64>>> = BTreeMap::new();
    let mut seen = HashSet::new();
    for given in &given {
        if seen.insert((&given.grade.reader, &given.radiograph.file)) {
            let of_limb = limbs.entry(given.radiograph.limb).or_default();
            let grades = of_limb.entry(given.radiograph.step).or_default();
            grades.push(given.grade.grade);
        }
    }
    let readers: HashSet<_> = given.iter().map(|given| &given.grade.reader).collect();
    let mut done = Imported {
        readers: readers.len(),
        repeats: given.len() - seen.len(),
        ..Imported::default()
    };
    let mut labels = Vec::new();
    for (limb, steps) in &limbs {
        if let Some(before) = LabelFile::read(&manifest.root, *limb)?
            && before.source == Some(LabelSource::Surrogate)
        {
            done.replaced_computed += before.labels().len();
        }
        let radiographs = manifest.files.iter();
        let radiographs =
            radiographs.filter(|row| row.kind == FileKind::Radiograph && row.limb == *limb);
        done.without_label += radiographs.count() - steps.len();
        done.labelled += steps.len();
        let rows = steps.iter();
        let rows = rows.filter_map(|(&step, grades)| LabelRow::of_grades(grades, step));
        labels.push((*limb, LabelFile::new(LabelSource::Readers, rows)?));
    }

    let kept: Vec<Grade> = given.into_iter().map(Given::by_radiograph).collect();
    write_table(&path, &kept)?;
    for (limb, labels) in labels {
        labels.write(&manifest.root, limb)?;
    }
    Ok(done)
}

impl Given<'_> {
    fn by_radiograph(self) -> Grade {
        Grade {
            image: self.radiograph.file.clone(),
            ..self.grade
        }
    }
}

/// What pictures may be graded.
struct Pictures<'a> {
    radiographs: HashMap<&'a str, &'a FileRow>,
    /// By name: place among those shown, and radiograph.
    shown: HashMap<&'a str, (usize, &'a FileRow)>,
}

impl<'a> Pictures<'a> {
    fn of(manifest: &'a Manifest, shown: &'a [Showing]) -> Result<Self, ImportError> {
        let rows = manifest.files.iter();
        let radiographs: HashMap<_, _> = rows
            .filter(|row| row.kind == FileKind::Radiograph)
            .map(|row| (row.file.as_str(), row))
            .collect();
        let place = |(place, showing): (usize, &'a Showing)| {
            let found = radiographs.get(showing.image.as_str());
            match found.filter(|row| row.sha256 == showing.sha256) {
                Some(&row) => Ok((showing.name.as_str(), (place, row))),
                None => Err(ImportError::Changed(showing.image.clone())),
            }
        };
        let shown = shown.iter().enumerate().map(place);
        Ok(Self {
            shown: shown.collect::<Result<_, _>>()?,
            radiographs,
        })
    }

    /// The grades of several files: by reader, for each in the order of showing.
    fn all_of(&self, files: &'a [PathBuf]) -> Result<Vec<Given<'a>>, ImportError> {
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
        let mut times: HashMap<(&str, &str), (u32, &Path)> = HashMap::new();
        let mut names = HashSet::new();
        for given in &all {
            let reader = given.grade.reader.as_str();
            let (times, first) = times
                .entry((reader, &given.radiograph.file))
                .or_insert((0, given.file));
            *times += 1;
            let by_name = given.place < usize::MAX;
            let again = by_name && !names.insert((reader, given.grade.image.as_str()));
            if again || *times > 2 || *first != given.file {
                return Err(ImportError::Twice {
                    reader: reader.to_owned(),
                    image: given.grade.image.clone(),
                    first: first.to_owned(),
                    second: given.file.to_owned(),
                });
            }
        }
        Ok(all)
    }

    fn find(&self, grade: Grade, file: &'a Path) -> Result<Given<'a>, ImportError> {
        let found = self.shown.get(grade.image.as_str()).copied();
        let itself = || Some((usize::MAX, *self.radiographs.get(grade.image.as_str())?));
        match found.or_else(itself) {
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

fn read_grades(path: &Path) -> Result<Vec<Grade>, ImportError> {
    let grades: Vec<Grade> = read_table(path)?;
    let on_scale = |grade: f64| (1.0..=3.0).contains(&grade) && (2.0 * grade).fract() == 0.0;
    match grades.iter().find(|row| !on_scale(row.grade)) {
        None => Ok(grades),
        Some(wrong) => Err(ImportError::Grade {
            path: path.to_owned(),
            reader: wrong.reader.clone(),
            image: wrong.image.clone(),
            grade: wrong.grade,
        }),
    }
}

/// Refuses to write over grades that are not among those given.
fn refuse_loss(path: &Path, given: &[Given]) -> Result<(), ImportError> {
    if !path.try_exists().map_err(FileError::at("read", path))? {
        return Ok(());
    }
    let given: HashSet<_> = given
        .iter()
        .map(|given| (&given.grade.reader, &given.radiograph.file))
        .collect();
    let before = read_grades(path)?;
    let lost = |old: &&Grade| !given.contains(&(&old.reader, &old.image));
    match before.iter().find(lost) {
        None => Ok(()),
        Some(lost) => Err(ImportError::Lost {
            path: path.to_owned(),
            reader: lost.reader.clone(),
            image: lost.image.clone(),
        }),
    }
}
