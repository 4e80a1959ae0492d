//! A file of MC-GPU: the first byte selects input, material or voxels.

#![no_main]

use libfuzzer_sys::fuzz_target;
use ppa_xray::mcgpu;

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let name = ["run.in", "bone.mcgpu", "phantom.vox"][usize::from(kind % 3)];
    ppa_fuzz::with_file(name, data, |path| match kind % 3 {
        0 => drop(mcgpu::Input::read(path)),
        1 => drop(mcgpu::read_material(path)),
        _ => drop(mcgpu::VoxelFile::read(path)),
    });
});
