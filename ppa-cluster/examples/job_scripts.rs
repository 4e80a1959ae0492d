//! Writes the job scripts of a plan of 362 poses and prints the command that would submit them.

use std::path::Path;

use ppa_cluster::{
    ClusterFolder, CostSource, DEFAULT_MAX_ARRAY_SIZE, PoseCost, PoseWork, Program, Scripts,
    Submission, TaskSettings, Work, bundle, split, task_commands,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = std::env::temp_dir().join(format!("job_scripts_{}", std::process::id()));
    let folder = ClusterFolder::create(&root)?;
    let settings = TaskSettings {
        partition: None,
        account: None,
        time: "2:00:00".parse()?,
        cpus: 2,
        mem: None,
        gres: None,
        max_tasks: None,
        setup: None,
    };
    let cost = PoseCost {
        pose_cpu_s: 60.0,
        limb_cpu_s: 10.0,
        resumes: false,
    };
    let bundle = bundle(362, cost, settings.cpus, settings.time)?;
    let work = Work::Poses(PoseWork {
        poses: 362,
        cost,
        cost_source: CostSource::Given,
        bundle,
        archive: false,
    });
    let (plan, hash) = ("plan.toml".into(), "0".repeat(64));
    let submission = Submission::new(plan, hash, work, settings);
    let program = Program {
        path: Path::new("/usr/bin/ppa"),
        sha256: &"cd".repeat(32),
    };
    let scripts = Scripts::new(&folder, &submission, &program)?;
    println!("{}", scripts.task);
    let shards: Vec<_> = (1..=bundle.shards).collect();
    let chunks = split(&shards, DEFAULT_MAX_ARRAY_SIZE);
    for command in task_commands(&folder, &submission, &chunks)? {
        println!("{command}");
    }
    std::fs::remove_dir_all(&root)?;
    Ok(())
}
