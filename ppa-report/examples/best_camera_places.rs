//! Plots the places above an ankle from which a depth camera sees most of it.
//!
//! `cargo run -p ppa-report --example best_camera_places -- [PLOT.png]`

use std::error::Error;
use std::path::PathBuf;

use ppa_depth::{
    Body, Camera, CameraSpec, CoverageSettings, DepthMode, JointSurface, MeshBody, PlacedBody,
    Viewpoint,
};
use ppa_mesh::{Border, iso_surface};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_report::{RankedView, coverage_plot, write_picture};

fn main() -> Result<(), Box<dyn Error>> {
    let temporary = tempfile::tempdir()?;
    let path = std::env::args_os().nth(1);
    let path = path.map_or(temporary.path().join("places.png"), PathBuf::from);
    let leg = LowerLeg::p01();
    let joint = leg.truth().joint_centre;
    let skin = iso_surface(
        &leg.voxelise(3.0, TableTop::Absent)?,
        -500.0,
        Border::Closed,
    )?;
    let mesh = MeshBody::new(&skin.vertices, &skin.triangles)?;
    let surface = JointSurface::new(&mesh, &joint, &CoverageSettings::default())?;
    let body = Body::from(mesh);
    let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovUnbinned))?;

    let seen_from = |viewpoint: Viewpoint| {
        let camera_from_mesh = viewpoint.frame_from_camera(&joint).inverse();
        let scene = [PlacedBody {
            body: &body,
            camera_from_body: camera_from_mesh,
        }];
        RankedView {
            viewpoint,
            coverage: surface.seen(&camera, &camera_from_mesh, &scene),
        }
    };
    let places = Viewpoint::dome(30.0, 15.0, &[800.0]);
    let mut views: Vec<_> = places.into_iter().map(seen_from).collect();
    views.sort_by(|a, b| a.coverage.best_first(&b.coverage));
    write_picture(&path, &coverage_plot(&views))?;
    let best = views[0];
    println!(
        "of {} places {:?} sees most: {:.0} % of the surface",
        views.len(),
        best.viewpoint,
        100.0 * best.coverage.visible_share
    );
    Ok(())
}
