//! The rotation from a pose to the best pose of the limb.

use std::collections::BTreeMap;

use ppa_dataset::layout::LimbId;

use super::sample::Sample;

/// The label of an inadequate pose.
const INADEQUATE: f64 = 3.0;

/// Sets each sample's [`correction_deg`](Sample::correction_deg): the best angle of its limb minus its own angle.
///
/// The best angle is the mean of the angles of the limb's samples, weighted by 3 (inadequate) minus the label: the centre of the
/// range of good poses if the angles are evenly spaced and cover it.
pub(super) fn set_corrections(samples: &mut [Sample]) {
    let mut sums: BTreeMap<LimbId, [f64; 2]> = BTreeMap::new();
    for sample in samples.iter() {
        if let Some(angle) = sample.angle_deg {
            let weight = (INADEQUATE - sample.label).max(0.0);
            let [weights, angles] = sums.entry(sample.limb).or_default();
            *weights += weight;
            *angles += weight * angle;
        }
    }
    for sample in samples {
        let sums = sums.get(&sample.limb);
        let best = sums.filter(|[weights, _]| *weights > 0.0);
        let best = best.map(|[weights, angles]| angles / weights);
        sample.correction_deg = best.zip(sample.angle_deg).map(|(best, own)| best - own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::sample_without_images;

    #[test]
    fn corrections_lead_to_the_centre_of_good_poses() {
        let pose = |patient, angle_deg, label| Sample {
            angle_deg,
            ..sample_without_images(label, patient)
        };
        let mut samples = [
            pose(1, Some(0.0), 3.0),
            pose(1, Some(10.0), 2.0),
            pose(1, Some(20.0), 1.0),
            pose(1, Some(30.0), 2.0),
            pose(1, Some(40.0), 3.0),
            pose(2, Some(0.0), 2.5),
            pose(2, Some(30.0), 1.0),
            // All inadequate, and without an angle.
            pose(3, Some(10.0), 3.0),
            pose(4, None, 1.0),
        ];
        set_corrections(&mut samples);
        let found = samples.map(|sample| sample.correction_deg);
        let expected = [20.0, 10.0, 0.0, -10.0, -20.0, 24.0, -6.0].map(Some);
        assert_eq!(found[..7], expected);
        assert_eq!(found[7..], [None, None]);
    }
}
