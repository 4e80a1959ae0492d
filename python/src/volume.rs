//! `ppa.Volume`: Hounsfield units on a voxel grid.

use std::path::PathBuf;

use nalgebra::{Affine3, Matrix4};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyUntypedArrayMethods};
use ppa_ct::{Grid, ReadOptions, Scan, SeriesChoice, Values, Volume, read_with, write};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arguments::{threads_of, whole};
use crate::arrays::{first_fastest, matrix, untyped, view};
use crate::background::run;
use crate::errors::OrRaise;
use crate::values::plain;

/// A CT volume: Hounsfield units on a voxel grid.
///
/// Parameters
/// ----------
/// voxels : numpy.ndarray, shape (ni, nj, nk), int16 or float32
///     Hounsfield units of voxel (i, j, k). C- or Fortran-contiguous; copied once.
/// affine : array_like, shape (4, 4)
///     Transform from voxel indices to the scan's LPS frame, mm: ``affine @ (i, j, k, 1)`` is the centre of a voxel.
///
/// Raises
/// ------
/// ValueError
///     If type or number of dimensions is wrong, elements are not contiguous, values are not finite, or the affine is singular.
#[pyclass(frozen, module = "ppa", name = "Volume")]
pub struct PyVolume {
    pub volume: Volume,
    /// The file and its metadata; None for voxels from memory.
    pub file: Option<ScanFile>,
}

/// Where a volume was read from.
pub struct ScanFile {
    pub scan: Scan,
    pub path: PathBuf,
    pub reading: ReadOptions,
}

/// A voxel grid from its size and affine.
pub fn grid(size: &[usize], affine: &Bound<'_, PyAny>) -> PyResult<Grid> {
    let rows = matrix(affine, "affine")?;
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(PyValueError::new_err(format!(
            "the last row of affine is {:?}, expected 0, 0, 0, 1",
            rows[3]
        )));
    }
    let rows = Matrix4::from_fn(|row, column| rows[row][column]);
    let size = size.try_into().expect("an array of three dimensions");
    Grid::new(size, Affine3::from_matrix_unchecked(rows)).or_raise()
}

/// The affine of a voxel grid.
pub fn affine<'py>(py: Python<'py>, grid: &Grid) -> Bound<'py, PyArray2<f64>> {
    let matrix = grid.ct_from_voxel().matrix();
    rows(
        py,
        std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)])),
    )
}

