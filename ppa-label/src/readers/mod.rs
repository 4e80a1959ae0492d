//! Labels by readers: the cases shown to them, and their grades.

mod grade_sheet;
mod grade_tables;
mod grades;
mod import;
mod import_error;
mod page;
mod reader_case;

pub use grade_sheet::{GradeSheet, GradeSheetError};
pub use grade_tables::{GradeRowError, GradeTablesError, GradesByImage, read_grade_tables};
pub use grades::{Grade, check_key};
pub use import::{Imported, import_grades};
pub use import_error::ImportError;
pub use page::{PICTURES_PER_PAGE, PageError, PageNumber, grading_page, reader_picture};
pub use reader_case::{ReaderCase, read_key, write_key};
