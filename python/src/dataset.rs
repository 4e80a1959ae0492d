//! `ppa.Dataset`: the images of a dataset, as networks see them.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use numpy::{IntoPyArray, PyArray1, PyArray3, PyArrayMethods};
use ppa_dataset::BodyShape;
use ppa_dataset::labels::LabelName;
use ppa_learn::data::{
    Augmentation, Balanced, DataError, FRAMES_PER_POSE, Raster, Sample, Selection, Views,
    evaluation_input, read_samples,
};
use ppa_learn::train::TrainConfig;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arguments::whole;
use crate::background::run;
use crate::errors::OrRaise;
use crate::side::letter;
use crate::values::{from_table, table, to_table, word};

/// A dataset as PyTorch's map-style datasets: ``dataset[i]`` is a pair of image and label, ``len(dataset)`` their number.
///
/// Images are what networks see in evaluation: the square around the joint, resized, as shares of 1.5 m minus 0.5; pixels without depth
/// are -0.5. Nothing is decoded before it is asked for. Works in the worker processes of a ``DataLoader``.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     Folder of a dataset, ours or the authors'.
/// views : {"pairs", "left", "right", "unified"}
///     Images of both cameras, of one, or of either alone.
/// side : int
///     Rows and columns of an image.
/// patients : sequence of int, optional
///     Numbers of the persons; all by default.
/// shapes : sequence of str, optional
///     Body shapes; all by default.
/// every_pose : int, optional
///     Every n-th angle of each limb, from the smallest.
/// labels : str, optional
///     Name of the labels, those of labels.NAME.json.
/// unlabelled : bool
///     Take images without a label too; their label is NaN. By default, they are refused.
/// mirror : bool
///     Show left limbs as right ones.
/// transform : callable, optional
///     Takes an image and gives what stands in its place, e.g. ``torch.from_numpy``.
#[pyclass(frozen, module = "ppa", name = "Dataset")]
pub struct PyDataset {
    samples: Vec<Sample>,
    cameras: usize,
    side: usize,
    transform: Option<Py<PyAny>>,
    /// What it was made with, to be made again in another process.
    arguments: Py<PyDict>,
}

