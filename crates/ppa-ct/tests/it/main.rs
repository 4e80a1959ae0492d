//! Reading, changing and writing scans through the public API.

mod audit;
mod damage;
mod damaged_volumes;
mod dicom;
mod dicom_odd;
mod dicom_write;
mod meta_image;
mod nifti;
mod nrrd;
mod real;
mod resample;
mod series;
mod volumes;
mod write;
