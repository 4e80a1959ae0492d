//! `ppa xray mcgpu`: runs an input file of MC-GPU v1.3 as it is.

use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use ppa_xray::mcgpu::{RunLength, Simulation};
use ppa_xray::{AnalogSettings, CategorySums, Engine, FastSettings, analog, fast};
use serde::Serialize;

use super::simulate::EngineName;
use crate::output::{Output, Seconds, Stopwatch, working};

#[derive(Debug, Args)]
pub struct McgpuArgs {
    /// Input file of MC-GPU v1.3
    input: PathBuf,
    /// Engine
    #[arg(long, value_enum, default_value = "analog")]
    engine: EngineName,
    /// Histories of each projection: followed (analog) or whose noise the image carries (fast) [default: those of the file]
    #[arg(long)]
    histories: Option<f64>,
    /// Seed of histories and noise [default: that of the file]
    #[arg(long)]
    seed: Option<u64>,
    /// Folder for the images and doses, which get the names that the file gives them
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Serialize)]
struct Simulated {
    projections: Vec<Projected>,
    /// Of each projection.
    histories: f64,
    engine: Engine,
    #[serde(flatten)]
    seconds: Seconds,
}

#[derive(Debug, Serialize)]
struct Projected {
    number: u32,
    angle_deg: f64,
    #[serde(flatten)]
    sums: CategorySums,
    image: PathBuf,
}

pub fn run(args: &McgpuArgs, output: Output) -> anyhow::Result<()> {
    let working = working("reading the input files");
    let mut simulation = Simulation::read(&args.input)?;
    if let Some(seed) = args.seed {
        simulation.set_seed(seed);
    }
    let histories = match (args.histories, simulation.input().run_length) {
        (Some(histories), _) => histories,
        (None, RunLength::Histories(histories)) => histories as f64,
        (None, RunLength::Seconds(seconds)) => anyhow::bail!(
            "{} asks for a run of {seconds} s; give the number of histories with --histories",
            args.input.display()
        ),
    };
    anyhow::ensure!(
        (1.0..=1e15).contains(&histories),
        "--histories is {histories}, expected 1 to 1e15"
    );
    let stations = simulation.input().stations();
    anyhow::ensure!(
        !stations.is_empty(),
        "{}: no projection has an angle of interest",
        args.input.display()
    );
    fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the folder {}", args.out.display()))?;
    let watch = Stopwatch::start();
    let mut projections = Vec::new();
    let mut engine = Engine::Analog;
    for (done, station) in stations.iter().enumerate() {
        working.set_message(format!("projection {} of {}", done + 1, stations.len()));
        let projection = simulation.projection(station);
        let seed = simulation.seed(station);
        let (phantom, spectrum) = (simulation.phantom(), simulation.spectrum());
        let radiograph = match args.engine {
            EngineName::Analog => {
                let settings = AnalogSettings {
                    histories: histories as u64,
                    seed,
                };
                analog(phantom, spectrum, &projection, &settings)?
            }
            EngineName::Fast => {
                let settings = FastSettings {
                    dose_histories: histories,
                    seed,
                    ..FastSettings::default()
                };
                fast(phantom, spectrum, &projection, &settings)?
            }
        };
        simulation.write_image(&args.out, station, &radiograph)?;
        engine = radiograph.engine;
        projections.push(Projected {
            number: station.number,
            angle_deg: station.angle_deg,
            sums: radiograph.sums,
            image: args.out.join(simulation.image_name(station)),
        });
    }
    working.finish_and_clear();
    let result = Simulated {
        projections,
        histories,
        engine,
        seconds: watch.read(),
    };
    output.print(&result, |result| {
        let mut text = "eV per history on the detector\n".to_owned();
        for projected in &result.projections {
            text += &format!(
                "{} ({:.2}°):",
                projected.image.display(),
                projected.angle_deg
            );
            for category in ppa_xray::Category::ALL {
                let (value, se) = projected.sums.of(category);
                text += &format!(" {} {value:.3} ± {se:.3}", category.name());
            }
            text.push('\n');
        }
        text + &format!(
            "{:.3e} histories each, {:.1} s, {:.1} CPU s",
            result.histories, result.seconds.wall_s, result.seconds.cpu_s,
        )
    })
}
