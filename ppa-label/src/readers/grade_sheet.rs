//! The grades of one reader, saved to a file during grading.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ppa_dataset::files::{FileError, read_text};
use ppa_dataset::is_formula;
use serde::Serialize;

use super::grades::{is_on_scale, read_grades};
use super::import_error::ImportError;
use super::reader_case::ReaderCase;
use crate::table::write_table;

/// Why a grade is rejected, or the existing grades cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GradeSheetError {
    /// A name without a letter or digit, or one that spreadsheet programs would run as a formula.
    #[error(
        "the reader's name is {0:?}; it needs a letter or a digit and must not begin with = + - or @"
    )]
    Reader(String),
    /// A grade off the scale.
    #[error("a grade is {0}, expected 1, 1.5, 2, 2.5 or 3")]
    Grade(f64),
    /// A picture that is not in the key.
    #[error("{0} is not a picture in the key")]
    Unknown(String),
    /// The file belongs to another reader.
    #[error("{} holds grades of {found}, expected those of {expected}", path.display())]
    OtherReader {
        /// The file.
        path: PathBuf,
        /// The reader in the file.
        found: String,
        /// The reader who grades.
        expected: String,
    },
    /// The file has other columns, which the next grade would remove.
    #[error("{} has the columns {found}, expected image,reader,grade", path.display())]
    Columns {
        /// The file.
        path: PathBuf,
        /// Its first line.
        found: String,
    },
    /// The file holds something other than grades of pictures in the key.
    #[error(transparent)]
    Grades(#[from] ImportError),
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// The grades that one reader has given to the pictures of a key so far.
///
/// They are stored in `grades_NAME.csv` in the folder for readers. Name and columns are those of the file saved by a
/// [`grading_page`](super::grading_page) with all pictures; [`import_grades`](super::import_grades) accepts the file at any time.
#[derive(Debug)]
pub struct GradeSheet<'a> {
    shown: &'a [ReaderCase],
    path: PathBuf,
    reader: String,
    grades: BTreeMap<String, f64>,
}

/// First line of the file.
const COLUMNS: &str = "image,reader,grade";

/// A row of the file.
#[derive(Serialize)]
struct Row<'a> {
    image: &'a str,
    reader: &'a str,
    grade: f64,
}

impl<'a> GradeSheet<'a> {
    /// Opens the grades of `reader` in a folder for readers; none if there is no file yet.
    ///
    /// # Errors
    /// [`GradeSheetError`] for an invalid name, and a file that contains anything but grades of this reader for pictures in
    /// the key.
    pub fn open(
        folder: &Path,
        reader: &str,
        shown: &'a [ReaderCase],
    ) -> Result<Self, GradeSheetError> {
        let reader = reader.trim();
        if is_formula(reader) || !reader.contains(char::is_alphanumeric) {
            return Err(GradeSheetError::Reader(reader.to_owned()));
        }
        let mut sheet = Self {
            shown,
            path: folder.join(file_name(reader)),
            reader: reader.to_owned(),
            grades: BTreeMap::new(),
        };
        let path = &sheet.path;
        if !path.try_exists().map_err(FileError::at("read", path))? {
            return Ok(sheet);
        }
        let text = read_text(path)?;
        let columns = text.lines().next().unwrap_or_default();
        if columns != COLUMNS {
            return Err(GradeSheetError::Columns {
                path: path.clone(),
                found: columns.to_owned(),
            });
        }
        for row in read_grades(path)? {
            if row.reader != sheet.reader {
                return Err(GradeSheetError::OtherReader {
                    path: path.clone(),
                    found: row.reader,
                    expected: sheet.reader,
                });
            }
            let path = path.clone();
            if !sheet.shows(&row.image) {
                let image = row.image;
                return Err(ImportError::Unknown { path, image }.into());
            }
            if sheet.grades.contains_key(&row.image) {
                return Err(ImportError::Twice {
                    reader: row.reader,
                    image: row.image,
                    first: path.clone(),
                    second: path,
                }
                .into());
            }
            sheet.grades.insert(row.image, row.grade);
        }
        Ok(sheet)
    }

