//! A scan that can be interrupted: its complete projections, the sums of the running one, and the file that stores both.

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
    /// Histories that were followed (analog) or that the noise of the image represents (fast).
    pub histories: f64,
}

/// The projections of an input file, written to a folder one by one.
///
/// The file [`Scan::tally_path`] stores what is needed to resume an interrupted scan: the SHA-256 of the files of complete projections,
/// the sums of their doses, and the [`AnalogTally`] of the running projection. With a number of histories, a scan that was
/// interrupted and resumed writes the same bytes as one that was not. With a time limit, the time of the running projection
/// starts again.
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
    /// A new scan; files go to `folder`.
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

    /// Resumes the scan that was interrupted in `folder`.
    ///
    /// # Errors
    /// [`ScanError`] if the tally file cannot be read, is damaged, or belongs to another scan.
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

    /// The file that stores an interrupted scan: `.tally` appended to the image name in the input file.
    pub fn tally_path(&self) -> PathBuf {
        let name = &self.simulation.input().image_file;
        self.folder.join(format!("{name}.tally"))
    }

    /// Names of the files in the folder whose content was written by this scan.
    pub fn written(&self) -> BTreeSet<String> {
        let files = self.files.iter();
        files
            .filter(|(name, hash)| {
                fs::read(self.folder.join(name)).is_ok_and(|bytes| sha256(&bytes) == **hash)
            })
            .map(|(name, _)| name.clone())
            .collect()
    }

    /// All complete projections, in the order of completion.
    pub fn complete(&self) -> &[CompleteProjection] {
        &self.complete
    }

    /// Results of a projection, if it is complete.
    pub fn projection(&self, station: &Station) -> Option<&CompleteProjection> {
        let mut complete = self.complete.iter();
        complete.find(|projection| projection.number == station.number)
    }

    /// Length of the run of a projection; for a complete one, the length that it had.
    pub fn length(&self, station: &Station) -> RunLength {
        match self.projection(station) {
            Some(projection) => RunLength::Histories(projection.histories as u64),
            None => self.length,
        }
    }

    /// Follows the photons of a projection and counts the requested doses. Continues the histories of an interrupted projection;
    /// the tally file is written every `save_every` and when `observe` ends the run by [`ControlFlow::Break`].
    ///
    /// A complete projection is simulated again without changing the tally file. Returns `None` if `observe` ended the run.
    ///
    /// # Errors
    /// [`ScanError`] if the exposure is invalid, or if the tally file cannot be written.
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
    /// simulation; then nothing is added.
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

    /// Writes the doses that the input file requests and removes the tally file.
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

    /// Writes files after saving their hashes, so every existing file is known to belong to this scan.
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

/// SHA-256, in hexadecimal, of everything that determines the bytes of a scan's files. Paths and comments of the input file are not
/// included.
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

/// SHA-256 in hexadecimal.
fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}
