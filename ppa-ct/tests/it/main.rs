//! Reading, changing and writing scans through the public API.

mod audit;
mod audit_leg;
mod audit_real;
mod damage;
mod damaged_volumes;
mod dicom;
mod dicom_odd;
mod dicom_write;
mod hostile_jpeg_2000;
mod hostile_places;
mod meta_image;
mod meta_image_write;
mod nifti;
mod nrrd;
mod nrrd_refused;
mod real;
mod real_dicom;
mod resample;
mod series;
mod text_headers;
mod volumes;
mod write;
