//! How long the shards of a plan take on a cluster of a given size.

use std::str::FromStr;

use serde::Serialize;

use crate::bundle::Bundle;
use crate::time_limit::TimeLimit;

/// Time between two tasks in the same slot, seconds: 300 empty tasks took 125 s on four slots of Slurm 22.05.
const BETWEEN_TASKS_S: f64 = 1.7;

/// A share of a cluster for the tasks of a plan, as `nodes=4,cores=32,cpus=4,time=2:00:00`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClusterSize {
    /// Number of nodes.
    pub nodes: u32,
    /// Cores per node.
    pub cores: u32,
    /// Cores per task; 1 by default.
    pub cpus: u32,
    /// Time limit of a task; [`TimeLimit::DEFAULT`] by default.
    pub time: TimeLimit,
}

/// Text that is not the size of a cluster.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "invalid cluster size \"{found}\": {why}; expected nodes=N,cores=N and optionally cpus=N and time=H:MM:SS"
)]
pub struct ClusterSizeError {
    found: String,
    why: String,
}

/// Estimated times of a plan on a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Makespan {
    /// Tasks, one for each shard.
    pub shards: u64,
    /// Wall-clock time of a task, seconds.
    pub task_s: f64,
    /// Tasks that run at the same time.
    pub at_once: u64,
    /// Hours from the first task to the last, without queue wait and merge.
    pub hours: f64,
    /// Part of `hours` added by the slowest of the last tasks.
    pub straggler_hours: f64,
    /// Allocated cores times hours.
    pub core_hours: f64,
}

impl ClusterSize {
    /// Tasks that run at the same time: a task stays on one node.
    pub fn at_once(&self) -> u64 {
        u64::from(self.nodes) * u64::from(self.cores / self.cpus)
    }
}

impl FromStr for ClusterSize {
    type Err = ClusterSizeError;

    fn from_str(text: &str) -> Result<Self, ClusterSizeError> {
        let refused = |why: String| ClusterSizeError {
            found: text.to_owned(),
            why,
        };
        let (mut nodes, mut cores, mut cpus, mut time) = (None, None, None, None);
        for part in text.split(',') {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| refused(format!("\"{part}\" has no =")))?;
            let number = || match value.parse::<u32>() {
                Ok(number) if number > 0 => Ok(number),
                _ => Err(refused(format!("{key} is {value}"))),
            };
            match key {
                "nodes" => nodes = Some(number()?),
                "cores" => cores = Some(number()?),
                "cpus" => cpus = Some(number()?),
                "time" => {
                    time = Some(
                        value
                            .parse()
                            .map_err(|_| refused(format!("time is {value}")))?,
                    )
                }
                _ => return Err(refused(format!("unknown key {key}"))),
            }
        }
        let missing = |key: &str| refused(format!("{key} is missing"));
        let size = Self {
            nodes: nodes.ok_or_else(|| missing("nodes"))?,
            cores: cores.ok_or_else(|| missing("cores"))?,
            cpus: cpus.unwrap_or(1),
            time: time.unwrap_or(TimeLimit::DEFAULT),
        };
        if size.cpus > size.cores {
            return Err(refused(
                "a task needs more cores than a node has".to_owned(),
            ));
        }
        Ok(size)
    }
}

/// Estimates the times of a plan divided as in `bundle`; the times of poses of different limbs have the standard deviation `pose_sd_s`.
///
/// The slots of the cluster run the shards in rounds of equal length. Most poses of a shard belong to one limb, so the standard deviation
/// of a task's time is `pose_sd_s` times its poses per core. The last of n tasks is late by at most √(2 ln n) of that: the bound on the
/// expected maximum of n normal variables.
pub fn makespan(bundle: &Bundle, pose_sd_s: f64, size: &ClusterSize) -> Makespan {
    let at_once = size.at_once().min(bundle.shards);
    let rounds = bundle.shards.div_ceil(at_once);
    let cpus = f64::from(size.cpus);
    let task_sd_s = bundle.poses_per_shard as f64 * pose_sd_s / cpus;
    let straggler_s = task_sd_s * (2.0 * (at_once as f64).ln()).sqrt();
    let occupied_s = bundle.task_s + BETWEEN_TASKS_S;
    Makespan {
        shards: bundle.shards,
        task_s: bundle.task_s,
        at_once,
        hours: (rounds as f64 * occupied_s + straggler_s) / 3600.0,
        straggler_hours: straggler_s / 3600.0,
        core_hours: bundle.shards as f64 * occupied_s * cpus / 3600.0,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bundle(shards: u64, task_s: f64) -> Bundle {
        Bundle {
            shards,
            poses_per_shard: 10,
            task_s,
            warning_s: 60,
        }
    }

    #[test]
    fn a_size_is_read_with_its_defaults() {
        let size: ClusterSize = "nodes=4,cores=32".parse().unwrap();
        assert_eq!((size.at_once(), size.time), (128, TimeLimit::DEFAULT));
        let size: ClusterSize = "cores=32,cpus=12,time=1:30:00,nodes=3".parse().unwrap();
        assert_eq!((size.at_once(), size.time.seconds()), (6, 5400));
        for (text, why) in [
            ("nodes=4", "cores is missing"),
            ("nodes=0,cores=4", "nodes is 0"),
            ("nodes=1,cores=4,cpus=8", "more cores than a node"),
            ("nodes=1,cores=4,gpus=1", "unknown key gpus"),
            ("nodes=1,cores=4,time=soon", "time is soon"),
            ("many", "\"many\" has no ="),
        ] {
            let said = text.parse::<ClusterSize>().unwrap_err().to_string();
            assert!(said.contains(why), "{said}");
        }
    }

    proptest! {
        /// Each slot takes the next task when it is free.
        #[test]
        fn equal_tasks_take_as_long_as_when_places_are_filled_in_turn(
            shards in 1_u64..400, nodes in 1_u32..6, cores in 1_u32..9, task_s in 1.0..4000.0_f64
        ) {
            let size = ClusterSize { nodes, cores, cpus: 1, time: TimeLimit::DEFAULT };
            let found = makespan(&bundle(shards, task_s), 0.0, &size);
            let mut busy_until = vec![0.0; size.at_once() as usize];
            for _ in 0..shards {
                let first = busy_until.iter_mut().min_by(|a: &&mut f64, b| a.total_cmp(b));
                *first.unwrap() += task_s + BETWEEN_TASKS_S;
            }
            let last = busy_until.into_iter().fold(0.0, f64::max);
            prop_assert!((found.hours * 3600.0 - last).abs() < 1e-6 * last);
            prop_assert!(found.core_hours <= found.hours * f64::from(nodes * cores) * (1.0 + 1e-9));
        }
    }

    #[test]
    fn tasks_that_differ_end_later() {
        let size: ClusterSize = "nodes=2,cores=8,cpus=2".parse().unwrap();
        let even = makespan(&bundle(8, 1200.0), 0.0, &size);
        let uneven = makespan(&bundle(8, 1200.0), 20.0, &size);
        // Ten poses on two cores: 100 s, times the root of 2 ln 8.
        let late_s = 100.0 * (2.0 * 8.0_f64.ln()).sqrt();
        assert!(((uneven.hours - even.hours) * 3600.0 - late_s).abs() < 1e-9);
        let alone = makespan(&bundle(1, 1200.0), 20.0, &size);
        assert_eq!(alone.straggler_hours, 0.0);
    }
}
