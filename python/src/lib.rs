//! The compiled module of the Python package `ppa`: converts arguments, calls the crates and returns arrays.

mod arguments;
mod arrays;
mod background;
mod camera;
mod case;
mod command;
mod dataset;
mod depth_image;
mod errors;
mod exposure;
mod generate;
mod interpreter;
mod label;
mod material;
mod metrics;
mod network;
mod phantom;
mod plan;
mod posable_case;
mod pose;
mod prepare;
mod progress;
mod radiograph;
mod scene;
mod side;
mod spectrum;
mod train;
mod transport;
mod values;
mod volume;

use pyo3::prelude::*;

#[pymodule]
fn _ppa(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    interpreter::require_first(py)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PpaError", py.get_type::<errors::PpaError>())?;
    module.add("InternalError", py.get_type::<errors::InternalError>())?;
    module.add_class::<camera::PyCamera>()?;
    module.add_class::<case::PyCase>()?;
    module.add_class::<dataset::PyDataset>()?;
    module.add_class::<depth_image::PyDepthImage>()?;
    module.add_class::<material::PyMaterial>()?;
    module.add_class::<network::PyNetwork>()?;
    module.add_class::<plan::PyPlan>()?;
    module.add_class::<pose::PyPose>()?;
    module.add_class::<radiograph::PyRadiograph>()?;
    module.add_class::<scene::PyScene>()?;
    module.add_class::<spectrum::PySpectrum>()?;
    module.add_class::<transport::PyTransport>()?;
    module.add_class::<volume::PyVolume>()?;
    module.add_function(wrap_pyfunction!(prepare::prepare, module)?)?;
    module.add_function(wrap_pyfunction!(command::run_program, module)?)?;
    module.add_function(wrap_pyfunction!(generate::generate, module)?)?;
    module.add_function(wrap_pyfunction!(label::label, module)?)?;
    module.add_function(wrap_pyfunction!(metrics::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(metrics::permutation_test, module)?)?;
    module.add_function(wrap_pyfunction!(phantom::phantom, module)?)?;
    module.add_function(wrap_pyfunction!(phantom::phantom_bones, module)?)?;
    module.add_function(wrap_pyfunction!(phantom::phantom_truth, module)?)?;
    module.add_function(wrap_pyfunction!(train::train, module)?)?;
    module.add_function(wrap_pyfunction!(train::training_log, module)?)?;
    Ok(())
}
