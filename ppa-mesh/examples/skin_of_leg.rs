//! The skin of a leg on a table: couch removed, a thicker variant, written as PLY.
//!
//! `cargo run -p ppa-mesh --example skin_of_leg`

use std::error::Error;

use ppa_mesh::{LimbSettings, extract_limb, offset, write_mesh_file};
use ppa_phantom::{LowerLeg, TableTop};

fn main() -> Result<(), Box<dyn Error>> {
    let ct = LowerLeg::p01().voxelise(3.0, TableTop::Present)?;
    let limb = extract_limb(&ct, &LimbSettings::default())?;
    let thicker = offset(&limb.mesh, 5.0)?;
    for (name, mesh) in [("skin", &limb.mesh), ("thicker", &thicker)] {
        let closed = limb.walls.close(mesh);
        println!(
            "{name}: {} triangles, {:.0} cm³",
            closed.triangles.len(),
            closed.volume_mm3() / 1000.0
        );
    }

    let folder = tempfile::tempdir()?;
    let path = folder.path().join("skin.ply");
    write_mesh_file(&path, &limb.mesh)?;
    println!("{} bytes of PLY", std::fs::metadata(&path)?.len());
    Ok(())
}
