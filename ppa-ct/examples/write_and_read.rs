//! A volume by formula, written as NIfTI and as a DICOM series and read back.
//!
//! `cargo run -p ppa-ct --example write_and_read -- [FOLDER]`

use std::error::Error;
use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use ppa_ct::{Grid, Volume, read, write};

fn main() -> Result<(), Box<dyn Error>> {
    // A ball of water, 40 mm across, in air.
    let grid = Grid::axis_aligned(
        [64; 3],
        Vector3::repeat(1.0),
        Point3::new(-32.0, -32.0, 0.0),
    )?;
    let centre = Point3::new(0.0, 0.0, 32.0);
    let hu = (0..grid.len()).map(|index| {
        let place = grid.centre(grid.voxel(index).map(|n| n as f64));
        if (place - centre).norm() < 20.0 {
            0
        } else {
            -1000
        }
    });
    let volume = Volume::from_i16(grid.clone(), hu.collect())?;

    let temporary = tempfile::tempdir()?;
    let folder = std::env::args_os().nth(1);
    let folder = folder.map_or(temporary.path().to_owned(), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    for name in ["ball.nii.gz", "ball"] {
        let path = folder.join(name);
        write(&path, &volume)?;
        let scan = read(&path)?;
        let water = scan.volume.hu().iter().filter(|&&hu| hu > -500.0).count();
        println!(
            "{name}: {:?} voxels, {water} of water, {} warnings",
            scan.volume.grid().size(),
            scan.warnings.len()
        );
    }
    Ok(())
}
