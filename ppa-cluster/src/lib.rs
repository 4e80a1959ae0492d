#![doc = include_str!("../README.md")]

mod array;
mod bundle;
mod error;
mod folder;
mod histories;
mod limits;
mod logs;
mod makespan;
mod queue;
mod quote;
mod results;
mod sbatch;
mod script_body;
mod scripts;
mod shard_state;
mod slurm;
mod submission;
mod time_limit;
mod usage;

pub use array::{ArrayChunk, index_list, split};
pub use bundle::{Bundle, BundleError, PoseCost, bundle};
pub use error::{FolderError, SlurmError};
pub use folder::{ClusterFolder, FolderLock};
pub use histories::{
    DividedCommand, HistoriesError, HistoryCommand, HistoryCost, HistoryWork, divide_histories,
};
pub use limits::{DEFAULT_MAX_ARRAY_SIZE, max_array_size};
pub use logs::{last_line, logged_tasks};
pub use makespan::{ClusterSize, ClusterSizeError, Makespan, makespan};
pub use queue::{JobKind, QueuedJob, parse_queue};
pub use quote::shell_quoted;
pub use sbatch::{SbatchCommand, last_command, task_commands};
pub use scripts::{Program, ScriptError, Scripts};
pub use shard_state::{ShardState, shard_state};
pub use slurm::Slurm;
pub use submission::{
    CostSource, ExperimentTrainings, PoseWork, Submission, TaskSettings, TrainingWork, Work,
};
pub use time_limit::{TimeLimit, TimeLimitError};
pub use usage::{CoreHours, Estimate};
