//! Makes a leg of the built-in family and prints the true values that measurements should give.
//!
//! `cargo run -p ppa-phantom --example leg_truth -- [NAME]`

use std::error::Error;

use nalgebra::Vector3;
use ppa_phantom::{LowerLeg, Side, TableTop};

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "P07".to_owned());
    let leg = LowerLeg::family(&name, Side::Left)?;
    let ct = leg.voxelise(4.0, TableTop::Present)?;
    let truth = leg.truth();
    println!(
        "{name}: {:?} voxels of 4 mm, foot {:.0} mm long",
        ct.grid().size(),
        truth.foot_length_mm
    );

    // Tissues along a ray through the joint from front to back, by formula rather than by voxels.
    let start = truth.joint_centre - 200.0 * Vector3::y();
    for chord in leg.chords(&start, &Vector3::y_axis(), 400.0) {
        println!("{:5.1} mm of {:?}", chord.length_mm(), chord.tissue);
    }
    Ok(())
}
