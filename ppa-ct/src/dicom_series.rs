//! A scan from a folder of DICOM slices or a single file.

mod attributes;
mod codec;
mod defined_terms;
mod directory;
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

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use ppa_core::text::count;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::scan::{ReadOptions, Scan, Warning, WarningCode, hu_plausibility, starts_as_dicom};
use crate::values::{Voxels, zeros};
use crate::volume::Volume;
use crate::volume_error::VolumeError;
pub(crate) use frame::RIGHT_ANGLE;
use header::{Found, Slice};
use series::Sorted;
use stack::{Between, Stack};
use stored::StoredFormat;

/// Reads one series from a folder, or from its subfolders if the folder itself has no DICOM image, including the files that a
/// DICOMDIR in it lists.
pub(crate) fn read_folder(folder: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    let mut seen = BTreeSet::new();
    let (found, looked_at) = search(folder, &mut seen, options)?;
    assemble(folder, found, looked_at, options)
}

/// Reads a single file of one or more slices, or the files that a DICOMDIR lists.
pub(crate) fn read_file(file: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    let mut seen = BTreeSet::from([file.to_owned()]);
    let mut found = scan_headers(seen.clone(), options)?;
    let listed = listed(&found, &mut seen, options)?;
    if let ([Found::Directory(directory)], []) = (&found[..], &listed[..]) {
        return Err(ReadError::EmptyDirectory {
            path: file.to_owned(),
            missing: directory.missing,
        });
    }
    found.extend(listed);
    assemble(file, found, seen.len(), options)
}

/// Classifies the DICOM files of a folder, in order of their names, and counts its files. If none is an image, the
/// subfolders are searched too, since series are often delivered in a folder of their own next to a licence, a viewer
/// or a DICOMDIR. Files already in `seen` are skipped.
fn search(
    folder: &Path,
    seen: &mut BTreeSet<PathBuf>,
    options: &ReadOptions,
) -> Result<(Vec<Found>, usize), ReadError> {
    let io = |path: &Path, source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let (mut files, mut dicom, mut subfolders) = (0, BTreeSet::new(), Vec::new());
    let mut damaged = 0;
    for entry in std::fs::read_dir(folder).map_err(|e| io(folder, e))? {
        let entry = entry.map_err(|e| io(folder, e))?;
        let path = entry.path();
        if path.is_file() {
            files += 1;
            if seen.contains(&path) {
                continue;
            }
            if starts_as_dicom(&path).map_err(|e| io(&path, e))? {
                dicom.insert(path);
            } else if is_named_as_dicom(&path) {
                damaged += 1;
                seen.insert(path);
            }
        } else if entry.file_type().map_err(|e| io(&path, e))?.is_dir() {
            subfolders.push(path);
        }
    }
    subfolders.sort();
    seen.extend(dicom.iter().cloned());
    let mut found = scan_headers(dicom, options)?;
    let no_image = |f: &Found| matches!(f, Found::NotAnImage | Found::Directory(_));
    let go_on = found.iter().all(no_image);
    found.extend((0..damaged).map(|_| Found::Damaged));
    found.extend(listed(&found, seen, options)?);
    if go_on {
        for subfolder in subfolders {
            let (below, more) = search(&subfolder, seen, options)?;
            found.extend(below);
            files += more;
        }
    }
    Ok((found, files))
}

/// Whether a file is named like a slice. Hidden files such as `._slice.dcm` are not: macOS writes them.
fn is_named_as_dicom(path: &Path) -> bool {
    let hidden = path
        .file_name()
        .is_some_and(|name| name.to_string_lossy().starts_with('.'));
    let named = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("dcm"));
    named && !hidden
}

/// Classifies the files listed by the directories found, except those already in `seen`.
fn listed(
    found: &[Found],
    seen: &mut BTreeSet<PathBuf>,
    options: &ReadOptions,
) -> Result<Vec<Found>, ReadError> {
    let directories = found.iter().filter_map(|found| match found {
        Found::Directory(listed) => Some(listed),
        _ => None,
    });
    let (mut files, mut damaged) = (BTreeSet::new(), 0);
    for file in directories.flat_map(|directory| &directory.files) {
        let dicom = starts_as_dicom(file).map_err(|source| ReadError::Io {
            path: file.clone(),
            source,
        })?;
        if !seen.insert(file.clone()) {
            continue;
        }
        if dicom {
            files.insert(file.clone());
        } else {
            damaged += 1;
        }
    }
    let mut found = scan_headers(files, options)?;
    found.extend((0..damaged).map(|_| Found::Damaged));
    Ok(found)
}

