//! Writes the inputs on which `benches/peers` measures other programs: `peer_inputs FOLDER`.
//!
//! `leg.nii` is the volume of `cargo bench -p ppa-mesh`, `room.ply` the cloud of `cargo bench -p ppa-scene`, `tube.ply` the mesh of
//! `cargo bench -p ppa-depth`.

#[path = "../../ppa-mesh/benches/leg/mod.rs"]
mod leg;
#[path = "../../ppa-scene/tests/it/recorded_room.rs"]
mod recorded_room;
#[path = "../../ppa-depth/benches/tube/mod.rs"]
mod tube;

use std::error::Error;
use std::path::PathBuf;

use ppa_mesh::{Mesh, write_cloud_file, write_mesh_file};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).ok_or("expected a folder")?;
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder)?;

    let leg = leg::leg();
    ppa_ct::write(&folder.join("leg.nii"), &leg)?;
    let room = recorded_room::room_cloud(368_640, 11, 300.0..1400.0);
    write_cloud_file(&folder.join("room.ply"), &room)?;
    let (vertices, triangles) = tube::tube();
    println!(
        "{} voxels, {} points, {} triangles",
        leg.grid().len(),
        room.points.len(),
        triangles.len()
    );
    let tube = Mesh {
        vertices,
        triangles,
        normals: Vec::new(),
    };
    write_mesh_file(&folder.join("tube.ply"), &tube)?;
    Ok(())
}
