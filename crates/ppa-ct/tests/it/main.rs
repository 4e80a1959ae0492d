//! Reading and writing scans through the public API.

mod damage;
mod damaged_volumes;
mod dicom;
mod dicom_write;
mod meta_image;
mod nifti;
mod nrrd;
mod real;
mod series;
mod volumes;
mod write;
