//! `ppa xray mcgpu`: runs an unchanged input file of MC-GPU v1.3.

use std::collections::BTreeSet;
use std::fs;
use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use indicatif::ProgressBar;
use ppa_cluster::HistoryCost;
use ppa_core::Part;
use ppa_xray::mcgpu::{RunLength, Scan, ScanDose, ScanPart, Simulation, Station};
use ppa_xray::{AnalogSettings, CategorySums, Engine, FastSettings, Imparted, Radiograph, fast};
use serde::Serialize;

use super::divisible::{Divisible, MEASURE, refuse_given};
use super::follow::SAVE_EVERY;
use super::mcgpu_part::follow_part;
use super::simulate::EngineName;
use crate::interrupt::Interrupt;
use crate::output::{Output, Seconds, Stopwatch, working};
use crate::output_files::{ReplaceArgs, require_room};

#[derive(Debug, Args)]
pub struct McgpuArgs {
    /// Input file of MC-GPU v1.3; a material line `ppa:NAME` selects a built-in material
    input: PathBuf,
    /// Engine; doses need the analog one
    #[arg(long, value_enum, default_value = "analog")]
    engine: EngineName,
    /// Histories of each projection: to follow (analog), or whose noise the image has (fast) [default: as in the file]
    #[arg(long)]
    histories: Option<f64>,
    /// Seed of histories and noise [default: that of the file]
    #[arg(long)]
    seed: Option<u64>,
    /// Folder for images and doses, named as in the file. Until the scan is complete, IMAGE.tally in this folder keeps what has been
    /// simulated; the same command resumes from it
    #[arg(long)]
    out: PathBuf,
    /// Follow only part k of n of the histories of each projection; --out gets tallies for --merge, no images
    #[arg(long, value_name = "K/N")]
    part: Option<Part>,
    /// Combine the histories in these --part folders, one for each part, and follow none
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with = "part")]
    merge: Vec<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

/// Smallest size of a pixel: five numbers in the raw image, and at least four digits with their spaces as text.
const LEAST_PIXEL_BYTES: u64 = 5 * 4 + 8;

#[derive(Debug, Serialize)]
struct Simulated {
    projections: Vec<Projected>,
    /// Histories of each projection; the smallest number, if a time limits them.
    histories: f64,
    engine: Engine,
    #[serde(flatten)]
    dose: Option<MaterialDose>,
    #[serde(flatten)]
    seconds: Seconds,
}

#[derive(Debug, Serialize)]
struct Projected {
    /// Index of the projection in the complete scan, from 0.
    number: u32,
    angle_deg: f64,
    #[serde(flatten)]
    sums: CategorySums,
    histories: f64,
    image: PathBuf,
}

/// Dose by line of the material list, per history of all projections.
#[derive(Debug, Serialize)]
struct MaterialDose {
    material_dose_ev_per_history: Vec<f64>,
    material_dose_ev_per_history_se: Vec<f64>,
    material_mass_g: Vec<f64>,
}

pub fn run(args: &McgpuArgs, output: Output) -> anyhow::Result<()> {
    let working = working("reading the input files");
    let simulation = args.read()?;
    let length = args.length(simulation.input().run_length)?;
    let stations = simulation.input().stations();
    if let Some(part) = args.part {
        let histories = args.histories(length, "--part")?;
        let scan_part = ScanPart {
            histories,
            part,
            folder: &args.out,
            replace: args.replace.is_given(),
        };
        return follow_part(&simulation, &scan_part, output);
    }
    let scan = args.start(&simulation, length)?;
    let written = scan.written();
    args.declare(&simulation, &stations, &scan, &written)?;
    let interrupt = Interrupt::listen()?;
    let is_new = !args.out.exists();
    fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create the folder {}", args.out.display()))?;

    let watch = Stopwatch::start();
    let scanned = args
        .simulate(&simulation, &stations, scan, &written, &working, &interrupt)
        .and_then(|scan| args.finish(&simulation, &stations, scan));
    if scanned.is_err() && is_new {
        // Removed only if it is empty.
        let _ = fs::remove_dir(&args.out);
    }
    let (projections, dose) = scanned?;
    working.finish_and_clear();
    let fewest = |fewest: f64, projected: &Projected| fewest.min(projected.histories);
    let result = Simulated {
        histories: projections.iter().fold(f64::INFINITY, fewest),
        projections,
        engine: args.engine(),
        dose: dose.map(|dose| MaterialDose::new(&dose.materials())),
        seconds: watch.read(),
    };
    output.print(&result, text)
}

