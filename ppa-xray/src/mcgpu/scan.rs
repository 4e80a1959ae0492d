//! A scan that can be interrupted: its complete projections, the sums of the one under way, and the file that keeps both.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use ppa_core::{Part, whole_file};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::dose::report::Dose;
use crate::engine::analog::AnalogSettings;
use crate::engine::fast_settings::FastSettings;
use crate::image::output::write_whole;
use crate::image::radiograph::{CategorySums, Engine, Radiograph};
use crate::mcgpu::analog::stop;
use crate::mcgpu::dose_file::ScanDose;
use crate::mcgpu::scan_error::ScanError;
use crate::mcgpu::sections::RunLength;
use crate::mcgpu::simulation::Simulation;
use crate::mcgpu::trajectory::Station;
use crate::run::analog_tally::AnalogTally;
use crate::run::framed_file::{Frame, open};
use crate::run::key::{hex, key};
use crate::run::progress::{Progress, Stopped};
use crate::run::tally_error::TallyError;

const FRAME: Frame = Frame {
    magic: *b"ppaScanT",
    format: 1,
};

/// A complete projection of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompleteProjection {
    /// [`Station::number`].
    pub number: u32,
    /// Energy on the detector, eV per history.
    pub sums: CategorySums,
    /// Histories followed (analog) or whose noise the image carries (fast).
    pub histories: f64,
}

/// The projections of an input file, written into a folder one by one.
///
/// The file [`Scan::tally_path`] keeps what an interrupted scan needs: the SHA-256 of the files of complete projections, the
/// sums of their doses, and the [`AnalogTally`] of the projection under way. With a number of histories, a scan that was
/// interrupted and resumed writes the same bytes as one that was not. With a time limit, the time of the projection under
/// way begins again.
#[derive(Debug)]
pub struct Scan<'a> {
    simulation: &'a Simulation,
    length: RunLength,
    folder: PathBuf,
    key: String,
    complete: Vec<CompleteProjection>,
    /// SHA-256 of each file, by name.
    files: BTreeMap<String, String>,
    dose: Option<ScanDose>,
    under_way: Option<AnalogTally>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    key: String,
    complete: Vec<CompleteProjection>,
    files: BTreeMap<String, String>,
    dose_bytes: u64,
    under_way_bytes: u64,
}

impl<'a> Scan<'a> {
    /// A scan of which nothing is simulated; files go to `folder`.
    pub fn new(
        simulation: &'a Simulation,
        length: RunLength,
        engine: Engine,
        folder: impl Into<PathBuf>,
    ) -> Self {
        let dose = simulation
            .dose_settings()
            .map(|_| ScanDose::new(simulation));
        Self {
            simulation,
            length,
            folder: folder.into(),
            key: scan_key(simulation, length, engine),
            complete: Vec::new(),
            files: BTreeMap::new(),
            dose,
            under_way: None,
        }
    }

    /// The scan that was interrupted in `folder`.
    ///
    /// # Errors
    /// [`ScanError`] if the tally file cannot be read, is damaged, or is of another scan.
    pub fn resume(
        simulation: &'a Simulation,
        length: RunLength,
        engine: Engine,
        folder: impl Into<PathBuf>,
    ) -> Result<Self, ScanError> {
        let mut scan = Self::new(simulation, length, engine, folder);
        let path = scan.tally_path();
        let (file, found) = open(&path)?;
        let sums_len = |header: &Header| header.dose_bytes.checked_add(header.under_way_bytes);
        let (header, sums) = FRAME.read(&path, file, found, sums_len)?;
        if header.key != scan.key {
            return Err(ScanError::OtherScan { path });
        }
        let (dose, under_way) = sums.split_at(header.dose_bytes as usize);
        if scan.dose.is_some() {
            scan.dose = ScanDose::from_bytes(simulation, dose);
            if scan.dose.is_none() {
                let what = "its doses have the wrong size".to_owned();
                return Err(TallyError::Damaged { path, what }.into());
            }
        }
        if !under_way.is_empty() {
            let tally = AnalogTally::read_from(&path, under_way, header.under_way_bytes)?;
            scan.under_way = Some(tally);
        }
        scan.complete = header.complete;
        scan.files = header.files;
        Ok(scan)
    }

    /// The file that keeps an interrupted scan: `.tally` behind the name that the input file gives the images.
    pub fn tally_path(&self) -> PathBuf {
        let name = &self.simulation.input().image_file;
        self.folder.join(format!("{name}.tally"))
    }

    /// Names of the files in the folder that hold what this scan wrote.
    pub fn written(&self) -> BTreeSet<String> {
        let files = self.files.iter();
        files
            .filter(|(name, hash)| {
                fs::read(self.folder.join(name)).is_ok_and(|bytes| sha256(&bytes) == **hash)
            })
            .map(|(name, _)| name.clone())
            .collect()
    }

    /// All complete projections, in the order in which they were completed.
    pub fn complete(&self) -> &[CompleteProjection] {
        &self.complete
    }

    /// What a projection left, if it is complete.
    pub fn projection(&self, station: &Station) -> Option<&CompleteProjection> {
        let mut complete = self.complete.iter();
        complete.find(|projection| projection.number == station.number)
    }

    /// How long a projection runs: one that is complete as long as it did.
    pub fn length(&self, station: &Station) -> RunLength {
        match self.projection(station) {
            Some(projection) => RunLength::Histories(projection.histories as u64),
            None => self.length,
        }
    }

