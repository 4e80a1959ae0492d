//! Lays a leg on the table of the built-in x-ray room, rotated inwards by 18 degrees.
//!
//! `cargo run -p ppa-scene --example place_leg`

use std::error::Error;

use ppa_mesh::{LimbSettings, extract_limb};
use ppa_phantom::{LowerLeg, Side, TableTop};
use ppa_scene::{
    LandmarkOverrides, PlaneSettings, RoomSpec, XrayRoom, find_landmarks, place, table_plane,
};

fn main() -> Result<(), Box<dyn Error>> {
    let ct = LowerLeg::p01().voxelise(2.0, TableTop::Present)?;
    let limb = extract_limb(&ct, &LimbSettings::default())?;
    let choices = LandmarkOverrides::default();
    let landmarks = find_landmarks(&ct, &limb.mesh, &limb.mask, Side::Right, &choices)?;

    let room = XrayRoom::parametric(&RoomSpec::default())?;
    let table = table_plane(&room.cloud, &PlaneSettings::for_device(&room.device), 1)?.plane;
    let angle = 18_f64.to_radians();
    let placed = place(&limb.mesh.vertices, &landmarks, angle, &table, &room.device)?;
    println!("joint at {:.1?} mm of the scan", landmarks.joint_centre);
    println!(
        "rests on two places {:.0} mm apart, {:.2} mm above the table",
        placed.contact.apart_mm, placed.contact.gap_mm
    );
    Ok(())
}