impl McgpuArgs {
    /// The interrupted scan in the folder, or a new one.
    fn start<'a>(&self, simulation: &'a Simulation, length: RunLength) -> anyhow::Result<Scan<'a>> {
        let scan = Scan::new(simulation, length, self.engine(), &self.out);
        let path = scan.tally_path();
        if path.symlink_metadata().is_err() {
            return Ok(scan);
        }
        match Scan::resume(simulation, length, self.engine(), &self.out) {
            Err(_) if self.replace.is_given() => Ok(scan),
            resumed => resumed.with_context(|| {
                let out = self.out.display();
                format!("cannot resume the scan in {out} (--replace starts over)")
            }),
        }
    }

    /// Simulates the projections that `scan` lacks, and finished ones whose images are not among the files `written`.
    fn simulate<'a>(
        &self,
        simulation: &Simulation,
        stations: &[Station],
        mut scan: Scan<'a>,
        written: &BTreeSet<String>,
        working: &ProgressBar,
        interrupt: &Interrupt,
    ) -> anyhow::Result<Scan<'a>> {
        let tally = scan.tally_path();
        let stopped = |scan: &Scan| {
            interrupt.stopped(format!(
                "after {} of {} projections; repeat the command to resume from {}",
                scan.complete().len(),
                stations.len(),
                tally.display()
            ))
        };
        for (index, station) in stations.iter().enumerate() {
            let mut names = simulation.image_names(station).into_iter();
            if scan.projection(station).is_some() && names.all(|name| written.contains(&name)) {
                continue;
            }
            if interrupt.is_asked() {
                return Err(stopped(&scan));
            }
            let which = format!("projection {} of {}", index + 1, stations.len());
            working.set_message(which.clone());
            let simulated = match self.engine {
                _ if !self.merge.is_empty() => {
                    let histories = self.histories(scan.length(station), "--merge")?;
                    Some(simulation.merge_parts(station, histories, &self.merge)?)
                }
                EngineName::Analog => scan.analog(station, SAVE_EVERY, |progress| {
                    if let Some(left) = progress.remaining {
                        working.set_message(format!("{which}, {:.0} s left", left.as_secs_f64()));
                    }
                    match interrupt.is_asked() {
                        true => ControlFlow::Break(()),
                        false => ControlFlow::Continue(()),
                    }
                })?,
                EngineName::Fast => {
                    let radiograph = self.fast(simulation, station, scan.length(station))?;
                    Some((radiograph, None))
                }
            };
            let Some((radiograph, dose)) = simulated else {
                return Err(stopped(&scan));
            };
            scan.add(station, &radiograph, dose.as_ref())?;
        }
        Ok(scan)
    }

    /// Writes the doses that the file asks for and finishes the scan.
    fn finish(
        &self,
        simulation: &Simulation,
        stations: &[Station],
        scan: Scan,
    ) -> anyhow::Result<(Vec<Projected>, Option<ScanDose>)> {
        let projections = stations
            .iter()
            .filter_map(|station| Some((station, scan.projection(station)?)))
            .map(|(station, projection)| Projected {
                number: station.number,
                angle_deg: station.angle_deg,
                sums: projection.sums,
                histories: projection.histories,
                image: self.out.join(simulation.image_name(station)),
            })
            .collect();
        Ok((projections, scan.finish()?))
    }

    /// Declares all files of the scan except those `written`.
    fn declare(
        &self,
        simulation: &Simulation,
        stations: &[Station],
        scan: &Scan,
        written: &BTreeSet<String>,
    ) -> anyhow::Result<()> {
        let mut outputs = self.replace.outputs();
        let mut names = simulation.file_names(stations);
        names.retain(|name| !written.contains(name));
        for path in names.into_iter().map(|name| self.out.join(name)) {
            if path.parent() == Some(&self.out) {
                outputs.file_in_new_folder("--out", &path, &[])?;
            } else {
                outputs.file("--out", &path, &[])?;
            }
        }
        if !scan.tally_path().exists() {
            outputs.file_in_new_folder("the tally", &scan.tally_path(), &[])?;
        }
        let pixels: u64 = simulation.input().pixels.map(u64::from).iter().product();
        let missing = stations.len() - scan.complete().len();
        require_room(&self.out, LEAST_PIXEL_BYTES * pixels * missing as u64)
    }

    /// The histories of this command, for division into tasks.
    pub fn divisible(&self) -> anyhow::Result<Divisible> {
        refuse_given(&[
            ("--part", self.part.is_some()),
            ("--merge", !self.merge.is_empty()),
        ])?;
        let simulation = self.read()?;
        let length = self.length(simulation.input().run_length)?;
        let histories = self.histories(length, "a division into tasks")?;
        Ok(Divisible {
            input: self.input.clone(),
            histories,
            projections: simulation.input().stations().len() as u64,
        })
    }

    /// Refuses outputs that could not be written at the end.
    pub fn check_outputs(&self) -> anyhow::Result<()> {
        let simulation = self.read()?;
        let length = self.length(simulation.input().run_length)?;
        let scan = self.start(&simulation, length)?;
        let stations = simulation.input().stations();
        self.declare(&simulation, &stations, &scan, &scan.written())
    }

    /// Processor time per history, measured on some of the first projection.
    pub fn cost(&self) -> anyhow::Result<HistoryCost> {
        let watch = Stopwatch::start();
        let simulation = self.read()?;
        let stations = simulation.input().stations();
        let station = (stations.first()).expect("read refuses a scan without projections");
        let preparation_cpu_s = watch.read().cpu_s;
        let length = RunLength::Seconds(MEASURE.as_secs_f64());
        let (radiograph, _) = simulation.analog(station, length, |_| ControlFlow::Continue(()))?;
        let follow_cpu_s = watch.read().cpu_s - preparation_cpu_s;
        Ok(HistoryCost {
            million_cpu_s: follow_cpu_s * 1e6 / radiograph.histories,
            preparation_cpu_s,
        })
    }

    /// Reads the input file and all files that it names; checks that it has a projection.
    fn read(&self) -> anyhow::Result<Simulation> {
        let mut simulation = Simulation::read(&self.input)?;
        if let Some(seed) = self.seed {
            simulation.set_seed(seed);
        }
        anyhow::ensure!(
            !simulation.input().stations().is_empty(),
            "{}: no projection has an angle of interest",
            self.input.display()
        );
        Ok(simulation)
    }

    fn engine(&self) -> Engine {
        match self.engine {
            EngineName::Analog => Engine::Analog,
            EngineName::Fast => Engine::Fast,
        }
    }

    fn length(&self, in_file: RunLength) -> anyhow::Result<RunLength> {
        let Some(histories) = self.histories else {
            return Ok(in_file);
        };
        anyhow::ensure!(
            (1.0..=1e15).contains(&histories),
            "--histories is {histories}, expected 1 to 1e15"
        );
        Ok(RunLength::Histories(histories as u64))
    }

    /// Histories of each projection for an option that needs their number and the analog engine.
    fn histories(&self, length: RunLength, option: &str) -> anyhow::Result<u64> {
        anyhow::ensure!(
            matches!(self.engine, EngineName::Analog),
            "{option} needs --engine analog"
        );
        match length {
            RunLength::Histories(histories) if histories <= AnalogSettings::MOST_HISTORIES => {
                Ok(histories)
            }
            RunLength::Histories(histories) => anyhow::bail!(
                "{histories} histories of each projection, expected at most {:e} for the analog engine",
                AnalogSettings::MOST_HISTORIES as f64
            ),
            RunLength::Seconds(_) => anyhow::bail!(
                "{} limits the time of a run; {option} needs --histories",
                self.input.display()
            ),
        }
    }

    fn fast(
        &self,
        simulation: &Simulation,
        station: &Station,
        length: RunLength,
    ) -> anyhow::Result<Radiograph> {
        let file = self.input.display();
        anyhow::ensure!(
            simulation.dose_settings().is_none(),
            "{file} asks for doses, which --engine analog counts; for --engine fast answer NO in its section DOSE DEPOSITION"
        );
        let RunLength::Histories(histories) = length else {
            anyhow::bail!("{file} limits the time of a run; --engine fast needs --histories");
        };
        let settings = FastSettings::default()
            .with_dose_histories(histories as f64)
            .with_seed(simulation.seed(station));
        let projection = simulation.projection(station);
        Ok(fast(
            simulation.phantom(),
            simulation.spectrum(),
            &projection,
            &settings,
        )?)
    }
}

