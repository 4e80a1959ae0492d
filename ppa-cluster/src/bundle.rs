//! Division of a plan into shards, from the time of a pose.

use serde::{Deserialize, Serialize};

use crate::time_limit::TimeLimit;

/// Longest intended time of a task, seconds. Shards of equal size then take 20 to 40 minutes.
const TARGET_S: f64 = 40.0 * 60.0;

/// Factor by which a task may exceed its estimated time before it reaches its time limit.
pub(crate) const RESERVE: f64 = 1.5;

/// Slack of the warning before the time limit, for the start of the program and slow disks, seconds. Slurm may warn up to a
/// minute earlier than asked.
const SIGNAL_S: f64 = 60.0;

/// Upper bound of the time to stop a resumable pose and save its progress, seconds.
const SAVE_S: f64 = 60.0;

/// Processor time of the work, seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseCost {
    /// Mean processor time of a pose, seconds.
    pub pose_cpu_s: f64,
    /// Processor time to read and shape a limb before its first pose, seconds.
    pub limb_cpu_s: f64,
    /// Whether a stopped pose resumes where it stopped, as with the analog engine.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub resumes: bool,
}

/// A division of a plan into shards.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bundle {
    /// Number of shards.
    pub shards: u64,
    /// Poses of the largest shard.
    pub poses_per_shard: u64,
    /// Estimated wall-clock time of the largest shard, seconds.
    pub task_s: f64,
    /// Interval between TERM and the time limit of a task, seconds: enough to finish the poses in progress.
    pub warning_s: u64,
}

/// Why a plan cannot be divided.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BundleError {
    /// The plan has no poses.
    #[error("the plan has no poses")]
    NoPoses,
    /// Invalid processor time.
    #[error("a pose takes {found} s of processor time, expected a positive number")]
    Cost {
        /// Seconds.
        found: f64,
    },
    /// The time limit is too short for a single pose.
    #[error(
        "the time limit {limit} is too short: one pose takes about {pose_s:.0} s with the preparation of its limb, and a \
         task stops {warning_s} s before its limit; give at least --time {least}"
    )]
    TooShort {
        /// The time limit.
        limit: TimeLimit,
        /// Estimated time of one pose, seconds.
        pose_s: f64,
        /// Interval between TERM and the time limit, seconds.
        warning_s: u64,
        /// The shortest limit that fits one pose.
        least: TimeLimit,
    },
}

/// Divides `poses` into shards that take 20 to 40 minutes each on `cpus` processors, or two thirds of the time limit if that is less. A
/// shorter plan is one shard.
///
/// # Errors
/// [`BundleError`], for example if the time limit is too short for one pose.
pub fn bundle(
    poses: u64,
    cost: PoseCost,
    cpus: u32,
    limit: TimeLimit,
) -> Result<Bundle, BundleError> {
    if poses == 0 {
        return Err(BundleError::NoPoses);
    }
    for found in [cost.pose_cpu_s, cost.limb_cpu_s] {
        if !(0.0..=1e9).contains(&found) {
            return Err(BundleError::Cost { found });
        }
    }
    let warning = warning_s(cost);
    let first_s = cost.limb_cpu_s + least_pose_s(cost);
    let usable_s = limit.seconds() as f64 - warning as f64;
    if usable_s < first_s {
        let least = warning as f64 + first_s;
        return Err(BundleError::TooShort {
            limit,
            pose_s: first_s,
            warning_s: warning,
            least: TimeLimit::from_seconds((least / 60.0).ceil() as u64 * 60),
        });
    }
    // Poses run in parallel, one per processor; a limb is prepared before the first of them.
    let pose_s = (cost.pose_cpu_s / f64::from(cpus.max(1))).max(1e-3);
    let target_s = TARGET_S.min(usable_s / RESERVE);
    let most = ((target_s - cost.limb_cpu_s) / pose_s).floor().max(1.0) as u64;
    let shards = poses.div_ceil(most.min(poses));
    let poses_per_shard = poses.div_ceil(shards);
    Ok(Bundle {
        shards,
        poses_per_shard,
        task_s: cost.limb_cpu_s + pose_s * poses_per_shard as f64,
        warning_s: warning,
    })
}

