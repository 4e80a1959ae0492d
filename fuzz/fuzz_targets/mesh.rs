//! A mesh or cloud: the first byte selects PLY, OBJ or STL.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let name = ["mesh.ply", "mesh.obj", "mesh.stl"][usize::from(kind % 3)];
    ppa_fuzz::with_file(name, data, |path| {
        let _ = ppa_mesh::read_mesh_file(path);
    });
});