    /// The files of all readers in a folder, sorted by name.
    ///
    /// # Errors
    /// [`FileError`] when the folder cannot be read.
    pub fn files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        let entries = std::fs::read_dir(folder).map_err(FileError::at("read", folder))?;
        let mut files = Vec::new();
        for entry in entries {
            let name = entry.map_err(FileError::at("read", folder))?.file_name();
            let is_sheet = |name: &str| name.starts_with("grades_") && name.ends_with(".csv");
            if name.to_str().is_some_and(is_sheet) {
                files.push(folder.join(name));
            }
        }
        files.sort();
        Ok(files)
    }

    fn shows(&self, image: &str) -> bool {
        self.shown.iter().any(|case| case.name == image)
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Grades by the names of their pictures.
    pub fn grades(&self) -> &BTreeMap<String, f64> {
        &self.grades
    }

    /// Sets the grade of a picture, replacing an earlier one, and writes the file in the order of the key.
    ///
    /// # Errors
    /// [`GradeSheetError`] for a picture that is not in the key, a grade off the scale, and a file that cannot be written; the file is
    /// then unchanged.
    pub fn give(&mut self, image: &str, grade: f64) -> Result<(), GradeSheetError> {
        if !self.shows(image) {
            return Err(GradeSheetError::Unknown(image.to_owned()));
        }
        if !is_on_scale(grade) {
            return Err(GradeSheetError::Grade(grade));
        }
        let mut grades = self.grades.clone();
        grades.insert(image.to_owned(), grade);
        let row = |case: &'a ReaderCase| {
            let grade = *grades.get(&case.name)?;
            Some(Row {
                image: &case.name,
                reader: &self.reader,
                grade,
            })
        };
        let rows: Vec<Row> = self.shown.iter().filter_map(row).collect();
        write_table(&self.path, &rows)?;
        self.grades = grades;
        Ok(())
    }
}

/// `grades_NAME.csv`, with one underscore for each run of characters that are neither letters nor digits, as in `page.html`.
fn file_name(reader: &str) -> String {
    let mut name = "grades_".to_owned();
    let mut replaced = false;
    for c in reader.chars() {
        let keep = c.is_alphanumeric();
        if keep || !replaced {
            name.push(if keep { c } else { '_' });
        }
        replaced = !keep;
    }
    name + ".csv"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown() -> Vec<ReaderCase> {
        let case = |name: &str| ReaderCase {
            name: name.to_owned(),
            image: format!("{name}.png"),
            sha256: String::new(),
        };
        ["b", "a", "c"].map(case).to_vec()
    }

    #[test]
    fn grades_are_kept_in_the_order_of_the_key() {
        let folder = tempfile::tempdir().unwrap();
        let shown = shown();
        let mut sheet = GradeSheet::open(folder.path(), " Anna M. ", &shown).unwrap();
        assert!(sheet.grades().is_empty());
        for (image, grade) in [("c", 3.0), ("b", 1.5), ("c", 2.0)] {
            sheet.give(image, grade).unwrap();
        }
        assert_eq!(sheet.path(), folder.path().join("grades_Anna_M_.csv"));
        let text = std::fs::read_to_string(sheet.path()).unwrap();
        assert_eq!(text, "image,reader,grade\nb,Anna M.,1.5\nc,Anna M.,2.0\n");
        let again = GradeSheet::open(folder.path(), "Anna M.", &shown).unwrap();
        assert_eq!(again.grades(), sheet.grades());
        std::fs::write(folder.path().join("grading.html"), "").unwrap();
        assert_eq!(GradeSheet::files(folder.path()).unwrap(), [sheet.path()]);
    }

    #[test]
    fn a_refused_grade_leaves_the_file_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let shown = shown();
        let mut sheet = GradeSheet::open(folder.path(), "anna", &shown).unwrap();
        let refused = sheet.give("d", 1.0).unwrap_err();
        assert!(matches!(refused, GradeSheetError::Unknown(_)));
        for grade in [1.2, 0.5, 3.5, f64::NAN] {
            let refused = sheet.give("a", grade).unwrap_err();
            assert!(matches!(refused, GradeSheetError::Grade(_)));
        }
        assert!(!sheet.path().exists());
    }

    #[test]
    fn a_grade_that_is_not_written_is_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let shown = shown();
        let readers = folder.path().join("readers");
        let mut sheet = GradeSheet::open(&readers, "anna", &shown).unwrap();
        std::fs::write(&readers, "in the way of the folder").unwrap();
        let refused = sheet.give("a", 1.0).unwrap_err();
        assert!(matches!(refused, GradeSheetError::File(_)));
        assert!(sheet.grades().is_empty());
    }

    #[test]
    fn a_file_of_anything_else_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let shown = shown();
        let open = |reader: &str| GradeSheet::open(folder.path(), reader, &shown);
        for name in ["", " ", "...", "=anna", "@a"] {
            assert!(
                matches!(open(name), Err(GradeSheetError::Reader(_))),
                "{name:?}"
            );
        }
        // Both names give the same file name.
        open("anna m").unwrap().give("a", 1.0).unwrap();
        assert!(matches!(
            open("anna.m"),
            Err(GradeSheetError::OtherReader { .. })
        ));
        for rows in ["d,ben,1", "a,ben,1\na,ben,2", "a,ben,1.2", "a,ben"] {
            let text = format!("image,reader,grade\n{rows}\n");
            std::fs::write(folder.path().join("grades_ben.csv"), text).unwrap();
            assert!(
                matches!(open("ben"), Err(GradeSheetError::Grades(_))),
                "{rows}"
            );
        }
        let remarked = "image,reader,grade,remark\na,ben,1,blurred\n";
        std::fs::write(folder.path().join("grades_ben.csv"), remarked).unwrap();
        let refused = open("ben");
        assert!(matches!(refused, Err(GradeSheetError::Columns { .. })));
    }
}