#[pymethods]
impl PyDataset {
    #[new]
    #[pyo3(signature = (path, *, views="pairs", side=224, patients=None, shapes=None, every_pose=None, labels=None, unlabelled=false, mirror=false, transform=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        views: &str,
        #[pyo3(from_py_with = whole::<64, _>)] side: usize,
        #[pyo3(from_py_with = whole::<32, _>)] patients: Option<Vec<u32>>,
        shapes: Option<Vec<String>>,
        #[pyo3(from_py_with = whole::<64, _>)] every_pose: Option<usize>,
        labels: Option<&str>,
        unlabelled: bool,
        mirror: bool,
        transform: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        if !(1..=4096).contains(&side) {
            return Err(PyValueError::new_err(format!(
                "side is {side}, expected 1 to 4096 pixels"
            )));
        }
        let arguments = PyDict::new(py);
        for (name, value) in [
            ("path", path.clone().into_pyobject(py)?.into_any()),
            ("views", views.into_pyobject(py)?.into_any()),
            ("side", side.into_pyobject(py)?.into_any()),
            ("patients", patients.clone().into_pyobject(py)?.into_any()),
            ("shapes", shapes.clone().into_pyobject(py)?.into_any()),
            ("every_pose", every_pose.into_pyobject(py)?.into_any()),
            ("labels", labels.into_pyobject(py)?.into_any()),
            (
                "unlabelled",
                unlabelled.into_pyobject(py)?.to_owned().into_any(),
            ),
            ("mirror", mirror.into_pyobject(py)?.to_owned().into_any()),
            (
                "transform",
                transform.as_ref().into_pyobject(py)?.into_any(),
            ),
        ] {
            arguments.set_item(name, value)?;
        }
        let views: Views = word(views, "views")?;
        let shapes = shapes.map(|shapes| {
            let shapes = shapes
                .iter()
                .map(|shape| word::<BodyShape>(shape, "shapes"));
            shapes.collect::<PyResult<Vec<_>>>()
        });
        let (shapes, labels) = (
            shapes.transpose()?,
            labels.map(LabelName::from_str).transpose().or_raise()?,
        );
        let every_pose = every_pose.map(|every| {
            NonZeroUsize::new(every)
                .ok_or_else(|| PyValueError::new_err("every_pose is 0, expected 1 or more"))
        });
        let every_pose = every_pose.transpose()?;
        let samples = run(py, None, None, move |_| {
            let selection = Selection {
                patients: patients.as_deref(),
                shapes: shapes.as_deref(),
                every_pose,
                labels: labels.as_ref(),
                unlabelled,
                views,
                frames_per_pose: FRAMES_PER_POSE,
                mirror,
            };
            read_samples(&path, &selection)
        })?;
        let samples = samples.or_raise()?;
        Ok(Self {
            cameras: samples.first().map_or(0, |sample| sample.images.len()),
            samples,
            side,
            transform,
            arguments: arguments.unbind(),
        })
    }

    fn __len__(&self) -> usize {
        self.samples.len()
    }

    /// Image and label of a sample.
    ///
    /// Returns
    /// -------
    /// image : numpy.ndarray, shape (cameras, side, side), float32
    /// label : float
    ///     Quality from 1 (ideal) to 3 (inadequate); NaN without a label.
    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        index: isize,
    ) -> PyResult<(Bound<'py, PyAny>, f64)> {
        let (sample, side) = (self.sample(index)?, self.side);
        let image = self.image(py, sample, |images| {
            let images = images.iter();
            images.map(|image| evaluation_input(image, side)).collect()
        })?;
        Ok((image, sample.label))
    }

    /// numpy.ndarray, shape (n,): labels of all samples, from 1 (ideal) to 3 (inadequate); NaN without a label.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.samples.iter().map(|sample| sample.label).collect())
    }

    /// What a training sees at a place of its endless sequence of samples: a sample that was drawn, and its image as it was changed.
    ///
    /// Step ``s`` of a training with batches of ``b`` sees the places from ``s * b`` on. Another program can so train on the same batches as
    /// :func:`train`, whose ``training`` selects the same samples.
    ///
    /// Parameters
    /// ----------
    /// place : int
    ///     From 0.
    /// seed : int
    ///     Seed of the training; 1 is that of the presets.
    /// balanced : bool
    ///     Draw rare labels as often as others, as "quick" and "paper" do.
    /// augmentation : dict, optional
    ///     How images are changed, as ``[augmentation]`` of a configuration; a key that is left out is that of "quick". A random crop is
    ///     always made.
    ///
    /// Returns
    /// -------
    /// image, label
    ///     As of ``dataset[i]``.
    #[pyo3(signature = (place, *, seed=1, balanced=true, augmentation=None))]
    fn drawn<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = whole::<64, _>)] place: u64,
        #[pyo3(from_py_with = whole::<64, _>)] seed: u64,
        balanced: bool,
        augmentation: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<(Bound<'py, PyAny>, f64)> {
        let mut keys = to_table(&TrainConfig::quick().augmentation)?;
        if let Some(given) = augmentation {
            keys.extend(table(given, "augmentation")?);
        }
        let augmentation: Augmentation = from_table(keys, "augmentation")?;
        let order = Balanced::new(&self.samples).or_raise()?;
        let order = match balanced {
            true => order,
            false => order.unbalanced(),
        };
        let sample = &self.samples[order.pick(seed, place)];
        let side = self.side;
        let image = self.image(py, sample, |images| {
            let images: Vec<_> = images.iter().collect();
            augmentation.apply(&images, side, seed, place)
        })?;
        Ok((image, sample.label))
    }

    /// list of dict: what is known of each sample, for a ``pandas.DataFrame``: ``id`` (path of its first image), ``patient``, ``side``,
    /// ``pose``, ``frame``, ``angle_deg``, ``label``, ``label_std`` and ``correction_deg``.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let rows = self.samples.iter().map(|sample| {
            let row = PyDict::new(py);
            row.set_item("id", &sample.id)?;
            row.set_item("patient", sample.limb.patient)?;
            row.set_item("side", letter(sample.limb.side))?;
            row.set_item("pose", &sample.pose)?;
            row.set_item("frame", sample.frame)?;
            row.set_item("angle_deg", sample.angle_deg)?;
            row.set_item("label", sample.label)?;
            row.set_item("label_std", sample.label_std)?;
            row.set_item("correction_deg", sample.correction_deg)?;
            Ok(row)
        });
        PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let open = py.import("ppa._dataset")?.getattr("open_dataset")?;
        Ok((open, (self.arguments.bind(py).clone(),)))
    }

    fn __repr__(&self) -> String {
        let (samples, cameras, side) = (self.samples.len(), self.cameras, self.side);
        format!("<ppa.Dataset of {samples} samples, images of {cameras} x {side} x {side}>")
    }
}

impl PyDataset {
    /// What networks see of a sample, or what `transform` makes of it; `input` takes the prepared images of its cameras.
    fn image<'py>(
        &self,
        py: Python<'py>,
        sample: &Sample,
        input: impl Fn(&[Raster<u16>]) -> Vec<Raster<f32>> + Send + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let side = self.side;
        let values = py.detach(|| {
            let prepared = sample.images.iter().map(|image| image.load(side));
            let inputs = input(&prepared.collect::<Result<Vec<_>, _>>()?).into_iter();
            Ok::<Vec<f32>, DataError>(inputs.flat_map(Raster::into_values).collect())
        });
        let array: Bound<'py, PyArray3<f32>> =
            (values.or_raise()?.into_pyarray(py)).reshape([self.cameras, side, side])?;
        match &self.transform {
            Some(transform) => transform.bind(py).call1((array,)),
            None => Ok(array.into_any()),
        }
    }

    /// A sample by its number; negative ones count from the end.
    fn sample(&self, index: isize) -> PyResult<&Sample> {
        let count = self.samples.len();
        let place = match index {
            0.. => index as usize,
            _ => count.wrapping_add_signed(index),
        };
        self.samples
            .get(place)
            .ok_or_else(|| PyIndexError::new_err(format!("sample {index} of a dataset of {count}")))
    }
}
