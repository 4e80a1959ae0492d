//! Import of readers' files to `grades.csv` and `labels.json` of a dataset.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use ppa_dataset::checksums::Checksums;
use ppa_dataset::files::{FileError, write_whole};
use ppa_dataset::labels::{LabelFile, LabelRow, LabelSource};
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::{FileKind, FileRow, Manifest};
use serde::Serialize;

use super::grades::{Given, Pictures};
use super::import_error::ImportError;
use super::reader_case::ReaderCase;
use crate::table::write_table;

/// All grades of a dataset as given.
const GRADES_FILE: &str = "grades.csv";

/// Summary of [`import_grades`].
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Imported {
    /// Readers.
    pub readers: usize,
    /// Radiographs that now have a readers' label.
    pub labelled: usize,
    /// Second grades of a radiograph by one reader: kept, but they do not affect the label.
    pub repeats: usize,
    /// Computed labels replaced by readers' in `labels.json`; they are kept in `labels.computed.json`.
    pub replaced_computed: usize,
    /// Radiographs of the graded limbs that no reader graded and that keep their computed label.
    pub kept_computed: usize,
    /// Radiographs of the graded limbs without any label.
    pub without_label: usize,
}

/// Computes the labels of a dataset from readers' grades: mean and standard deviation (ddof 0) over the readers' first grades.
///
/// `files` are tables with the columns image, reader, grade, where image is a name in the key `shown` or a radiograph
/// of the dataset. All grades are kept in `grades.csv` with the hash of their radiograph, so that more can be added later by
/// giving that file as well. Readers' labels replace computed ones, which are kept in `labels.computed.json`; radiographs without a
/// readers' grade keep their computed label.
///
/// # Errors
/// [`ImportError`], before anything is written: no grades, grades off the scale, unknown pictures, radiographs that changed since
/// the key was made or the grades were imported, two grades of one picture, files that lack existing grades, and existing labels
/// of readers without their grades.
pub fn import_grades(
    manifest: &Manifest,
    shown: &[ReaderCase],
    files: &[PathBuf],
) -> Result<Imported, ImportError> {
    let path = manifest.root.join(GRADES_FILE);
    let there = path.try_exists().map_err(FileError::at("read", &path))?;
    let kept = [path.clone()];
    let pictures = Pictures::of(manifest, shown)?;
    let before = pictures.all_of(if there { &kept } else { &[] })?;
    let given = pictures.all_of(files)?;
    if given.is_empty() {
        return Err(ImportError::Empty);
    }
    refuse_loss(&path, &before, &given)?;

    let readers: HashSet<_> = given.iter().map(|given| &given.grade.reader).collect();
    let mut done = Imported {
        readers: readers.len(),
        ..Imported::default()
    };
    let limbs = label_rows(&given);
    let rows_before = label_rows(&before);
    let mut labels = Vec::new();
    for (&limb, rows) in &limbs {
        let root = &manifest.root;
        let before = LabelFile::read(root, limb)?.unwrap_or_default();
        let of_readers = before.not_computed().labels();
        if !of_readers.is_empty()
            && ![rows_before.get(&limb), Some(rows)].contains(&Some(&of_readers))
        {
            return Err(ImportError::OtherLabels(LabelFile::path(root, limb)));
        }
        let file = LabelFile::new(LabelSource::Readers, rows.iter().copied())?;
        let file = file.of_radiographs(manifest, limb);
        // Earlier versions stored no separate file of computed labels.
        let (computed, has_file) = match LabelFile::read_computed(root, limb)? {
            Some(computed) => (computed, true),
            None => (before.computed(), false),
        };
        let graded = |row: &&LabelRow| file.of_step(row.step).is_some();
        let given_way = computed.labels().iter().filter(graded).count();
        let file = file.over(&computed);
        let bare = |row: &&FileRow| file.of_step(row.step).is_none();
        let radiographs = manifest.files.iter();
        let radiographs =
            radiographs.filter(|row| row.kind == FileKind::Radiograph && row.limb == limb);
        done.without_label += radiographs.filter(bare).count();
        done.labelled += rows.len();
        done.replaced_computed += given_way;
        done.kept_computed += computed.labels().len() - given_way;
        let computed = (!has_file && !computed.labels().is_empty()).then_some(computed);
        labels.push((limb, file, computed));
    }
    done.repeats = given.len() - firsts(&given).count();

    // Grades are written last: an interrupted import leaves the former grades, and labels that follow from them or from the new ones.
    let mut written = Vec::new();
    for (limb, labels, computed) in labels {
        if let Some(computed) = computed {
            let path = LabelFile::computed_path(&manifest.root, limb);
            write_whole(&path, computed.to_text().as_bytes())?;
            written.push(path);
        }
        labels.write(&manifest.root, limb)?;
        written.push(LabelFile::path(&manifest.root, limb));
    }
    let grades: Vec<_> = given.iter().map(Given::by_radiograph).collect();
    write_table(&path, &grades)?;
    written.push(path);
    Checksums::record_labels(&manifest.root, &written)?;
    Ok(done)
}

/// The first grade of each radiograph by each reader.
fn firsts<'a>(given: &'a [Given]) -> impl Iterator<Item = &'a Given<'a>> {
    let mut seen = HashSet::new();
    given
        .iter()
        .filter(move |given| seen.insert((&given.grade.reader, &given.radiograph.file)))
}

/// Labels by limb, lowest step first.
fn label_rows(given: &[Given]) -> BTreeMap<LimbId, Vec<LabelRow>> {
    let mut limbs: BTreeMap<LimbId, BTreeMap<u32, Vec<f64>>> = BTreeMap::new();
    for given in firsts(given) {
        let of_limb = limbs.entry(given.radiograph.limb).or_default();
        let grades = of_limb.entry(given.radiograph.step).or_default();
        grades.push(given.grade.grade);
    }
    let rows = |steps: BTreeMap<u32, Vec<f64>>| {
        let rows = steps.into_iter();
        rows.filter_map(|(step, grades)| LabelRow::of_grades(&grades, step))
            .collect()
    };
    limbs
        .into_iter()
        .map(|(limb, steps)| (limb, rows(steps)))
        .collect()
}

/// Rejects an import that would lose existing grades; each must be given as often as it exists.
fn refuse_loss(path: &Path, before: &[Given], given: &[Given]) -> Result<(), ImportError> {
    let key = |given: &Given| {
        let half_steps = (2.0 * given.grade.grade) as u32;
        (
            given.grade.reader.clone(),
            given.radiograph.file.clone(),
            half_steps,
        )
    };
    let mut times: HashMap<_, u32> = HashMap::new();
    for given in given {
        *times.entry(key(given)).or_default() += 1;
    }
    for old in before {
        match times.get_mut(&key(old)) {
            Some(left @ 1..) => *left -= 1,
            _ => {
                return Err(ImportError::Lost {
                    path: path.to_owned(),
                    reader: old.grade.reader.clone(),
                    image: old.radiograph.file.clone(),
                    grade: old.grade.grade,
                });
            }
        }
    }
    Ok(())
}
