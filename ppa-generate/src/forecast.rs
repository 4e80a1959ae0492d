//! Estimated cost of a plan, from a sample of its poses.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use cpu_time::ProcessTime;
use ppa_core::Part;
use ppa_dataset::files::{FileError, remove_if_there};
use ppa_dataset::findings::Findings;
use ppa_dataset::layout::View;
use ppa_dataset::stop::{Stopped, go_on};
use ppa_scene::PoseAngle;
use serde::Serialize;

use crate::generate::{GenerateError, Work};
use crate::job::Progress;
use crate::limb_jobs::jobs_of_part;
use crate::plan::Plan;
use crate::status::status;

/// Why a plan cannot be carried out, or its cost cannot be estimated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ForecastError {
    /// A pose of the sample cannot be made.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// The temporary folder of the sample cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The forecast was asked to stop.
    #[error("not all poses of the sample were measured")]
    Stopped(#[from] Stopped),
    /// The fraction is not between 0 and 1.
    #[error("the fraction is {0}, expected a number from 0 to 1")]
    Fraction(f64),
    /// The images do not fit on the disk.
    #[error(
        "the plan's images need {needed} more bytes in {}, but only {free} are free",
        root.display()
    )]
    NoRoom {
        /// The dataset's folder.
        root: PathBuf,
        /// Bytes of the images that do not exist yet.
        needed: u64,
        /// Free bytes of its file system.
        free: u64,
    },
}

/// Estimated cost of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Forecast {
    /// Number of limbs.
    pub limbs: usize,
    /// Poses of all limbs.
    #[serde(rename = "units")]
    pub pose_jobs: usize,
    /// Depth images of all cameras and body shapes.
    pub depth_images: usize,
    /// Radiographs.
    pub radiographs: usize,
    /// Poses that were made as a sample.
    pub measured: usize,
    /// Mean processor time of the measured poses in seconds.
    pub cpu_s_per_unit: f64,
    /// Standard error of that mean; absent for a single pose.
    pub cpu_s_per_unit_error: Option<f64>,
    /// Mean processor time to read and shape a limb in seconds.
    pub cpu_s_per_limb: f64,
    /// Processor time of the plan in hours.
    pub cpu_hours: f64,
    /// Bytes of all images.
    pub bytes: u64,
    /// Bytes of the images that do not exist yet.
    pub needed_bytes: u64,
    /// Free bytes in the file system of the dataset, if the system reports them.
    pub free_bytes: Option<u64>,
    /// Findings about the limbs.
    #[serde(skip_serializing_if = "Findings::is_empty")]
    pub findings: Findings,
}

