//! Reading of the synthetic layout.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::folders::{Folder, digits};
use super::unpaired::Seen;
use super::{DepthFile, Found, ImagePair, Label, Pose, PublishedError, Unpaired, entries};
use crate::body_shape::BodyShape;
use crate::labels::{LabelFile, LabelName};
use crate::layout::{LimbId, Side, View, angle_text};

/// Reads all image pairs and unpaired files of one person.
pub(super) fn read(
    root: &Path,
    patient: u32,
    labels: Option<&LabelName>,
) -> Result<Found, PublishedError> {
    let person = Folder::new(root, &format!("patient_{patient}"));
    let mut found = Found::default();
    for kind in ["depth", "xray", "labels"] {
        for name in person.below(kind).folders()? {
            if !Side::ALL.iter().any(|side| side.letter() == name) {
                return Err(PublishedError::Name {
                    path: person.below(kind).below(&name).path,
                    expected: "l or r",
                });
            }
        }
    }
    for side in Side::ALL {
        let (pairs, unpaired) = read_limb(root, &person, LimbId { patient, side }, labels)?;
        found.0.extend(pairs);
        found.1.extend(unpaired);
    }
    Ok(found)
}

fn read_limb(
    root: &Path,
    person: &Folder,
    limb: LimbId,
    name: Option<&LabelName>,
) -> Result<Found, PublishedError> {
    let of_kind = |kind| person.below(kind).below(limb.side_letter());
    let lists = of_kind("labels");
    let labels = LabelFile::read_named(root, limb, name)?;
    let rois = entries::rois(&lists.path.join("roi_depth.json"), |key| {
        depth_name(key).ok()
    })?;
    let radiographs = radiographs(&of_kind("xray"))?;
    let mut pairs: BTreeMap<Pose, ImagePair> = BTreeMap::new();
    let depth = of_kind("depth");
    for name in depth.folders()? {
        let folder = depth.below(&name);
        let shape = BodyShape::ALL
            .into_iter()
            .find(|shape| shape.name() == name);
        let shape = shape.ok_or_else(|| PublishedError::Name {
            path: folder.path.clone(),
            expected: "orig, big, small, bumps_a or bumps_b",
        })?;
        for image in folder.images()? {
            let path = folder.path.join(&image);
            let (view, step) = depth_name(&image).map_err(|angle| match angle {
                Some(angle) => PublishedError::OffGrid { path, angle },
                None => PublishedError::Name {
                    path,
                    expected: "depth_cam_left_{angle}.png or depth_cam_right_{angle}.png",
                },
            })?;
            let pose = Pose::Rotated { step, shape };
            let pair = pairs.entry(pose).or_insert_with(|| ImagePair {
                limb,
                pose,
                left: None,
                right: None,
                radiograph: radiographs
                    .contains(&step)
                    .then(|| limb.radiograph_png(step)),
                label: labels.as_ref().and_then(|labels| label(labels, step)),
            });
            *pair.depth_mut(view) = Some(DepthFile {
                file: format!("{}/{image}", folder.name),
                roi: rois.get(&(view, step)).cloned(),
            });
        }
    }
    let pairs: Vec<_> = pairs.into_values().collect();
    let seen = Seen::of(&pairs);
    let mut unpaired = Vec::new();
    for &step in radiographs.difference(&seen.poses) {
        let (patient, file) = (limb.patient, limb.radiograph_png(step));
        unpaired.push(Unpaired::Radiograph { patient, file });
    }
    let list = |name: &str| format!("{}/{name}", lists.name);
    let labels = labels.iter().flat_map(LabelFile::labels);
    for pose in labels.map(|row| row.step) {
        if !seen.poses.contains(&pose) {
            let list = list(&LabelFile::file_name(name));
            unpaired.push(Unpaired::Label { list, pose });
        }
    }
    unpaired.extend(seen.regions_of_none(&list("roi_depth.json"), rois.keys()));
    Ok((pairs, unpaired))
}

fn label(labels: &LabelFile, step: u32) -> Option<Label> {
    labels.of_step(step).map(|row| Label {
        label: row.label,
        std: row.std,
        source: labels.source_of_step(step),
    })
}

fn radiographs(folder: &Folder) -> Result<BTreeSet<u32>, PublishedError> {
    let step = |name: String| {
        step_of_radiograph(&name).ok_or_else(|| PublishedError::Name {
            path: folder.path.join(&name),
            expected: "xray_image_{step}.png",
        })
    };
    folder.images()?.into_iter().map(step).collect()
}

/// The step in the name of a radiograph, such as 36 in `xray_image_36.png`.
fn step_of_radiograph(name: &str) -> Option<u32> {
    let number = name.strip_prefix("xray_image_")?.strip_suffix(".png")?;
    digits(number).filter(|step: &u32| step.to_string() == number)
}

/// Camera and step in a name such as `depth_cam_left_18.0.png`; the error is the angle if it is off the grid or written otherwise.
fn depth_name(name: &str) -> Result<(View, u32), Option<String>> {
    let rest = |view: View| name.strip_prefix(&format!("depth_{}_", view.name()));
    let of_view = View::ALL
        .into_iter()
        .find_map(|view| Some((view, rest(view)?)));
    let (view, angle) = of_view
        .and_then(|(view, rest)| Some((view, rest.strip_suffix(".png")?)))
        .ok_or(None)?;
    let steps = 2.0 * angle.parse::<f64>().map_err(|_| None)?;
    let step = steps as u32;
    if f64::from(step) != steps || angle_text(step) != angle {
        return Err(Some(angle.to_owned()));
    }
    Ok((view, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_camera_and_step() {
        assert_eq!(depth_name("depth_cam_left_90.0.png"), Ok((View::Left, 180)));
        assert_eq!(
            depth_name("depth_cam_right_45.5.png"),
            Ok((View::Right, 91))
        );
        let off = |angle: &str| Err(Some(angle.to_owned()));
        for angle in ["18.3", "-0.5", "18", "18.00", "018.0", "NaN", "1e1"] {
            assert_eq!(
                depth_name(&format!("depth_cam_left_{angle}.png")),
                off(angle)
            );
        }
        for other in [
            "depth_cam_top_18.0.png",
            "depth_cam_left_.png",
            "depth_cam_left_18.0.exr",
        ] {
            assert_eq!(depth_name(other), Err(None));
        }
        assert_eq!(step_of_radiograph("xray_image_180.png"), Some(180));
        assert_eq!(step_of_radiograph("xray_image_+18.png"), None);
        assert_eq!(step_of_radiograph("xray_image_018.png"), None);
    }
}
