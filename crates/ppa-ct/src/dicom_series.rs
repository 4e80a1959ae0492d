//! A folder of DICOM slices, or a single one, becomes a scan.

mod header;
mod open;
mod pixels;
mod rle;
mod stack;
mod stated;
mod syntax;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::scan::{Scan, SeriesSummary, Warning, WarningCode, hu_plausibility, starts_as_dicom};
use crate::volume::Volume;
use header::{Found, Series, Slice};
use stack::Stack;

/// Reads the one series in a folder, or below it when the folder itself has no DICOM file.
pub(crate) fn read_folder(folder: &Path) -> Result<Scan, ReadError> {
    let files = dicom_files(folder)?;
    let looked_at = files.len();
    let found = scan_headers(files.into_iter().filter(|(_, dicom)| *dicom).map(|f| f.0))?;
    assemble(folder, found, looked_at)
}

/// Reads a single slice.
pub(crate) fn read_file(file: &Path) -> Result<Scan, ReadError> {
    assemble(file, scan_headers([file.to_owned()])?, 1)
}

/// All files of a folder in the order of their names, and whether each starts as DICOM; where
/// none does, those of its subfolders too, since series are often handed over in a folder of
/// their own beside a licence or a viewer.
fn dicom_files(folder: &Path) -> Result<Vec<(PathBuf, bool)>, ReadError> {
    let io = |path: &Path, source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut files = Vec::new();
    let mut subfolders = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| io(folder, e))? {
        let entry = entry.map_err(|e| io(folder, e))?;
        let path = entry.path();
        if path.is_file() {
            let dicom = starts_as_dicom(&path).map_err(|e| io(&path, e))?;
            files.push((path, dicom));
        } else if entry.file_type().map_err(|e| io(&path, e))?.is_dir() {
            subfolders.push(path);
        }
    }
    files.sort();
    subfolders.sort();
    if files.iter().all(|(_, dicom)| !dicom) {
        for subfolder in subfolders {
            files.extend(dicom_files(&subfolder)?);
        }
    }
    Ok(files)
}

/// Reads all headers in parallel; of several errors, the first file's is reported.
fn scan_headers(files: impl IntoIterator<Item = PathBuf>) -> Result<Vec<Found>, ReadError> {
    let files = files.into_iter().collect::<Vec<_>>();
    let found = files.par_iter().map(|file| header::scan(file));
    // Collected before the errors are looked at: which one is first must not depend on threads.
    found.collect::<Vec<_>>().into_iter().collect()
}

fn assemble(source: &Path, found: Vec<Found>, looked_at: usize) -> Result<Scan, ReadError> {
    let Sorted {
        mut series,
        mut warnings,
        localizers,
    } = sort_out(found);
    let (summary, slices) = match series.len() {
        0 if localizers > 0 => {
            return Err(ReadError::OnlyLocalizers {
                path: source.to_owned(),
                localizers,
            });
        }
        0 => {
            return Err(ReadError::NoDicom {
                path: source.to_owned(),
                files: looked_at,
            });
        }
        1 => series.remove(0),
        _ => {
            return Err(ReadError::SeveralSeries {
                path: source.to_owned(),
                series: series.into_iter().map(|(summary, _)| summary).collect(),
            });
        }
    };
    if summary.modality.as_deref() != Some("CT") {
        return Err(ReadError::NotCt {
            modality: summary.modality.unwrap_or_else(|| "unknown".to_owned()),
            path: source.to_owned(),
        });
    }

    let stack = Stack::of(source, &slices)?;
    warnings.extend(stack.warnings());
    warnings.extend(rescale_warnings(&slices));
    let hu = decode(&slices, &stack)?;
    let unusable = |source_error| ReadError::Volume {
        path: source.to_owned(),
        source: source_error,
    };
    let grid = stack.grid().map_err(|e| unusable(e.into()))?;
    let volume = Volume::new(grid, hu).map_err(unusable)?;
    warnings.extend(hu_plausibility(&volume));
    Ok(Scan {
        volume,
        modality: summary.modality.clone(),
        series: vec![summary],
        acquisition: Acquisition::of_slices(slices.iter().map(|s| &s.stated)),
        warnings,
    })
}

/// What the files of a folder turned out to be.
struct Sorted {
    /// By series number, then by first file; slices are empty for modalities other than CT.
    series: Vec<(SeriesSummary, Vec<Slice>)>,
    warnings: Vec<Warning>,
    localizers: usize,
}

fn sort_out(found: Vec<Found>) -> Sorted {
    let mut by_uid = BTreeMap::<String, (usize, Series, usize, Vec<Slice>)>::new();
    let (mut localizers, mut others) = (0, 0);
    for (order, item) in found.into_iter().enumerate() {
        let (series, slice) = match item {
            Found::Localizer => {
                localizers += 1;
                continue;
            }
            Found::NotAnImage => {
                others += 1;
                continue;
            }
            Found::OtherModality(series) => (series, None),
            Found::Slice(series, slice) => (series, Some(slice)),
        };
        let (_, _, images, slices) = by_uid
            .entry(series.uid.clone())
            .or_insert_with(|| (order, series, 0, Vec::new()));
        *images += 1;
        slices.extend(slice.map(|slice| *slice));
    }
    let mut series = by_uid.into_values().collect::<Vec<_>>();
    series.sort_by_key(|(order, series, ..)| (series.number, *order));

    let mut warnings = Vec::new();
    if localizers > 0 {
        warnings.push(Warning {
            code: WarningCode::LocalizersDropped,
            text: format!("{localizers} localizer images (scout views) were left out"),
        });
    }
    if others > 0 {
        warnings.push(Warning {
            code: WarningCode::NonImagesDropped,
            text: format!("{others} DICOM objects that are no images were left out"),
        });
    }
    let series = series
        .into_iter()
        .map(|(_, series, images, slices)| {
            let summary = SeriesSummary {
                number: series.number,
                modality: series.modality,
                slices: images,
            };
            (summary, slices)
        })
        .collect();
    Sorted {
        series,
        warnings,
        localizers,
    }
}

fn rescale_warnings(slices: &[Slice]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let bare = slices.iter().filter(|s| s.rescale.is_none()).count();
    if bare > 0 {
        warnings.push(Warning {
            code: WarningCode::NoRescale,
            text: format!(
                "{bare} of {} slices have no rescale slope and intercept; stored values are taken as HU",
                slices.len()
            ),
        });
    }
    if let Some(other) = slices.iter().find_map(|s| s.foreign_unit.as_ref()) {
        warnings.push(Warning {
            code: WarningCode::NotHu,
            text: format!("the rescale type is {other}, not HU"),
        });
    }
    warnings
}

/// Decodes all slices in parallel, each into its place; the first slice's error is reported.
fn decode(slices: &[Slice], stack: &Stack) -> Result<Vec<f32>, ReadError> {
    let pixels = slices[0].rows * slices[0].columns;
    let mut hu = vec![0.0; pixels * slices.len()];
    let done = hu
        .par_chunks_mut(pixels)
        .zip(stack.order())
        .map(|(place, &index)| pixels::decode(&slices[index], place));
    done.collect::<Vec<_>>()
        .into_iter()
        .collect::<Result<(), _>>()?;
    Ok(hu)
}
