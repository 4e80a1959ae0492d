//! `ppa.phantom`: CT of a limb with a known shape.

use ppa_core::Side;
use ppa_ct::Volume;
use ppa_phantom::{Limb, LowerLeg, Scanner, TableTop};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arguments::{threads_of, whole};
use crate::background::run;
use crate::errors::OrRaise;
use crate::values::plain;
use crate::volume::PyVolume;

/// A built-in lower leg, or a random one.
fn lower_leg(name: &str, seed: Option<u64>, side: Side, plate: bool) -> PyResult<LowerLeg> {
    let leg = match seed {
        Some(seed) => LowerLeg::from_seed(seed, side),
        None => LowerLeg::family(name, side).or_raise()?,
    };
    Ok(if plate { leg.with_plate() } else { leg })
}

/// The knee, or a lower leg.
fn limb(name: &str, seed: Option<u64>, side: Side, plate: bool) -> PyResult<Limb> {
    let knee = name.eq_ignore_ascii_case("knee");
    if knee && (seed.is_some() || plate) {
        return Err(PyValueError::new_err(
            "the knee is a single shape: seed and plate do not apply to it",
        ));
    }
    match knee {
        true => Ok(Limb::knee(side)),
        false => Ok(lower_leg(name, seed, side, plate)?.into_limb()),
    }
}

/// Create the CT of a limb phantom built from geometric shapes.
///
/// Parameters
/// ----------
/// name : str
///     Built-in lower leg, "P01" to "P17", or "knee".
/// side : {"r", "l"}
///     Side of the body.
/// seed : int, optional
///     Draw a random lower leg from this seed instead.
/// plate : bool
///     Put a titanium plate with five screws on the fibula.
/// spacing_mm : float
///     Side of the cubic voxels, mm.
/// table : bool
///     Place the limb on a table top.
/// blur_mm : float
///     Blur of a scanner: full width at half maximum, mm.
/// noise_hu : float
///     Noise of a scanner: standard deviation, HU.
/// noise_seed : int
///     Seed of the noise.
/// threads : int, optional
///     Worker threads; one per core by default.
///
/// Returns
/// -------
/// Volume
#[pyfunction]
#[pyo3(signature = (name="P01", side="r", *, seed=None, plate=false, spacing_mm=0.8, table=false, blur_mm=0.0, noise_hu=0.0, noise_seed=0, threads=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn phantom(
    py: Python<'_>,
    name: &str,
    side: &str,
    #[pyo3(from_py_with = whole::<64, _>)] seed: Option<u64>,
    plate: bool,
    spacing_mm: f64,
    table: bool,
    blur_mm: f64,
    noise_hu: f64,
    #[pyo3(from_py_with = whole::<64, _>)] noise_seed: u64,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
) -> PyResult<PyVolume> {
    let limb = limb(name, seed, crate::side::side(side)?, plate)?;
    let table = match table {
        true => TableTop::Present,
        false => TableTop::Absent,
    };
    let scanner = (blur_mm != 0.0 || noise_hu != 0.0).then_some(Scanner {
        blur_fwhm_mm: blur_mm,
        noise_hu,
        seed: noise_seed,
    });
    let volume = run(py, threads, None, move |_| {
        let volume = limb.voxelise(spacing_mm, table)?;
        match scanner {
            Some(scanner) => scanner.scan(&volume),
            None => Ok(volume),
        }
    })?;
    Ok(PyVolume {
        volume: volume.or_raise()?,
        file: None,
    })
}

/// Create the label volume of a phantom's bones, for ``bones`` of :func:`prepare`.
///
/// Parameters
/// ----------
/// volume : Volume
///     CT of the same phantom, which defines the voxel grid.
/// name, side, seed
///     As for :func:`phantom`.
/// threads : int, optional
///     Worker threads; one per core by default.
///
/// Returns
/// -------
/// Volume
///     0 outside the bones; in a lower leg, 3 is the tibia, 4 the fibula and 1 the talus.
#[pyfunction]
#[pyo3(signature = (volume, name="P01", side="r", *, seed=None, threads=None))]
pub fn phantom_bones(
    py: Python<'_>,
    volume: &PyVolume,
    name: &str,
    side: &str,
    #[pyo3(from_py_with = whole::<64, _>)] seed: Option<u64>,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
) -> PyResult<PyVolume> {
    let limb = limb(name, seed, crate::side::side(side)?, false)?;
    let grid = volume.volume.grid().clone();
    let numbers = run(py, threads, None, move |_| {
        let numbers = limb.bone_labels(&grid).into_iter().map(i16::from);
        Volume::from_i16(grid, numbers.collect())
    })?;
    Ok(PyVolume {
        volume: numbers.or_raise()?,
        file: None,
    })
}

/// True landmarks and dimensions of a lower-leg phantom: ct frame (LPS), mm and radians.
///
/// Parameters
/// ----------
/// name, side, seed
///     As for :func:`phantom`.
///
/// Returns
/// -------
/// dict
#[pyfunction]
#[pyo3(signature = (name="P01", side="r", *, seed=None))]
pub fn phantom_truth<'py>(
    py: Python<'py>,
    name: &str,
    side: &str,
    #[pyo3(from_py_with = whole::<64, _>)] seed: Option<u64>,
) -> PyResult<Bound<'py, PyAny>> {
    let leg = lower_leg(name, seed, crate::side::side(side)?, false)?;
    plain(py, &leg.truth())
}
