//! A simulation: one million poses in ten thousand tasks, of which some are killed and some preempted.

use std::fmt::Write;

use ppa_cluster::{JobKind, QueuedJob, ShardState, index_list, parse_queue, shard_state, split};
use ppa_core::Part;
use ppa_core::random::Philox;

const POSES: usize = 1_000_000;
const TASKS: u64 = 10_000;
/// Slurm's default.
const MAX_ARRAY_SIZE: u64 = 1001;

/// A shard in a folder.
#[derive(Default)]
struct Shard {
    /// Number of poses made, starting with the first.
    made: usize,
    begun: bool,
}

struct Cluster {
    shards: Vec<Shard>,
    /// Number of times each pose was made.
    made: Vec<u8>,
    rng: Philox,
    killed: usize,
    preempted: usize,
}

impl Cluster {
    /// The poses of a shard, counted from 1.
    fn poses(shard: u64) -> std::ops::Range<usize> {
        let part: Part = format!("{shard}/{TASKS}").parse().unwrap();
        let share = part.share(POSES as u64);
        share.start as usize..share.end as usize
    }

    fn state(&self, shard: u64, job: Option<&QueuedJob>) -> ShardState {
        let Shard { made, begun } = self.shards[shard as usize - 1];
        shard_state(made == Self::poses(shard).len(), job, begun)
    }

    fn lost(&self) -> Vec<u64> {
        let is_lost = |&shard: &u64| {
            matches!(
                self.state(shard, None),
                ShardState::Failed | ShardState::Missing
            )
        };
        (1..=TASKS).filter(is_lost).collect()
    }

    /// Runs a task: one in a hundred is killed, one in a hundred preempted and queued again, possibly several times.
    fn run(&mut self, shard: u64) {
        let poses = Self::poses(shard);
        self.shards[shard as usize - 1].begun = true;
        loop {
            let made = self.shards[shard as usize - 1].made;
            let left = poses.len() - made;
            let (fate, share) = (self.rng.unit(), self.rng.unit());
            let stops_after = (share * left as f64) as usize;
            let until = if fate < 0.02 {
                made + stops_after
            } else {
                poses.len()
            };
            for pose in &mut self.made[poses.start + made..poses.start + until] {
                *pose += 1;
            }
            self.shards[shard as usize - 1].made = until;
            if fate < 0.01 {
                self.killed += 1;
            } else if fate < 0.02 {
                self.preempted += 1;
                continue;
            }
            return;
        }
    }
}

/// The tasks of `sbatch --array` with a list of indices, as `squeue` prints them.
fn queued(offset: u64, list: &str) -> Vec<QueuedJob> {
    let mut text = String::new();
    for run in list.split(',') {
        let (first, last) = run.split_once('-').unwrap_or((run, run));
        for index in first.parse::<u64>().unwrap()..=last.parse().unwrap() {
            assert!(index < MAX_ARRAY_SIZE);
            writeln!(text, "7_{index}|PENDING||Resources|shards {offset}").unwrap();
        }
    }
    parse_queue(&text).unwrap()
}

#[test]
fn a_million_poses_are_made_once_in_spite_of_kills() {
    let mut cluster = Cluster {
        shards: (0..TASKS).map(|_| Shard::default()).collect(),
        made: vec![0; POSES],
        rng: Philox::new(1, 0, 0),
        killed: 0,
        preempted: 0,
    };
    let mut submissions = 0;
    loop {
        let lost = cluster.lost();
        if lost.is_empty() {
            break;
        }
        submissions += 1;
        let chunks = split(&lost, MAX_ARRAY_SIZE);
        let jobs = chunks
            .iter()
            .flat_map(|chunk| queued(chunk.offset, &index_list(&chunk.indices)));
        let mut run = Vec::new();
        for job in jobs {
            let JobKind::Shard(shard) = job.kind else {
                panic!("{job:?}")
            };
            assert_eq!(cluster.state(shard, Some(&job)), ShardState::Queued);
            cluster.run(shard);
            run.push(shard);
        }
        // Each of them once.
        assert_eq!(run, lost);
    }
    assert!(cluster.made.iter().all(|&times| times == 1));
    // 100 of each are expected, with a standard deviation of 10.
    assert!((50..=150).contains(&cluster.killed), "{}", cluster.killed);
    assert!(
        (50..=150).contains(&cluster.preempted),
        "{}",
        cluster.preempted
    );
    assert!((2..=5).contains(&submissions), "{submissions}");
}