/// A pose in progress keeps at least one processor, and the preparation of a limb is not interrupted.
fn warning_s(cost: PoseCost) -> u64 {
    (SIGNAL_S + 2.0 * (least_pose_s(cost) + cost.limb_cpu_s)).ceil() as u64
}

/// Uninterruptible processor time of a pose, seconds.
fn least_pose_s(cost: PoseCost) -> f64 {
    match cost.resumes {
        true => cost.pose_cpu_s.min(SAVE_S),
        false => cost.pose_cpu_s,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TWO_HOURS: TimeLimit = TimeLimit::from_seconds(7200);

    fn cost(pose_cpu_s: f64) -> PoseCost {
        PoseCost {
            pose_cpu_s,
            limb_cpu_s: 0.0,
            resumes: false,
        }
    }

    proptest! {
        #[test]
        fn large_plans_give_tasks_of_20_to_60_minutes(
            poses in 1_000_u64..100_000, pose_s in 10.0..300.0_f64, cpus in 1_u32..4
        ) {
            let found = bundle(poses, cost(pose_s), cpus, TWO_HOURS).unwrap();
            let smallest = (poses / found.shards) as f64 * pose_s / f64::from(cpus);
            prop_assert!(smallest > 19.0 * 60.0 && found.task_s < 3600.0, "{found:?}");
            prop_assert!(found.shards <= poses);
        }
    }

    #[test]
    fn a_short_plan_is_one_task() {
        let found = bundle(5, cost(2.0), 1, TWO_HOURS).unwrap();
        assert_eq!((found.shards, found.poses_per_shard), (1, 5));
        assert_eq!(found.task_s, 10.0);
    }

    #[test]
    fn long_poses_are_tasks_of_their_own() {
        let limit = TimeLimit::from_seconds(24 * 3600);
        let found = bundle(5, cost(3600.0), 1, limit).unwrap();
        assert_eq!((found.shards, found.poses_per_shard), (5, 1));
        assert_eq!(found.warning_s, 60 + 7200);
    }

    #[test]
    fn a_short_limit_makes_shorter_tasks() {
        let limit = TimeLimit::from_seconds(15 * 60);
        let found = bundle(1000, cost(10.0), 1, limit).unwrap();
        assert!(found.task_s <= (900.0 - 80.0) / 1.5, "{found:?}");
    }

    #[test]
    fn a_limit_below_one_pose_is_refused() {
        let limit = TimeLimit::from_seconds(120);
        let said = bundle(5, cost(100.0), 4, limit).unwrap_err().to_string();
        assert!(said.contains("00:02:00 is too short"), "{said}");
        let least = said.split("--time ").nth(1).unwrap().parse().unwrap();
        assert!(bundle(5, cost(100.0), 4, least).is_ok(), "{said}");
    }

    /// 2e10 histories take hours, longer than many partitions allow.
    #[test]
    fn poses_that_resume_may_exceed_the_limit() {
        let resuming = PoseCost {
            resumes: true,
            ..cost(20_000.0)
        };
        let found = bundle(5, resuming, 1, TWO_HOURS).unwrap();
        assert_eq!((found.shards, found.warning_s), (5, 180));
        assert!(bundle(5, cost(20_000.0), 1, TWO_HOURS).is_err());
        assert!(bundle(5, resuming, 1, TimeLimit::from_seconds(180)).is_err());
    }

    #[test]
    fn costs_that_are_no_numbers_are_refused() {
        for bad in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(bundle(5, cost(bad), 1, TWO_HOURS).is_err());
        }
        assert_eq!(
            bundle(0, cost(1.0), 1, TWO_HOURS),
            Err(BundleError::NoPoses)
        );
    }
}
