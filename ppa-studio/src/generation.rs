//! Generation of a dataset while the page remains usable.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use ppa_dataset::layout::LimbId;
use ppa_generate::{Case, GenerateError, GenerateSettings, Plan, Progress, generate, status};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;

use crate::error::StudioError;

/// The last run that this program has started, if any.
#[derive(Default)]
pub(crate) struct Generation(Mutex<Option<Run>>);

struct Run {
    shared: Arc<Shared>,
    thread: JoinHandle<()>,
}

struct Shared {
    root: PathBuf,
    limbs: Vec<LimbId>,
    begun: Instant,
    stop: AtomicBool,
    total: AtomicUsize,
    found: AtomicUsize,
    made: AtomicUsize,
    outcome: Mutex<Option<Result<(), GenerateError>>>,
}

/// Phase of the generation of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Phase {
    /// The folder holds no dataset.
    Absent,
    Running,
    /// The current poses are being finished; no other begins.
    Stopping,
    /// Another program makes the dataset.
    Elsewhere,
    /// Poses are missing; resuming makes them.
    Paused,
    Complete,
    Failed,
}

/// State of the dataset in a folder.
#[derive(Debug, Serialize)]
pub(crate) struct GenerationState {
    pub phase: Phase,
    pub pose_jobs: usize,
    pub made: usize,
    /// Poses that this run has made. With `elapsed_s`, it allows an estimate of the remaining time.
    pub made_now: usize,
    pub elapsed_s: f64,
    pub limbs: Vec<LimbId>,
    /// Why the run ended early.
    pub error: Option<String>,
}

impl Generation {
    /// Starts to make the missing part of a plan's dataset.
    ///
    /// # Errors
    /// [`StudioError::Generating`] while another run continues, or the error that prevents the start.
    pub fn start(&self, plan: Arc<Plan>, root: PathBuf) -> Result<(), StudioError> {
        let mut kept = self.run();
        if let Some(run) = &*kept
            && !run.thread.is_finished()
        {
            return Err(StudioError::Generating(run.shared.root.clone()));
        }
        let limbs = plan.cases.iter().map(|planned| {
            let side = Case::read(&planned.file)?.side;
            let patient = planned.patient;
            Ok(LimbId { patient, side })
        });
        let shared = Arc::new(Shared {
            root,
            limbs: limbs.collect::<Result<_, StudioError>>()?,
            begun: Instant::now(),
            stop: AtomicBool::new(false),
            total: AtomicUsize::new(0),
            found: AtomicUsize::new(0),
            made: AtomicUsize::new(0),
            outcome: Mutex::new(None),
        });
        let pool = own_threads()?;
        let worker = shared.clone();
        let thread = std::thread::spawn(move || pool.install(|| worker.make(&plan)));
        *kept = Some(Run { shared, thread });
        Ok(())
    }

    /// Ends the run after the current poses.
    pub fn pause(&self) {
        if let Some(run) = &*self.run() {
            run.shared.stop.store(true, Ordering::Relaxed);
        }
    }

    /// Ends the run and waits for the current poses.
    pub fn finish(&self) {
        self.pause();
        let run = self.run().take();
        if let Some(run) = run {
            // A run that panicked has no outcome and leaves the files of a killed one.
            let _ = run.thread.join();
        }
    }

    /// Returns the state of the dataset in a folder, from the active run or otherwise from the files.
    pub fn state(&self, root: &Path) -> Result<GenerationState, StudioError> {
        let mut error = None;
        let mut failed = false;
        if let Some(run) = self.run().as_ref().filter(|run| run.shared.root == root) {
            if !run.thread.is_finished() {
                return Ok(run.shared.state());
            }
            (failed, error) = match &*run.shared.outcome() {
                Some(Ok(()) | Err(GenerateError::Stopped(_))) => (false, None),
                Some(Err(error)) => (true, Some(ppa_core::text::error_chain(error))),
                None => (true, Some("internal error: the run ended early".to_owned())),
            };
        }
        let is_begun = std::fs::read_dir(root).is_ok_and(|mut files| files.next().is_some());
        let found = is_begun.then(|| status(root)).transpose()?;
        let Some(found) = found else {
            return Ok(GenerationState {
                phase: if failed { Phase::Failed } else { Phase::Absent },
                pose_jobs: 0,
                made: 0,
                made_now: 0,
                elapsed_s: 0.0,
                limbs: Vec::new(),
                error,
            });
        };
        let phase = match () {
            () if found.running => Phase::Elsewhere,
            () if failed => Phase::Failed,
            () if found.complete => Phase::Complete,
            () => Phase::Paused,
        };
        Ok(GenerationState {
            phase,
            pose_jobs: found.pose_jobs,
            made: found.made,
            made_now: 0,
            elapsed_s: 0.0,
            limbs: found.limbs.iter().map(|limb| limb.limb).collect(),
            error,
        })
    }

    fn run(&self) -> MutexGuard<'_, Option<Run>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Generation {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Shared {
    fn make(&self, plan: &Plan) {
        let settings = GenerateSettings {
            stop: Some(&self.stop),
            ..GenerateSettings::default()
        };
        let observe = |progress: Progress| match progress {
            Progress::Findings(_) => {}
            Progress::Total(poses) => self.total.store(poses, Ordering::Relaxed),
            Progress::Found => {
                self.found.fetch_add(1, Ordering::Relaxed);
            }
            Progress::Made => {
                self.made.fetch_add(1, Ordering::Relaxed);
            }
        };
        let made = generate(plan, &self.root, &settings, &observe);
        *self.outcome() = Some(made.map(|_| ()));
    }

    fn state(&self) -> GenerationState {
        let [total, found, made] =
            [&self.total, &self.found, &self.made].map(|count| count.load(Ordering::Relaxed));
        GenerationState {
            phase: if self.stop.load(Ordering::Relaxed) {
                Phase::Stopping
            } else {
                Phase::Running
            },
            pose_jobs: total,
            made: found + made,
            made_now: made,
            elapsed_s: self.begun.elapsed().as_secs_f64(),
            limbs: self.limbs.clone(),
            error: None,
        }
    }

    fn outcome(&self) -> MutexGuard<'_, Option<Result<(), GenerateError>>> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Makes a thread pool for long work, so that images for the page do not wait for it.
pub(crate) fn own_threads() -> Result<ThreadPool, StudioError> {
    let threads = ThreadPoolBuilder::new().build();
    threads.map_err(StudioError::Threads)
}
