//! A folder of DICOM slices, or a single file, becomes a scan.

mod attributes;
mod codec;
mod defined_terms;
mod element;
mod file;
mod fragments;
mod frame;
mod header;
mod pixels;
mod series;
mod stack;
mod stated;
mod stored;
mod syntax;

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::scan::{ReadOptions, Scan, Warning, WarningCode, hu_plausibility, starts_as_dicom};
use crate::values::Voxels;
use crate::volume::Volume;
use header::{Found, Slice};
use series::Sorted;
use stack::{Between, Stack};
use stored::StoredFormat;

/// Reads one series in a folder, or below it when the folder itself has no DICOM file.
pub(crate) fn read_folder(folder: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    let files = dicom_files(folder)?;
    let looked_at = files.len();
    let dicom = files.into_iter().filter(|(_, dicom)| *dicom).map(|f| f.0);
    assemble(folder, scan_headers(dicom, options)?, looked_at, options)
}

/// Reads a single file of one or more slices.
pub(crate) fn read_file(file: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    assemble(file, scan_headers([file.to_owned()], options)?, 1, options)
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
fn scan_headers(
    files: impl IntoIterator<Item = PathBuf>,
    options: &ReadOptions,
) -> Result<Vec<Found>, ReadError> {
    let files = files.into_iter().collect::<Vec<_>>();
    let found = files
        .par_iter()
        .map(|file| header::scan(file, options.force));
    // Collected before the errors are looked at: which one is first must not depend on threads.
    found.collect::<Vec<_>>().into_iter().collect()
}

fn assemble(
    source: &Path,
    found: Vec<Found>,
    looked_at: usize,
    options: &ReadOptions,
) -> Result<Scan, ReadError> {
    let sorted = Sorted::of(found);
    let mut warnings = sorted.warnings();
    let chosen = sorted.choose(source, looked_at, options)?;
    let slices = chosen.slices;
    warnings.extend(meaning_warnings(&slices, options.force)?);
    slices.iter().try_for_each(pixels::check_size)?;
    let stack = Stack::of(source, &slices, options.fill_gaps)?;
    warnings.extend(stack.warnings());
    let (voxels, padded) = decode(&slices, &stack)?;
    let pixels = slices[0].image.pixels() * slices.len();
    warnings.extend(padding_warning(padded, pixels));
    let acquisition = Acquisition {
        padded_voxels: padded,
        interpolated_slices: stack.made_up(),
        unit: slices.iter().find_map(|s| s.frame.foreign_unit),
        ..Acquisition::of_slices(slices.iter().map(|s| &*s.stated))
    };
    let unusable = |source_error| ReadError::Volume {
        path: source.to_owned(),
        source: source_error,
    };
    let grid = stack.grid().map_err(|e| unusable(e.into()))?;
    let volume = Volume::of_voxels(grid, voxels).map_err(unusable)?;
    warnings.extend(chosen.modality_warning);
    warnings.extend(hu_plausibility(&volume));
    Ok(Scan {
        volume,
        modality: chosen.modality,
        series: chosen.all,
        acquisition,
        warnings,
    })
}

/// What the headers say about the meaning of the values; other units than HU are refused unless forced.
fn meaning_warnings(slices: &[Slice], force: bool) -> Result<Vec<Warning>, ReadError> {
    let mut warnings = Vec::new();
    let bare = slices.iter().filter(|s| s.frame.rescale.is_none()).count();
    if bare > 0 {
        warnings.push(Warning {
            code: WarningCode::NoRescale,
            text: format!(
                "{bare} of {} slices have no rescale slope and intercept; stored values are taken as HU",
                slices.len()
            ),
        });
    }
    let foreign = |s: &Slice| Some((s.file.path.clone(), s.frame.foreign_unit?));
    match slices.iter().find_map(foreign) {
        Some((path, unit)) if !force => return Err(ReadError::NotHu { path, unit }),
        Some((_, unit)) => warnings.push(Warning {
            code: WarningCode::NotHu,
            text: format!("the values are in {unit}, not in HU"),
        }),
        None => {}
    }
    Ok(warnings)
}

fn padding_warning(padded: usize, pixels: usize) -> Option<Warning> {
    (padded > 0).then(|| Warning {
        code: WarningCode::PixelPadding,
        text: format!(
            "{padded} pixels ({:.1} %) pad the images and hold no measurement; they were taken for air, -1000 HU",
            100.0 * padded as f64 / pixels as f64
        ),
    })
}

/// Decodes all slices and counts padding, in 16 bits if these hold all values.
fn decode(slices: &[Slice], stack: &Stack) -> Result<(Voxels, usize), ReadError> {
    let whole = |s: &Slice| stored::whole_intercept(s.rescale()).is_some();
    if stack.between().is_none() && slices.iter().all(whole) {
        let done = decode_as(slices, stack, StoredFormat::read_whole)?;
        if let Some((hu, padded)) = done {
            return Ok((Voxels::I16(hu), padded));
        }
    }
    let done = decode_as(slices, stack, |format, containers, rescale, hu| {
        Some(format.read_hu(containers, rescale, hu))
    })?;
    let (mut hu, padded) = done.expect("any value is a number");
    if let Some(between) = stack.between() {
        hu = interpolate(&hu, slices[0].image.pixels(), between);
    }
    Ok((Voxels::F32(hu), padded))
}

/// Decodes all slices in parallel, each into its place; the first slice's error is reported. `None` where `fill`
/// finds that the type does not hold the values, else the values and how many of them are padding.
fn decode_as<T: Clone + Default + Send>(
    slices: &[Slice],
    stack: &Stack,
    fill: impl Fn(&StoredFormat, &[u8], [f64; 2], &mut [T]) -> Option<usize> + Sync,
) -> Result<Option<(Vec<T>, usize)>, ReadError> {
    let pixels = slices[0].image.pixels();
    let mut hu = vec![T::default(); pixels * slices.len()];
    let done = hu.par_chunks_mut(pixels).zip(stack.order()).map_init(
        Vec::new,
        |containers, (place, &index)| {
            let slice = &slices[index];
            pixels::read(slice, containers)?;
            let format = &slice.image.stored;
            Ok(fill(format, containers, slice.rescale(), place))
        },
    );
    let padded = done.collect::<Vec<Result<_, ReadError>>>();
    let padded = padded.into_iter().collect::<Result<Option<Vec<_>>, _>>()?;
    Ok(padded.map(|padded| (hu, padded.into_iter().sum())))
}

/// Slices between those of a stack, mixed linearly.
fn interpolate(hu: &[f32], pixels: usize, between: &[Between]) -> Vec<f32> {
    let mut filled = vec![0.0; pixels * between.len()];
    let places = filled.par_chunks_mut(pixels).zip(between);
    places.for_each(|(place, &Between { below, weight })| {
        let [low, high] = [below, below + 1].map(|n| &hu[n * pixels..][..pixels]);
        for ((place, low), high) in place.iter_mut().zip(low).zip(high) {
            *place = low * (1.0 - weight) + high * weight;
        }
    });
    filled
}