/// A 4 x 4 array from its rows.
pub fn rows(py: Python<'_>, rows: [[f64; 4]; 4]) -> Bound<'_, PyArray2<f64>> {
    numpy::ndarray::arr2(&rows).into_pyarray(py)
}

#[pymethods]
impl PyVolume {
    #[new]
    fn new(py: Python<'_>, voxels: &Bound<'_, PyAny>, affine: &Bound<'_, PyAny>) -> PyResult<Self> {
        let is_short = untyped(voxels, "voxels")?
            .dtype()
            .is_equiv_to(&numpy::dtype::<i16>(py));
        let volume = if is_short {
            let (hu, size) = first_fastest::<i16>(voxels, "voxels", 3)?;
            Volume::from_i16(grid(&size, affine)?, hu)
        } else {
            let (hu, size) = first_fastest::<f32>(voxels, "voxels", 3).map_err(|error| {
                let text = error.value(py).to_string();
                PyValueError::new_err(text.replace("expected float32", "expected int16 or float32"))
            })?;
            Volume::new(grid(&size, affine)?, hu)
        };
        Ok(Self {
            volume: volume.or_raise()?,
            file: None,
        })
    }

    /// Read a CT: a folder of DICOM slices or one DICOM file, NIfTI, NRRD or MetaImage.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     Folder or file.
    /// series : int or str, optional
    ///     Number or UID of the series to read, if a DICOM folder contains several.
    /// fill_gaps : bool
    ///     Interpolate DICOM slices that are missing or unevenly spaced, instead of refusing the series.
    /// force : bool
    ///     Read modalities other than CT and values not in HU, instead of refusing them.
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    ///
    /// Returns
    /// -------
    /// Volume
    #[staticmethod]
    #[pyo3(signature = (path, *, series=None, fill_gaps=false, force=false, threads=None))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        series: Option<&Bound<'_, PyAny>>,
        fill_gaps: bool,
        force: bool,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<Self> {
        let choice = |series: &Bound<'_, PyAny>| {
            let text = series.str()?.to_string();
            text.parse::<SeriesChoice>().map_err(|expected| {
                PyValueError::new_err(format!("series is {text:?}: {expected}"))
            })
        };
        let reading = ReadOptions {
            series: series.map(choice).transpose()?,
            fill_gaps,
            force,
        };
        let scan = run(py, threads, None, {
            let (path, reading) = (path.clone(), reading.clone());
            move |_| read_with(&path, &reading)
        })?
        .or_raise()?;
        Ok(Self {
            volume: scan.volume.clone(),
            file: Some(ScanFile {
                scan,
                path,
                reading,
            }),
        })
    }

    /// Create a volume from a SimpleITK or nibabel image; copied once.
    ///
    /// Parameters
    /// ----------
    /// image : SimpleITK.Image or nibabel image
    ///     Three-dimensional image in Hounsfield units.
    ///
    /// Returns
    /// -------
    /// Volume
    #[staticmethod]
    fn from_image(py: Python<'_>, image: &Bound<'_, PyAny>) -> PyResult<Self> {
        let parts = py.import("ppa._images")?.call_method1("parts", (image,))?;
        let (voxels, affine): (Bound<'_, PyAny>, Bound<'_, PyAny>) = parts.extract()?;
        Self::new(py, &voxels, &affine)
    }

    /// Convert to a SimpleITK image, which copies the voxels.
    fn to_simpleitk<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::as_image(this, "to_simpleitk")
    }

    /// Convert to a nibabel NIfTI image, which shares the voxels.
    fn to_nibabel<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::as_image(this, "to_nibabel")
    }

    /// Write the volume in the format of the extension: .nii, .nii.gz, .nrrd, .mha, .mhd, or DICOM slices in a new folder.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     File or folder to write; an existing file is replaced.
    #[pyo3(signature = (path, *, threads=None))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<()> {
        let volume = self.volume.clone();
        run(py, threads, None, move |_| write(&path, &volume))?.or_raise()
    }

    /// numpy.ndarray, shape (ni, nj, nk): Hounsfield units, int16 or float32.
    ///
    /// A read-only view without a copy.
    #[getter]
    #[allow(unsafe_code)]
    fn voxels<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        use numpy::ndarray::ShapeBuilder;
        let volume = &this.get().volume;
        let shape = volume.grid().size().f();
        let owner = this.clone().into_any();
        // SAFETY: the voxels of a volume are neither changed nor moved while its frozen object is alive.
        Ok(unsafe {
            match volume.values() {
                Values::I16(hu) => view(owner, hu, shape)?.into_any(),
                Values::F32(hu) => view(owner, hu, shape)?.into_any(),
            }
        })
    }

    /// numpy.ndarray, shape (4, 4): transform from voxel indices to the scan's LPS frame, mm.
    #[getter]
    fn affine<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        affine(py, self.volume.grid())
    }

    /// Number of voxels along i, j and k.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.volume.grid().size().into()
    }

    /// numpy.ndarray, shape (3,): distances between the centres of neighbouring voxels along i, j and k, mm.
    #[getter]
    fn spacing_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let spacing: [f64; 3] = self.volume.grid().spacing_mm().into();
        PyArray1::from_slice(py, &spacing)
    }

    /// The file that the volume was read from; None for voxels from memory.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.file.as_ref().map(|file| file.path.clone())
    }

    /// Possible problems with the file: a list of dictionaries with ``code`` and ``text``.
    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let warnings = self.file.as_ref().map(|file| &file.scan.warnings[..]);
        plain(py, &warnings.unwrap_or_default())
    }

    /// SHA-256 over size, affine and values: identifies a scan regardless of its file.
    #[getter]
    fn sha256(&self) -> String {
        self.volume.sha256()
    }

    /// Extract the voxels from ``low`` to ``high`` (exclusive) without moving them.
    ///
    /// Parameters
    /// ----------
    /// low, high : tuple of int, length 3
    ///     First voxel and one past the last along i, j and k.
    ///
    /// Returns
    /// -------
    /// Volume
    fn crop(
        &self,
        #[pyo3(from_py_with = whole::<64, _>)] low: [usize; 3],
        #[pyo3(from_py_with = whole::<64, _>)] high: [usize; 3],
    ) -> PyResult<Self> {
        Ok(Self {
            volume: self.volume.crop(low, high).or_raise()?,
            file: None,
        })
    }

    fn __repr__(&self) -> String {
        let [i, j, k] = self.volume.grid().size();
        let [x, y, z]: [f64; 3] = self.volume.grid().spacing_mm().into();
        let dtype = match self.volume.values() {
            Values::I16(_) => "int16",
            Values::F32(_) => "float32",
        };
        format!("<ppa.Volume of {i} x {j} x {k} voxels, {x:.3} x {y:.3} x {z:.3} mm, {dtype}>")
    }
}

impl PyVolume {
    /// Converts voxels and affine with a function of `ppa._images`.
    fn as_image<'py>(this: &Bound<'py, Self>, function: &str) -> PyResult<Bound<'py, PyAny>> {
        let (py, grid) = (this.py(), this.get().volume.grid());
        let images = py.import("ppa._images")?;
        images.call_method1(function, (Self::voxels(this)?, affine(py, grid)))
    }
}