/// Prepares every limb of the plan, makes `fraction` of its poses, at least one, in a temporary folder, one after the other, and estimates
/// the cost of all poses in the folder `root`.
///
/// For a plan with many analog histories, two short exposures of each pose are measured instead, and the time of all histories follows from
/// their difference.
///
/// The poses are spread evenly, and differently for every limb. A pose that fails here would also fail in the run. Once `stop` is true no
/// other pose begins. [`Forecast::fits`] checks whether the disk has room for all.
///
/// # Errors
/// [`ForecastError`], naming the case or pose that rules the plan out.
pub fn forecast(
    plan: &Plan,
    root: &Path,
    fraction: f64,
    stop: &AtomicBool,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Forecast, ForecastError> {
    if !(0.0..=1.0).contains(&fraction) {
        return Err(ForecastError::Fraction(fraction));
    }
    let plans = measured_plans(plan);
    let works = plans.iter().map(Work::of_plan);
    let works: Vec<_> = works.collect::<Result<_, _>>()?;
    let work = &works[0];
    let poses = plan.rotation.poses().map_err(GenerateError::from)?;
    let limbs = jobs_of_part(work.planned(), &poses, Part::WHOLE);
    // No limb stays prepared, since the time of preparing each is measured.
    let findings = work.findings(&limbs, root, 0)?;
    progress(Progress::Findings(&findings));
    let of_limb = ((poses.len() as f64 * fraction).round() as usize).max(1);
    progress(Progress::Total(limbs.len() * of_limb));

    let scratch = tempfile::tempdir().map_err(FileError::at("create", &std::env::temp_dir()))?;
    let (mut preparing_s, mut unit_s, mut bytes) = (0.0, Vec::new(), 0);
    for (i, limb) in limbs.iter().enumerate() {
        let begun = ProcessTime::now();
        let make = work.prepare(limb.limb, scratch.path(), None)?;
        preparing_s += begun.elapsed().as_secs_f64();
        let others = works[1..].iter();
        let others = others.map(|other| other.prepare(limb.limb, scratch.path(), None));
        let others: Vec<_> = others.collect::<Result<_, _>>()?;
        let shift = (i as f64 + 0.5) / limbs.len() as f64;
        for pose in spread(&poses, of_limb, shift) {
            go_on(stop)?;
            let (mut seconds, mut files) = (Vec::new(), Vec::new());
            for make in [&make].into_iter().chain(&others) {
                let begun = ProcessTime::now();
                let images = make(limb.pose_job(pose))?;
                seconds.push(begun.elapsed().as_secs_f64());
                files = images.files;
            }
            unit_s.push(pose_s(plan, &seconds));
            for row in &files {
                let path = scratch.path().join(&row.file);
                let size = std::fs::metadata(&path).map_err(FileError::at("read", &path))?;
                bytes += size.len();
                remove_if_there(&path)?;
            }
            progress(Progress::Made);
        }
    }

    let pose_jobs = limbs.len() * poses.len();
    let measured = unit_s.len();
    let (mean, error) = mean_and_error(&unit_s);
    let bytes = (bytes as f64 / measured as f64 * pose_jobs as f64) as u64;
    Ok(Forecast {
        limbs: limbs.len(),
        pose_jobs,
        depth_images: pose_jobs * plan.shapes.variants.len() * View::ALL.len(),
        radiographs: pose_jobs,
        measured,
        cpu_s_per_unit: mean,
        cpu_s_per_unit_error: error,
        cpu_s_per_limb: preparing_s / limbs.len() as f64,
        cpu_hours: (preparing_s + mean * pose_jobs as f64) / 3600.0,
        bytes,
        needed_bytes: bytes.saturating_sub(status(root).map_or(0, |status| status.bytes)),
        free_bytes: free_bytes(root),
        findings,
    })
}

impl Forecast {
    /// Whether the images will fit in the folder that the forecast was made for.
    ///
    /// # Errors
    /// [`ForecastError::NoRoom`].
    pub fn fits(&self, root: &Path) -> Result<(), ForecastError> {
        match self.free_bytes {
            Some(free) if free < self.needed_bytes => Err(ForecastError::NoRoom {
                root: root.to_owned(),
                needed: self.needed_bytes,
                free,
            }),
            _ => Ok(()),
        }
    }
}

/// Analog histories followed in the shorter of two measurements.
const MEASURED_HISTORIES: u64 = 2_000_000;

/// The plans to measure: the plan itself, or for many analog histories one plan with few and one with twice as many, whose
/// difference gives the time of the histories alone.
fn measured_plans(plan: &Plan) -> Vec<Plan> {
    let Some(analog) = plan.xray.analog else {
        return vec![plan.clone()];
    };
    if analog.histories <= 2 * MEASURED_HISTORIES {
        return vec![plan.clone()];
    }
    let with = |histories| {
        let mut plan = plan.clone();
        plan.xray.analog = Some(analog.with_histories(histories));
        plan
    };
    vec![with(MEASURED_HISTORIES), with(2 * MEASURED_HISTORIES)]
}

/// Processor time of a pose, from that of the same pose in each of [`measured_plans`], seconds.
fn pose_s(plan: &Plan, seconds: &[f64]) -> f64 {
    match (plan.xray.analog, seconds) {
        (Some(analog), &[few, twice]) => {
            let more = analog.histories as f64 / MEASURED_HISTORIES as f64 - 1.0;
            few + (twice - few).max(0.0) * more
        }
        _ => seconds.iter().sum(),
    }
}

/// `count` poses in the middle of equal parts of the sweep, moved by `shift` (0 to 1) of a part.
fn spread(poses: &[PoseAngle], count: usize, shift: f64) -> impl Iterator<Item = PoseAngle> {
    let part = poses.len() as f64 / count as f64;
    (0..count).map(move |j| {
        let at = (j as f64 + shift) * part;
        poses[(at as usize).min(poses.len() - 1)]
    })
}

fn mean_and_error(values: &[f64]) -> (f64, Option<f64>) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let error = (values.len() > 1).then(|| (squares / (n - 1.0) / n).sqrt());
    (mean, error)
}

