//! Reading and writing scans through the public API.

mod damage;
mod dicom;
mod nifti;
mod real;
mod series;
