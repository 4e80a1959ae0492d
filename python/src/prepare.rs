//! `ppa.prepare`: from a scan to a case.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use ppa_ct::{Acquisition, ReadError, ReadOptions, Scan, Volume, WriteError, read_with, write};
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_generate::{Case, PrepareError, PreparedLimb, prepare_scan};
use ppa_label::{CaseBonesError, check_bones, check_segmented_name, segment_checked_bones};
use ppa_mesh::{Ball, LimbSettings, VoxelBox};
use ppa_scene::LandmarkOverrides;
use pyo3::exceptions::{PyFileExistsError, PyValueError};
use pyo3::prelude::*;

use crate::arguments::{threads_of, whole};
use crate::arrays::{finite, point, points, row_list};
use crate::background::{Watch, run};
use crate::case::PyCase;
use crate::errors::OrRaise;
use crate::posable_case::PosableCase;
use crate::values::word;
use crate::volume::PyVolume;

/// A scan that was not read from a file.
fn of_memory(volume: Volume) -> Scan {
    Scan {
        volume,
        modality: None,
        series: Vec::new(),
        acquisition: Acquisition::default(),
        warnings: Vec::new(),
    }
}

/// Why a case cannot be prepared.
#[derive(Debug, thiserror::Error)]
enum PreparationError {
    #[error(transparent)]
    Limb(#[from] PrepareError),
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Bones(#[from] CaseBonesError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("the call was interrupted, nothing was written")]
    Interrupted,
}

/// Bones in a file that a person or another program segmented.
fn labelled(path: PathBuf, [tibia, fibula, talus]: [u8; 3]) -> BoneFile {
    BoneFile {
        path,
        numbers: BoneNumbers {
            tibia,
            fibula,
            talus,
        },
        segmented: false,
    }
}

/// Bones that are segmented in the scan and written to `target`.
fn separated(target: PathBuf, scan: &Path, replace: bool) -> PyResult<BoneFile> {
    check_segmented_name(&target, scan).or_raise()?;
    if target.exists() && !replace {
        return Err(PyFileExistsError::new_err(format!(
            "{} exists: give replace=True to replace it",
            target.display()
        )));
    }
    Ok(BoneFile {
        path: target,
        numbers: BoneNumbers::default(),
        segmented: true,
    })
}

/// A case with its bones, after a check that labels can be computed from them.
fn with_bones(
    case: Case,
    prepared: &PreparedLimb,
    bones: BoneFile,
    watch: &Watch,
) -> Result<Case, PreparationError> {
    if bones.segmented {
        let (limb, landmarks) = (&prepared.limb.mask, &prepared.landmarks);
        let separated = segment_checked_bones(&prepared.volume, limb, landmarks)?;
        if watch.stop().load(Ordering::Relaxed) {
            return Err(PreparationError::Interrupted);
        }
        write(&bones.path, &separated)?;
    } else {
        check_bones(&bones, &prepared.landmarks)?;
    }
    Ok(Case {
        bones: Some(bones),
        ..case
    })
}

/// Find the skin, axis, joint and supporting plane of a limb.
///
/// Parameters
/// ----------
/// volume : Volume or path
///     The scan.
/// side : {"r", "l"}
///     Side of the limb; if the scan shows two side by side, the one on this side of the patient is used.
/// limb : {"lower_leg", "knee", "other"}, optional
///     Kind of limb; by default a lower leg if an ankle is found, otherwise a knee if one is found.
/// iso_hu : float
///     CT number of the skin surface, HU; -500 by default.
/// crop : sequence of int, shape (3, 2), optional
///     Keep only this box of voxels: first index and one past the last along i, j and k.
/// inside : array_like, shape (3,), optional
///     A point inside the wanted limb if the scan shows several, ct frame, mm.
/// keep : array_like, shape (n, 3), optional
///     Points inside other bodies to keep as parts of the limb, ct frame, mm: a splint, or a part that only touches the limb.
/// remove : array_like, shape (n, 4), optional
///     Balls to remove from the limb: centre in the ct frame and radius, mm.
/// joint : array_like, shape (3,), optional
///     Centre of the joint, ct frame, mm.
/// axis_source : {"bone", "limb"}, optional
///     Structure whose centres in the two regions define the axis: the bone or the whole limb.
/// joint_region, calf_region : array_like, shape (2,), optional
///     Regions whose centres define the axis: start and end, mm proximal to the joint.
/// axis : array_like, shape (2, 3), optional
///     Two points that the axis runs through, ct frame, mm, instead of the centres of two regions.
/// anterior : array_like, shape (3,), optional
///     Direction that faces up at angle 0, ct frame.
/// plane : array_like, shape (3, 3), optional
///     Three points of the plane under the limb, ct frame, mm: one distal, two proximal.
/// bones : str or os.PathLike, optional
///     Label volume of the bones, for computed labels: NIfTI, NRRD or MetaImage in the scan's frame.
/// bone_numbers : (int, int, int)
///     Label values of tibia, fibula and talus in ``bones``.
/// segment_bones : str or os.PathLike, optional
///     Segment the bones in the scan and write the label volume here: NIfTI, NRRD or MetaImage. If bones touch, raises an error that
///     names the place.
/// replace : bool
///     Replace an existing ``segment_bones`` file.
/// threads : int, optional
///     Worker threads; one per core by default.
///
/// Returns
/// -------
/// Case
#[pyfunction]
#[pyo3(signature = (volume, side, *, limb=None, iso_hu=-500.0, crop=None, inside=None, keep=None, remove=None, joint=None, axis_source=None, joint_region=None, calf_region=None, axis=None, anterior=None, plane=None, bones=None, bone_numbers=[3, 4, 1], segment_bones=None, replace=false, threads=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn prepare(
    py: Python<'_>,
    volume: &Bound<'_, PyAny>,
    side: &str,
    limb: Option<&str>,
    iso_hu: f64,
    #[pyo3(from_py_with = whole::<64, _>)] crop: Option<[[usize; 2]; 3]>,
    inside: Option<&Bound<'_, PyAny>>,
    keep: Option<&Bound<'_, PyAny>>,
    remove: Option<&Bound<'_, PyAny>>,
    joint: Option<&Bound<'_, PyAny>>,
    axis_source: Option<&str>,
    joint_region: Option<&Bound<'_, PyAny>>,
    calf_region: Option<&Bound<'_, PyAny>>,
    axis: Option<&Bound<'_, PyAny>>,
    anterior: Option<&Bound<'_, PyAny>>,
    plane: Option<&Bound<'_, PyAny>>,
    bones: Option<PathBuf>,
    #[pyo3(from_py_with = whole::<8, _>)] bone_numbers: [u8; 3],
    segment_bones: Option<PathBuf>,
    replace: bool,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
) -> PyResult<PyCase> {
    if axis.is_some() && (axis_source.is_some() || joint_region.is_some() || calf_region.is_some())
    {
        return Err(PyValueError::new_err(
            "axis replaces axis_source, joint_region and calf_region: give one or the other",
        ));
    }
    let side = crate::side::side(side)?;
    let surface = LimbSettings {
        iso_hu,
        inside: inside.map(|inside| point(inside, "inside")).transpose()?,
        kept: keep.map_or(Ok(Vec::new()), |keep| row_list(keep, "keep"))?,
        removed: remove.map_or(Ok(Vec::new()), balls)?,
        crop: crop.map(|crop| VoxelBox {
            low: crop.map(|[low, _]| low),
            high: crop.map(|[_, high]| high),
        }),
        ..LimbSettings::default()
    };
    let region = |region: Option<&Bound<'_, PyAny>>, name| {
        region
            .map(|region| finite::<2>(region, name, &[2]))
            .transpose()
    };
    let choices = LandmarkOverrides {
        limb: limb.map(|limb| word(limb, "limb")).transpose()?,
        joint_centre: joint.map(|joint| point(joint, "joint")).transpose()?,
        joint_region: region(joint_region, "joint_region")?,
        calf_region: region(calf_region, "calf_region")?,
        axis_source: axis_source
            .map(|source| word(source, "axis_source"))
            .transpose()?,
        axis: axis.map(|axis| points::<2>(axis, "axis")).transpose()?,
        anterior: anterior.map(|up| point(up, "anterior")).transpose()?,
        plane_points: plane.map(|plane| points::<3>(plane, "plane")).transpose()?,
    };
    let (scan, path, reading) = match volume.cast::<PyVolume>() {
        Ok(volume) => match &volume.get().file {
            Some(file) => (
                Some(file.scan.clone()),
                file.path.clone(),
                file.reading.clone(),
            ),
            None => {
                let scan = of_memory(volume.get().volume.clone());
                (Some(scan), PathBuf::new(), ReadOptions::default())
            }
        },
        Err(_) => (None, volume.extract()?, ReadOptions::default()),
    };
    let bones = match (bones, segment_bones) {
        (None, None) => None,
        (Some(path), None) => Some(labelled(path, bone_numbers)),
        (None, Some(target)) => Some(separated(target, &path, replace)?),
        (Some(_), Some(_)) => {
            return Err(PyValueError::new_err(
                "bones reads bones from a file, segment_bones segments them in the scan: give one or the other",
            ));
        }
    };
    let limb = run(py, threads, None, move |watch| {
        let scan = scan.map_or_else(|| read_with(&path, &reading), Ok)?;
        let kept = scan.clone();
        let (case, prepared) = prepare_scan(scan, &path, &reading, side, &surface, &choices)?;
        let case = match bones {
            Some(bones) => with_bones(case, &prepared, bones, watch)?,
            None => case,
        };
        Ok::<_, PreparationError>(PosableCase::new(case, kept, prepared))
    })?;
    PyCase::of(limb.or_raise()?)
}

fn balls(rows: &Bound<'_, PyAny>) -> PyResult<Vec<Ball>> {
    let rows = row_list(rows, "remove")?;
    let ball = |[x, y, z, radius_mm]: [f64; 4]| Ball {
        centre_mm: [x, y, z],
        radius_mm,
    };
    Ok(rows.into_iter().map(ball).collect())
}
