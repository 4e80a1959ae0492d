//! The specimen layout: file names and reading.

use std::collections::{BTreeMap, BTreeSet};

use super::folders::{Folder, digits};
use super::unpaired::Seen;
use super::{DepthFile, Flexion, Found, ImagePair, Pose, PublishedError, Unpaired, entries};
use crate::labels::{LabelFile, LabelName};
use crate::layout::{LimbId, View};

/// The folder of one flexion of a limb.
pub(super) fn flexion_folder(limb: LimbId, flexion: Flexion) -> String {
    let (patient, side) = (limb.patient, limb.side_letter());
    format!("patient_{patient}_{side}/{}/data/dataset", flexion.name())
}

/// Reads all image pairs and unpaired files of one limb.
pub(super) fn read(
    limb_folder: &Folder,
    limb: LimbId,
    labels: Option<&LabelName>,
) -> Result<Found, PublishedError> {
    let mut found = Found::default();
    for name in limb_folder.folders()? {
        let folder = limb_folder.below(&name);
        let flexion = Flexion::ALL
            .into_iter()
            .find(|flexion| flexion.name() == name);
        let flexion = flexion.ok_or_else(|| PublishedError::Name {
            path: folder.path.clone(),
            expected: "min, medium or max",
        })?;
        let dataset = folder.below("data").below("dataset");
        let (pairs, unpaired) = read_flexion(&dataset, limb, flexion, labels)?;
        found.0.extend(pairs);
        found.1.extend(unpaired);
    }
    Ok(found)
}

fn read_flexion(
    dataset: &Folder,
    limb: LimbId,
    flexion: Flexion,
    name: Option<&LabelName>,
) -> Result<Found, PublishedError> {
    let lists = dataset.below("label");
    let file = format!("quality/{}", LabelFile::file_name(name));
    let labels = entries::labels(&lists.path.join(&file), number_of_radiograph)?;
    let rois = lists.path.join("roi").join("roi_depth.json");
    let of_key = |key: &str| depth_name(key).map(|(view, number, _)| (view, number));
    let rois = entries::rois(&rois, of_key)?;
    let xray = dataset.below("xray");
    let radiographs = radiographs(&xray)?;
    let depth = dataset.below("depth");
    let mut pairs: BTreeMap<Pose, ImagePair> = BTreeMap::new();
    for image in depth.images()? {
        let named = depth_name(&image).ok_or_else(|| PublishedError::Name {
            path: depth.path.join(&image),
            expected: "depth_cam_{left,right}_orig_{image}_{timestamp}.png",
        });
        let (view, image_number, timestamp) = named?;
        let pose = Pose::Recorded {
            flexion,
            image_number,
            timestamp,
        };
        let radiograph = radiographs.contains(&image_number);
        let pair = pairs.entry(pose).or_insert_with(|| ImagePair {
            limb,
            pose,
            left: None,
            right: None,
            radiograph: radiograph
                .then(|| format!("{}/{}", xray.name, radiograph_name(image_number))),
            label: labels.get(&image_number).cloned(),
        });
        *pair.depth_mut(view) = Some(DepthFile {
            file: format!("{}/{image}", depth.name),
            roi: rois.get(&(view, image_number)).cloned(),
        });
    }
    let pairs: Vec<_> = pairs.into_values().collect();
    let seen = Seen::of(&pairs);
    let mut unpaired = Vec::new();
    for &number in radiographs.difference(&seen.poses) {
        let file = format!("{}/{}", xray.name, radiograph_name(number));
        let patient = limb.patient;
        unpaired.push(Unpaired::Radiograph { patient, file });
    }
    for &pose in labels.keys().filter(|pose| !seen.poses.contains(pose)) {
        let list = format!("{}/{file}", lists.name);
        unpaired.push(Unpaired::Label { list, pose });
    }
    let list = format!("{}/roi/roi_depth.json", lists.name);
    unpaired.extend(seen.regions_of_none(&list, rois.keys()));
    Ok((pairs, unpaired))
}

fn radiographs(folder: &Folder) -> Result<BTreeSet<u32>, PublishedError> {
    let number = |name: String| {
        number_of_radiograph(&name).ok_or_else(|| PublishedError::Name {
            path: folder.path.join(&name),
            expected: "xray_{image}.png",
        })
    };
    folder.images()?.into_iter().map(number).collect()
}

/// File name of a radiograph.
pub(super) fn radiograph_name(image_number: u32) -> String {
    format!("xray_{image_number}.png")
}

fn number_of_radiograph(name: &str) -> Option<u32> {
    let number = name.strip_prefix("xray_")?.strip_suffix(".png")?;
    digits(number).filter(|&number| radiograph_name(number) == name)
}

/// File name of a depth image.
pub(super) fn depth_file_name(view: View, image_number: u32, timestamp: u64) -> String {
    format!("depth_{}_orig_{image_number}_{timestamp}.png", view.name())
}

fn depth_name(name: &str) -> Option<(View, u32, u64)> {
    let rest = |view: View| name.strip_prefix(&format!("depth_{}_orig_", view.name()));
    let (view, rest) = View::ALL
        .into_iter()
        .find_map(|view| Some((view, rest(view)?)))?;
    let (number, timestamp) = rest.strip_suffix(".png")?.split_once('_')?;
    let named = (view, digits(number)?, digits(timestamp)?);
    (depth_file_name(named.0, named.1, named.2) == name).then_some(named)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_camera_number_and_time() {
        let name = depth_file_name(View::Right, 7, 163_840_211_922);
        assert_eq!(name, "depth_cam_right_orig_7_163840211922.png");
        assert_eq!(depth_name(&name), Some((View::Right, 7, 163_840_211_922)));
        for other in [
            "depth_cam_right_7_1.png",
            "depth_cam_right_orig_7.png",
            "depth_cam_right_orig_07_1.png",
            "depth_cam_right_orig_7_-1.png",
            "depth_cam_right_big_7_1.png",
        ] {
            assert_eq!(depth_name(other), None, "{other}");
        }
        assert_eq!(number_of_radiograph("xray_0.png"), Some(0));
        assert_eq!(number_of_radiograph("xray_image_0.png"), None);
    }
}
