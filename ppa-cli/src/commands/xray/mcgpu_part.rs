//! `ppa xray mcgpu --part`: a share of the histories of each projection.

use std::fs;
use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::Context;
use ppa_xray::mcgpu::{ScanPart, Simulation};
use serde::Serialize;

use super::follow::SAVE_EVERY;
use crate::interrupt::Interrupt;
use crate::output::{Output, Seconds, Stopwatch, working};
use crate::output_files::require_room;

#[derive(Debug, Serialize)]
struct Followed {
    part: String,
    /// Histories of each projection in this part.
    histories: u64,
    tallies: Vec<PathBuf>,
    #[serde(flatten)]
    seconds: Seconds,
}

/// Simulates the histories of a part into its tallies; existing tallies are continued.
pub fn follow_part(
    simulation: &Simulation,
    scan_part: &ScanPart,
    output: Output,
) -> anyhow::Result<()> {
    let out = scan_part.folder;
    fs::create_dir_all(out)
        .with_context(|| format!("cannot create the folder {}", out.display()))?;
    require_room(out, simulation.missing_part_bytes(scan_part)?)?;
    let interrupt = Interrupt::listen()?;
    let working = working("following photons");
    let watch = Stopwatch::start();
    let stations = simulation.input().stations();
    let mut tallies = Vec::new();
    for (index, station) in stations.iter().enumerate() {
        let which = format!("projection {} of {}", index + 1, stations.len());
        working.set_message(which.clone());
        let complete = simulation.follow_part(station, scan_part, SAVE_EVERY, |progress| {
            if let Some(left) = progress.remaining {
                working.set_message(format!("{which}, {:.0} s left", left.as_secs_f64()));
            }
            match interrupt.is_asked() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        })?;
        tallies.push(Simulation::part_tally(out, station));
        if !complete || (interrupt.is_asked() && tallies.len() < stations.len()) {
            return Err(interrupt.stopped(format!(
                "in {which}; the tallies in {} are kept, repeat the command to resume",
                out.display()
            )));
        }
    }
    working.finish_and_clear();
    let share = scan_part.part.share(scan_part.histories);
    let followed = Followed {
        part: scan_part.part.to_string(),
        histories: share.end - share.start,
        tallies,
        seconds: watch.read(),
    };
    output.print(&followed, |followed| {
        format!(
            "part {}: {:.3e} histories of each of {} projections, {:.1} s, {:.1} CPU s",
            followed.part,
            followed.histories as f64,
            followed.tallies.len(),
            followed.seconds.wall_s,
            followed.seconds.cpu_s,
        )
    })
}