impl MaterialDose {
    fn new(materials: &[Imparted]) -> Self {
        let all = |of: fn(&Imparted) -> f64| materials.iter().map(of).collect();
        Self {
            material_dose_ev_per_history: all(|imparted| imparted.ev_per_history.value),
            material_dose_ev_per_history_se: all(|imparted| imparted.ev_per_history.se),
            material_mass_g: all(|imparted| imparted.mass_g),
        }
    }
}

fn text(result: &Simulated) -> String {
    let mut text = "eV per history on the detector\n".to_owned();
    for projected in &result.projections {
        let image = projected.image.display();
        text += &format!("{image} ({:.2}°):", projected.angle_deg);
        for category in ppa_xray::Category::ALL {
            let (value, se) = projected.sums.of(category);
            text += &format!(" {} {value:.3} ± {se:.3}", category.name());
        }
        text.push('\n');
    }
    if let Some(dose) = &result.dose {
        text += "eV per history in the materials\n";
        let estimates = dose
            .material_dose_ev_per_history
            .iter()
            .zip(&dose.material_dose_ev_per_history_se);
        for (index, (value, se)) in estimates.enumerate() {
            text += &format!("{:>3} {value:.3} ± {se:.3}\n", index + 1);
        }
    }
    text + &format!(
        "{:.3e} histories each, {:.1} s, {:.1} CPU s",
        result.histories, result.seconds.wall_s, result.seconds.cpu_s,
    )
}
