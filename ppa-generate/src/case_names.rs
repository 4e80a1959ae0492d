//! Names of files next to a case or a dataset.

use std::path::{Path, PathBuf};

use ppa_dataset::archive::is_archive;

/// Path where changes of a case are saved until they replace it: `leg.edited.case.toml` for `leg.case.toml`.
pub fn edited_case(original: &Path) -> PathBuf {
    beside_case(original, "edited.case.toml")
}

/// The case that a file with changes belongs to; `None` for any other file.
pub fn original_case(edited: &Path) -> Option<PathBuf> {
    let name = edited.file_name()?.to_str()?;
    let stem = name.strip_suffix(".edited.case.toml")?;
    Some(edited.with_file_name(format!("{stem}.case.toml")))
}

/// A file next to a case, named after it: `leg.case.toml` and `plan.toml` give `leg.plan.toml`.
pub fn beside_case(case: &Path, ending: &str) -> PathBuf {
    let name = case.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".toml").unwrap_or(&name);
    let stem = stem.strip_suffix(".case").unwrap_or(stem);
    case.with_file_name(format!("{stem}.{ending}"))
}

/// The plan next to a dataset, named after its folder or archive: `ankles.toml` for `ankles` and `ankles.tar`. It need not exist.
pub fn plan_of_dataset(dataset: &Path) -> PathBuf {
    // Such as `.`.
    let unnamed = dataset.file_name().is_none();
    let whole = unnamed.then(|| dataset.canonicalize().ok()).flatten();
    let dataset = whole.as_deref().unwrap_or(dataset);
    let stem = if is_archive(dataset) {
        dataset.file_stem()
    } else {
        dataset.file_name()
    };
    let mut name = stem.unwrap_or_default().to_owned();
    name.push(".toml");
    dataset.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_have_the_whole_name_of_their_dataset() {
        for (dataset, plan) in [
            ("ankles", "ankles.toml"),
            ("ankles.tar", "ankles.toml"),
            ("small.plan", "small.plan.toml"),
            ("a/cohort_v1.2.tar", "a/cohort_v1.2.toml"),
        ] {
            assert_eq!(plan_of_dataset(Path::new(dataset)), Path::new(plan));
        }
        let mut here = std::env::current_dir().unwrap().into_os_string();
        here.push(".toml");
        assert_eq!(plan_of_dataset(Path::new(".")), Path::new(&here));
    }

    #[test]
    fn changes_are_named_after_the_case() {
        let edited = |name: &str| edited_case(Path::new(name));
        let expected = Path::new("a/leg.edited.case.toml");
        assert_eq!(edited("a/leg.case.toml"), expected);
        assert_eq!(edited("leg.toml"), Path::new("leg.edited.case.toml"));
        assert_eq!(
            original_case(expected).unwrap(),
            Path::new("a/leg.case.toml")
        );
        assert_eq!(original_case(Path::new("leg.case.toml")), None);
    }
}