/// Reads all headers in parallel; if there are several errors, that of the first file is reported.
fn scan_headers(
    files: impl IntoIterator<Item = PathBuf>,
    options: &ReadOptions,
) -> Result<Vec<Found>, ReadError> {
    let files = files.into_iter().collect::<Vec<_>>();
    let found = files
        .par_iter()
        .map(|file| header::scan(file, options.force));
    // Collected before errors are examined: which one is first must not depend on threads.
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
    pixels::check_sizes(&slices)?;
    let stack = Stack::of(source, &slices, options.fill_gaps)?;
    warnings.extend(stack.warnings());
    let grid = stack.grid().map_err(|e| unusable(source, e))?;
    let mut several = slices.iter().filter(|s| s.index == 0 && s.image.frames > 1);
    several.try_for_each(|slice| slice.file.hold())?;
    let (voxels, padded) = decode(source, &slices, &stack)?;
    let pixels = slices[0].image.pixels() * slices.len();
    warnings.extend(padding_warning(padded, pixels));
    let acquisition = Acquisition {
        padded_voxels: padded,
        interpolated_slices: stack.made_up(),
        unit: slices.iter().find_map(|s| s.frame.foreign_unit),
        ..Acquisition::of_slices(slices.iter().map(|s| &*s.stated))
    };
    let volume = Volume::of_voxels(grid, voxels).map_err(|e| unusable(source, e))?;
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

fn unusable(path: &Path, source: impl Into<VolumeError>) -> ReadError {
    ReadError::Volume {
        path: path.to_owned(),
        source: source.into(),
    }
}

/// Warnings from the headers about the meaning of the values; other units than HU are refused unless forced.
fn meaning_warnings(slices: &[Slice], force: bool) -> Result<Vec<Warning>, ReadError> {
    let mut warnings = Vec::new();
    let bare = slices.iter().filter(|s| s.frame.rescale.is_none()).count();
    if bare > 0 {
        warnings.push(Warning {
            code: WarningCode::NoRescale,
            text: format!(
                "no rescale slope and intercept in {bare} of {}; stored values are taken as HU",
                count(slices.len(), "slice")
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
            "padding instead of measured values in {} ({:.1} %), read as air, -1000 HU",
            count(padded, "pixel"),
            100.0 * padded as f64 / pixels as f64
        ),
    })
}

/// Decodes all slices and counts padding, in 16 bits if all values fit.
fn decode(source: &Path, slices: &[Slice], stack: &Stack) -> Result<(Voxels, usize), ReadError> {
    let whole = |s: &Slice| stored::whole_intercept(s.rescale()).is_some();
    if stack.between().is_none() && slices.iter().all(whole) {
        let done = decode_as(source, slices, stack, StoredFormat::read_whole)?;
        if let Some((hu, padded)) = done {
            return Ok((Voxels::I16(hu), padded));
        }
    }
    let done = decode_as(source, slices, stack, |format, containers, rescale, hu| {
        Some(format.read_hu(containers, rescale, hu))
    })?;
    let (mut hu, padded) = done.expect("any value is a number");
    if let Some(between) = stack.between() {
        hu =
            interpolate(&hu, slices[0].image.pixels(), between).map_err(|e| unusable(source, e))?;
    }
    Ok((Voxels::F32(hu), padded))
}

/// Decodes all slices in parallel, each into its place; the first slice's error is reported. Returns `None` if `fill`
/// finds values that the type cannot hold, otherwise the values and the number of padded ones.
fn decode_as<T: Clone + Default + Send>(
    source: &Path,
    slices: &[Slice],
    stack: &Stack,
    fill: impl Fn(&StoredFormat, &[u8], [f64; 2], &mut [T]) -> Option<usize> + Sync,
) -> Result<Option<(Vec<T>, usize)>, ReadError> {
    let pixels = slices[0].image.pixels();
    let mut hu = zeros(pixels * slices.len()).map_err(|e| unusable(source, e))?;
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

/// Interpolates slices linearly between those of a stack.
fn interpolate(hu: &[f32], pixels: usize, between: &[Between]) -> Result<Vec<f32>, VolumeError> {
    let mut filled = zeros(pixels * between.len())?;
    let places = filled.par_chunks_mut(pixels).zip(between);
    places.for_each(|(place, &Between { below, weight })| {
        let [low, high] = [below, below + 1].map(|n| &hu[n * pixels..][..pixels]);
        for ((place, low), high) in place.iter_mut().zip(low).zip(high) {
            *place = low * (1.0 - weight) + high * weight;
        }
    });
    Ok(filled)
}
