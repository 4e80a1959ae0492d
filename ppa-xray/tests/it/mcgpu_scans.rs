//! Scans of MC-GPU input files that are interrupted or divided into parts.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use ppa_xray::mcgpu::{RunLength, Scan, ScanDose, ScanPart, Simulation};
use ppa_xray::{AnalogTally, Engine, Progress};

use crate::mcgpu::{SCAN, simulation};

/// Names and contents of the files in a folder.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let mut files: Vec<_> = entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect();
    files.sort();
    files
}

/// Each call runs one batch of histories and is then interrupted; the next one resumes from the file.
#[test]
fn a_scan_cut_into_pieces_writes_the_same_files() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation(folder.path(), &SCAN).unwrap();
    let stations = &simulation.input().stations()[..2];
    let length = RunLength::Histories(60_000);
    let resumed = folder.path().join("resumed");
    let whole = folder.path().join("whole");
    for out in [&resumed, &whole] {
        fs::create_dir(out).unwrap();
    }
    let start = || Scan::new(&simulation, length, Engine::Analog, &resumed);
    let mut pieces = 0;
    let scan = loop {
        let mut scan = match start().tally_path().exists() {
            true => Scan::resume(&simulation, length, Engine::Analog, &resumed).unwrap(),
            false => start(),
        };
        let next = stations.iter().find(|s| scan.projection(s).is_none());
        let Some(station) = next else {
            break scan;
        };
        let mut batches = 0;
        let simulated = scan.analog(station, Duration::ZERO, |_| {
            batches += 1;
            match batches {
                1 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        });
        pieces += 1;
        if let Some((image, dose)) = simulated.unwrap() {
            scan.add(station, &image, dose.as_ref()).unwrap();
        }
    };
    assert!(pieces > 2, "{pieces}");
    let resumed_dose = scan.finish().unwrap().unwrap();

    let mut scan_dose = ScanDose::new(&simulation);
    for station in stations {
        let (image, dose) = simulation
            .analog(station, length, |_| ControlFlow::Continue(()))
            .unwrap();
        scan_dose.add(&simulation, &dose.unwrap()).unwrap();
        simulation.write_image(&whole, station, &image).unwrap();
    }
    scan_dose.write(&whole, &simulation).unwrap();
    assert_eq!(resumed_dose, scan_dose);
    assert!(files(&resumed) == files(&whole));
}

#[test]
fn interrupted_parts_merge_to_the_projection_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut simulation = simulation(folder.path(), &SCAN).unwrap();
    let histories = 60_000;
    let station = &{ simulation.input().stations()[1] };
    let out = [folder.path().join("1"), folder.path().join("2")];
    let part = |number: usize, replace| ScanPart {
        histories,
        part: format!("{number}/2").parse().unwrap(),
        folder: &out[number - 1],
        replace,
    };
    let mut pieces = 0;
    for number in [1, 2] {
        fs::create_dir(&out[number - 1]).unwrap();
        let missing = simulation.missing_part_bytes(&part(number, false)).unwrap();
        loop {
            pieces += 1;
            let stop = |_: &Progress| ControlFlow::Break(());
            let part = part(number, false);
            let followed = simulation.follow_part(station, &part, Duration::ZERO, stop);
            if followed.unwrap() {
                break;
            }
        }
        let tally = Simulation::part_tally(&out[number - 1], station);
        let found = AnalogTally::read_histories(&tally).unwrap();
        assert_eq!(found.done, found.part);
        assert_eq!(found.of_run, histories);
        let left = simulation.missing_part_bytes(&part(number, false)).unwrap();
        // Numbers of histories in its header vary by a few digits.
        let written = fs::metadata(&tally).unwrap().len();
        assert!((missing - left).abs_diff(written) < 100);
    }
    assert!(pieces > 2, "{pieces}");
    let (image, dose) = simulation.merge_parts(station, histories, &out).unwrap();
    let length = RunLength::Histories(histories);
    let whole = simulation.analog(station, length, |_| ControlFlow::Continue(()));
    assert_eq!((image, dose), whole.unwrap());
    let refused = simulation.merge_parts(station, histories + 1, &out);
    assert!(refused.unwrap_err().to_string().contains("60001"));

    // A tally of another seed is never continued, and replaced only on request.
    simulation.set_seed(99);
    let follow = |replace| {
        simulation.follow_part(station, &part(1, replace), Duration::MAX, |_| {
            ControlFlow::Continue(())
        })
    };
    let refused = follow(false).unwrap_err().to_string();
    assert!(
        refused.contains("belongs to another simulation"),
        "{refused}"
    );
    assert!(follow(true).unwrap());
}

#[test]
fn a_lost_image_of_a_timed_scan_is_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation(folder.path(), &SCAN).unwrap();
    let station = &simulation.input().stations()[0];
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    let length = RunLength::Seconds(0.05);
    let expose = |mut scan: Scan| {
        let simulated = scan.analog(station, Duration::MAX, |_| ControlFlow::Continue(()));
        let (image, dose) = simulated.unwrap().unwrap();
        scan.add(station, &image, dose.as_ref()).unwrap();
    };
    expose(Scan::new(&simulation, length, Engine::Analog, &out));
    let before = files(&out);
    let [text, _] = simulation.image_names(station);
    fs::remove_file(out.join(&text)).unwrap();
    let scan = Scan::resume(&simulation, length, Engine::Analog, &out).unwrap();
    assert!(!scan.written().contains(&text));
    expose(scan);
    assert!(files(&out) == before);
}
