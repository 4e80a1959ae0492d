//! Grades by image and reader, from tables with any image names.

use std::collections::BTreeMap;
use std::path::PathBuf;

use ppa_dataset::is_formula;

use super::grades::{Grade, is_on_scale};
use crate::table::{TableError, read_table};

/// Why tables do not give the grades of images.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GradeTablesError {
    /// A file is not a table of grades.
    #[error(transparent)]
    Table(#[from] TableError),
    /// An invalid row.
    #[error("{}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// The error.
        source: GradeRowError,
    },
    /// A third grade of an image, more than a grade and its repeat.
    #[error("{}: {reader} grades {image} a third time, expected once or twice", path.display())]
    ThirdTime {
        /// The file.
        path: PathBuf,
        /// The reader.
        reader: String,
        /// The image.
        image: String,
    },
}

/// Why a row is not a grade of a reader.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GradeRowError {
    /// A grade off the scale.
    #[error("{reader} grades {image} as {grade}, expected 1, 1.5, 2, 2.5 or 3")]
    Grade {
        /// The reader.
        reader: String,
        /// The image.
        image: String,
        /// The grade.
        grade: f64,
    },
    /// A reader's name that spreadsheet programs would run as a formula.
    #[error("the reader's name is {0:?}, which spreadsheets interpret as a formula")]
    Formula(String),
}

/// For each image by name, the first grade of each reader by name, and the second, if any.
pub type GradesByImage = BTreeMap<String, BTreeMap<String, (f64, Option<f64>)>>;

/// Reads the first and second grades of images by reader.
///
/// `files` are tables with the columns image, reader, grade.
///
/// # Errors
/// [`GradeTablesError`] naming the file.
pub fn read_grade_tables(files: &[PathBuf]) -> Result<GradesByImage, GradeTablesError> {
    let mut by_image = GradesByImage::new();
    for path in files {
        for row in read_table::<Grade>(path)? {
            check(&row).map_err(|source| GradeTablesError::Row {
                path: path.clone(),
                source,
            })?;
            let of_image = by_image.entry(row.image.clone()).or_default();
            let Some((_, second)) = of_image.get_mut(&row.reader) else {
                of_image.insert(row.reader, (row.grade, None));
                continue;
            };
            if second.replace(row.grade).is_some() {
                return Err(GradeTablesError::ThirdTime {
                    path: path.clone(),
                    reader: row.reader,
                    image: row.image,
                });
            }
        }
    }
    Ok(by_image)
}

fn check(row: &Grade) -> Result<(), GradeRowError> {
    if !is_on_scale(row.grade) {
        return Err(GradeRowError::Grade {
            reader: row.reader.clone(),
            image: row.image.clone(),
            grade: row.grade,
        });
    }
    match is_formula(&row.reader) {
        false => Ok(()),
        true => Err(GradeRowError::Formula(row.reader.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_grade_is_a_repeat_and_a_third_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("grades.csv");
        let read = |rows: &str| {
            std::fs::write(&file, format!("image,reader,grade\n{rows}")).unwrap();
            read_grade_tables(std::slice::from_ref(&file))
        };
        let grades = read("x,a,1\nx,b,1.5\nx,a,2\n").unwrap();
        assert_eq!(grades["x"]["a"], (1.0, Some(2.0)));
        assert_eq!(grades["x"]["b"], (1.5, None));
        let refused = read("x,a,1\nx,a,1\nx,a,1\n").unwrap_err();
        assert!(matches!(refused, GradeTablesError::ThirdTime { .. }));
        for odd in ["x,a,1.2\n", "x,=a,1\n"] {
            let refused = read(odd).unwrap_err();
            assert!(
                matches!(refused, GradeTablesError::Row { .. }),
                "{refused:?}"
            );
        }
    }
}