    /// Follows the photons of a projection and counts the doses asked for. The histories of an interrupted projection
    /// count; the tally file keeps them every `save_every` and when `observe` ends the run by [`ControlFlow::Break`].
    ///
    /// A complete projection is simulated again, without changing the tally file. `None` if `observe` ended the run.
    ///
    /// # Errors
    /// [`ScanError`] if the exposure makes no sense, or the tally file cannot be written.
    pub fn analog(
        &mut self,
        station: &Station,
        save_every: Duration,
        mut observe: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Option<(Radiograph, Option<Dose>)>, ScanError> {
        let is_new = self.projection(station).is_none();
        let length = self.length(station);
        let projection = self.simulation.projection(station);
        let run = self.simulation.analog_run(station, &projection, length)?;
        let mut tally = match self.under_way.take_if(|_| is_new) {
            Some(under_way) => run.resume(under_way, &self.tally_path(), Part::WHOLE)?,
            None => run.tally(Part::WHOLE),
        };
        let mut saved = Instant::now();
        let mut failed = None;
        let ended = run.follow(&mut tally, &stop(length), |tally, progress| {
            if is_new && saved.elapsed() > save_every {
                saved = Instant::now();
                if let Err(error) = self.save(Some(tally)) {
                    failed = Some(error);
                    return ControlFlow::Break(());
                }
            }
            observe(progress)
        })?;
        if let Some(error) = failed {
            return Err(error.into());
        }
        if ended == Stopped::Interrupted {
            if is_new {
                self.save(Some(&tally))?;
            }
            return Ok(None);
        }
        Ok(Some((tally.radiograph(), tally.dose())))
    }

    /// Adds a projection, and writes its image as [`Simulation::write_image`] does.
    ///
    /// # Errors
    /// [`ScanError`] if a file cannot be written, or if `dose` was not counted with [`Simulation::dose_settings`] of the same
    /// simulation; nothing is added then.
    pub fn add(
        &mut self,
        station: &Station,
        radiograph: &Radiograph,
        dose: Option<&Dose>,
    ) -> Result<(), ScanError> {
        if self.projection(station).is_none() {
            if let (Some(sums), Some(dose)) = (&mut self.dose, dose) {
                sums.add(self.simulation, dose)?;
            }
            self.complete.push(CompleteProjection {
                number: station.number,
                sums: radiograph.sums,
                histories: radiograph.histories,
            });
        }
        self.write(&self.simulation.image_files(station, radiograph))
    }

    /// Writes the doses that the input file asks for and removes the tally file.
    ///
    /// # Errors
    /// [`ScanError`] if a file cannot be written or removed.
    pub fn finish(mut self) -> Result<Option<ScanDose>, ScanError> {
        if let Some(dose) = &self.dose {
            self.write(&dose.files(self.simulation))?;
        }
        let path = self.tally_path();
        fs::remove_file(&path).map_err(|source| ScanError::Remove { path, source })?;
        Ok(self.dose)
    }

    /// Writes files, whose hashes are kept before: a file that appears is known as one of this scan.
    fn write(&mut self, files: &[(String, Vec<u8>)]) -> Result<(), ScanError> {
        for (name, bytes) in files {
            self.files.insert(name.clone(), sha256(bytes));
        }
        self.save(self.under_way.as_ref())?;
        for (name, bytes) in files {
            write_whole(&self.folder.join(name), bytes)?;
        }
        Ok(())
    }

    /// Writes the tally file.
    fn save(&self, under_way: Option<&AnalogTally>) -> Result<(), TallyError> {
        let dose = self.dose.as_ref().map(ScanDose::to_bytes);
        let dose = dose.unwrap_or_default();
        let header = Header {
            key: self.key.clone(),
            complete: self.complete.clone(),
            files: self.files.clone(),
            dose_bytes: dose.len() as u64,
            under_way_bytes: under_way.map_or(0, AnalogTally::file_bytes),
        };
        let path = self.tally_path();
        whole_file::write_with(&path, |file| {
            FRAME.write(file, &header, |out| {
                out.write_all(&dose)?;
                under_way.map_or(Ok(()), |tally| tally.write_to(out))
            })
        })
        .map_err(|source| TallyError::Write { path, source })
    }
}

/// SHA-256, in hexadecimal, of all that decides the bytes of a scan's files. Paths and comments of the input file are no part of it.
fn scan_key(simulation: &Simulation, length: RunLength, engine: Engine) -> String {
    let input = simulation.input();
    let stations = input.stations();
    let exposure = stations.first().map(|station| {
        let settings = AnalogSettings {
            seed: simulation.seed(station),
            ..AnalogSettings::default()
        };
        key(
            simulation.phantom(),
            simulation.spectrum(),
            &simulation.projection(station),
            &settings,
            simulation.dose_settings().as_ref(),
        )
    });
    let engine = match engine {
        Engine::Analog => "analog".to_owned(),
        Engine::Fast => format!("{:?}", FastSettings::default()),
    };
    let voxel_dose_file = input.voxel_dose.as_ref().map(|dose| &dose.file);
    let rest = format!(
        "{length:?} {engine} {stations:?} {} {:?} {:?} {} {voxel_dose_file:?} {} {:?}",
        input.seed,
        input.pixels,
        input.detector_cm,
        input.trajectory.projections,
        input.materials.len(),
        simulation.listed(),
    );
    sha256(format!("{exposure:?} {rest}").as_bytes())
}

/// In hexadecimal.
fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}
