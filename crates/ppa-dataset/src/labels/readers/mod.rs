//! Labels of readers: what they are shown, and what becomes of their grades.

mod grades;
mod page;
mod showing;

pub use grades::{Grade, ImportError, Imported, import_grades};
pub use page::{PageError, grading_page};
pub use showing::{Showing, read_key, write_key};
