//! Datasets of other authors, read, checked and written.

mod archived;
mod authors_loader;
mod converted;
mod exported;
mod inspected;
mod refused;
mod trees;

use ppa_dataset::BodyShape;
use ppa_dataset::layout::{Side, View};
use ppa_dataset::published::{Layout, Pose, Published};

use crate::trees::Tree;

#[test]
fn the_synthetic_layout_gives_a_row_per_pose_and_shape() {
    let tree = Tree::synthetic();
    let read = Published::read(tree.root()).unwrap();
    assert_eq!(read.layout, Layout::Synthetic);
    assert_eq!(read.patients(), [0, 12]);
    // Person 0: both sides, two steps, two shapes; person 12: right side only.
    assert_eq!(read.pairs.len(), 2 * 2 * 2 + 2 * 2);
    let pair = |patient, step, shape| {
        let pose = Pose::Rotated { step, shape };
        let of =
            |p: &&ppa_dataset::published::ImagePair| p.limb.patient == patient && p.pose == pose;
        read.pairs.iter().rfind(of).unwrap()
    };
    let found = pair(0, 91, BodyShape::Big);
    assert_eq!(found.limb.side, Side::Right);
    let right = found.depth(View::Right).unwrap();
    assert_eq!(right.file, "patient_0/depth/r/big/depth_cam_right_45.5.png");
    let roi = right.roi.as_ref().unwrap();
    assert_eq!(
        (roi.image_number, roi.x_start, roi.y_start, roi.size),
        (91, 2, 1, 5)
    );
    assert_eq!(
        found.radiograph.as_deref(),
        Some("patient_0/xray/r/xray_image_91.png")
    );
    let label = found.label.as_ref().unwrap();
    assert_eq!((label.label, label.std, label.source), (2.5, 0.5, None));
    let bare = pair(12, 180, BodyShape::Orig);
    assert!(bare.label.is_none() && bare.radiograph.is_none());
    assert!(bare.depth(View::Left).unwrap().roi.is_none());
}

#[test]
fn the_specimen_layout_gives_a_row_per_moment() {
    let tree = Tree::specimen();
    let read = Published::read(tree.root()).unwrap();
    assert_eq!(read.layout, Layout::Specimen);
    assert_eq!(read.patients(), [1, 2]);
    let first = &read.pairs[0];
    assert_eq!((first.limb.patient, first.limb.side), (1, Side::Left));
    assert_eq!(
        first.left.as_ref().unwrap().file,
        "patient_1_l/min/data/dataset/depth/depth_cam_left_orig_0_1000.png"
    );
    // Later images of a pose follow it, ordered by time rather than by name.
    let times = read.pairs.iter().filter_map(|pair| match pair.pose {
        Pose::Recorded {
            image_number: 10,
            timestamp,
            ..
        } => Some(timestamp),
        _ => None,
    });
    assert_eq!(times.collect::<Vec<_>>()[..2], [999, 1000]);
}
