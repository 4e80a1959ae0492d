//! The poses of a dataset by limb, and those of one shard.

use ppa_core::Part;
use ppa_dataset::findings::FindingCode;
use ppa_dataset::layout::LimbId;
use ppa_scene::PoseAngle;
use serde::Deserialize;

use crate::record::PoseJob;

/// A limb of a dataset, as `dataset.json` lists it.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct PlannedLimb {
    #[serde(flatten)]
    pub limb: LimbId,
    pub key: String,
    #[serde(default)]
    pub acknowledged: Vec<FindingCode>,
}

/// All poses of one limb that belong to a job.
pub(crate) struct LimbJobs {
    pub limb: LimbId,
    pub key: String,
    /// Codes of the findings that its case acknowledges.
    pub acknowledged: Vec<FindingCode>,
    pub poses: Vec<PoseAngle>,
}

impl LimbJobs {
    pub fn pose_job(&self, pose: PoseAngle) -> PoseJob<'_> {
        PoseJob {
            limb: self.limb,
            pose,
            limb_key: &self.key,
        }
    }

    pub fn pose_jobs(&self) -> impl Iterator<Item = PoseJob<'_>> {
        self.poses.iter().map(|&pose| self.pose_job(pose))
    }
}

/// Returns the pose jobs of one shard of a dataset. Shards are ranges of consecutive poses, limb by limb, so that few of them prepare the
/// same limb.
pub(crate) fn jobs_of_part(
    limbs: impl ExactSizeIterator<Item = PlannedLimb>,
    poses: &[PoseAngle],
    part: Part,
) -> Vec<LimbJobs> {
    let share = part.share((limbs.len() * poses.len()) as u64);
    let within = |index: usize| share.contains(&(index as u64));
    let of_limb = |(i, limb): (usize, PlannedLimb)| {
        let planned = poses.iter().enumerate();
        let mine = planned.filter(|(j, _)| within(i * poses.len() + j));
        LimbJobs {
            limb: limb.limb,
            key: limb.key,
            acknowledged: limb.acknowledged,
            poses: mine.map(|(_, pose)| *pose).collect(),
        }
    };
    let limbs = limbs.enumerate().map(of_limb);
    limbs.filter(|limb| !limb.poses.is_empty()).collect()
}