/// Free bytes of the file system that holds `root`, or its nearest existing parent.
#[cfg(unix)]
pub fn free_bytes(root: &Path) -> Option<u64> {
    let root = std::path::absolute(root).ok()?;
    let disk = root
        .ancestors()
        .find_map(|path| rustix::fs::statvfs(path).ok())?;
    Some(disk.f_bavail * disk.f_frsize)
}

/// Not implemented for other systems.
#[cfg(not(unix))]
pub fn free_bytes(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use ppa_scene::Sweep;

    use super::*;

    #[test]
    fn a_sample_is_spread_over_the_sweep() {
        let poses = Sweep::default().poses().unwrap();
        let steps = |count, shift| {
            let sample = spread(&poses, count, shift);
            sample.map(|pose| pose.step).collect::<Vec<_>>()
        };
        assert_eq!(steps(1, 0.5), [90]);
        assert_eq!(steps(2, 0.5), [45, 135]);
        assert_eq!(steps(181, 0.5), (0..181).collect::<Vec<_>>());
        assert_eq!(steps(181, 0.999), (0..181).collect::<Vec<_>>());
    }

    #[test]
    fn images_that_are_there_need_no_more_room() {
        let forecast = |needed_bytes, free_bytes| Forecast {
            limbs: 1,
            pose_jobs: 181,
            depth_images: 1810,
            radiographs: 181,
            measured: 2,
            cpu_s_per_unit: 10.0,
            cpu_s_per_unit_error: None,
            cpu_s_per_limb: 1.0,
            cpu_hours: 0.5,
            bytes: 1000,
            needed_bytes,
            free_bytes,
            findings: Findings::default(),
        };
        let fits = |needed, free| forecast(needed, free).fits(Path::new("dataset"));
        assert!(fits(600, Some(600)).is_ok() && fits(600, None).is_ok());
        let said = fits(600, Some(599)).unwrap_err().to_string();
        assert!(
            said.contains("600 more bytes in dataset, but only 599"),
            "{said}"
        );
    }

    #[test]
    fn many_histories_are_extrapolated_from_few() {
        let text = "version = 1\n[[case]]\nfile = \"leg.toml\"\npatient = 0\n";
        let mut plan = Plan::of_text(text, Path::new("plan.toml")).unwrap();
        assert_eq!(measured_plans(&plan).len(), 1);
        let analog = ppa_xray::AnalogSettings::default();
        plan.xray.analog = Some(analog.with_histories(2 * MEASURED_HISTORIES));
        assert_eq!(measured_plans(&plan).len(), 1);
        assert_eq!(pose_s(&plan, &[7.0]), 7.0);
        plan.xray.analog = Some(analog.with_histories(100 * MEASURED_HISTORIES));
        let measured = measured_plans(&plan);
        let histories = measured
            .iter()
            .map(|plan| plan.xray.analog.unwrap().histories);
        let expected = [MEASURED_HISTORIES, 2 * MEASURED_HISTORIES];
        assert!(histories.eq(expected));
        // 3 s for everything else, 2 s for each `MEASURED_HISTORIES` histories.
        assert_eq!(pose_s(&plan, &[5.0, 7.0]), 203.0);
    }

    #[test]
    fn errors_are_those_of_the_mean() {
        let (mean, error) = mean_and_error(&[1.0, 2.0, 3.0, 6.0]);
        assert_eq!(mean, 3.0);
        assert!((error.unwrap() - (14.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-12);
        assert_eq!(mean_and_error(&[2.0]), (2.0, None));
    }
}
