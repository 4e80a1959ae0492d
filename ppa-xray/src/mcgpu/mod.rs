//! Unmodified input files of MC-GPU v1.3 (Badal and Badano, Med. Phys. 36:4878, 2009, doi:10.1118/1.3231824).
//!
//! [`Simulation::read`] reads an input file and all files named in it: penEasy geometry (`.vox`), materials (`.mcgpu`), spectrum
//! (`.spc`), detector, scan, doses; text or gzip. Paths are relative to the folder of the input file. A material line `ppa:NAME` means
//! a material of this library ([`Material::named`](crate::Material::named)). Results have the layout of MC-GPU.
//!
//! Deliberate differences from MC-GPU are listed in `docs/physics.md`, section "Agreement with other codes".

mod analog;
mod dose_file;
mod error;
mod image_file;
mod input;
mod lines;
#[cfg(test)]
pub(crate) mod mangled;
mod material_file;
mod material_lines;
mod part;
mod rational_inverse;
mod scan;
mod scan_error;
mod sections;
mod simulation;
mod trajectory;
mod values;
mod voxel_file;
mod voxel_header;

pub use dose_file::{ScanDose, ScanDoseError};
pub use error::McgpuError;
pub use image_file::McgpuImage;
pub use input::Input;
pub use material_file::read_material;
pub use part::ScanPart;
pub use scan::{CompleteProjection, Scan};
pub use scan_error::ScanError;
pub use sections::{MaterialLine, MaterialSource, RunLength, Trajectory, VoxelDose};
pub use simulation::Simulation;
pub use trajectory::Station;
pub use values::NamedFile;
pub use voxel_file::VoxelFile;
