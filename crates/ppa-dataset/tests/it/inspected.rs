//! Datasets whose images do not fit their lists.

use std::fs;

use ppa_dataset::published::{Flaw, inspect};

use crate::trees::Tree;

fn flaws(tree: &Tree) -> Vec<String> {
    let found = inspect(tree.root()).unwrap();
    found.flaws.iter().map(Flaw::to_string).collect()
}

#[test]
fn a_whole_dataset_has_no_flaws() {
    let found = inspect(Tree::synthetic().root()).unwrap();
    assert_eq!(found.flaws, []);
    assert_eq!((found.patients, found.limbs, found.pairs), (2, 3, 12));
    assert_eq!((found.depth_images, found.regions), (24, 16));
    assert_eq!(
        (found.radiographs, found.labelled, found.manifest),
        (4, 8, false)
    );
    assert_eq!(inspect(Tree::specimen().root()).unwrap().flaws, []);
}

#[test]
fn each_flaw_is_told_with_its_file() {
    let file = "patient_0/depth/r/orig/depth_cam_left_45.5.png";
    type Break<'a> = &'a dyn Fn(&Tree);
    let broken: [(&str, Break); 6] = [
        ("is not a whole PNG", &|tree| {
            let bytes = fs::read(tree.path(file)).unwrap();
            fs::write(tree.path(file), &bytes[..bytes.len() / 2]).unwrap();
        }),
        ("expected one channel with 16 bits", &|tree| {
            image::RgbImage::new(12, 9).save(tree.path(file)).unwrap();
        }),
        (
            "has 12 x 9 pixels, its region reaches to column 13 and row 12",
            &|tree| {
                let roi = "\"camera\": \"cam_left\",\n    \"image_number\": 91,\n    \"size\": 5";
                tree.edit(
                    "patient_0/labels/r/roi_depth.json",
                    roi,
                    &roi.replace("size\": 5", "size\": 11"),
                );
            },
        ),
        ("its region reaches to column 4294967295", &|tree| {
            let roi = "\"camera\": \"cam_left\",\n    \"image_number\": 91,\n    \"size\": 5";
            tree.edit(
                "patient_0/labels/r/roi_depth.json",
                roi,
                &roi.replace("size\": 5", "size\": 4294967295"),
            );
        }),
        ("has no counterpart of the other camera", &|tree| {
            fs::remove_file(tree.path("patient_0/depth/r/orig/depth_cam_right_45.5.png")).unwrap();
        }),
        ("are the same image, but of different persons", &|tree| {
            let other = "patient_12/depth/r/orig/depth_cam_left_45.5.png";
            fs::copy(tree.path(file), tree.path(other)).unwrap();
        }),
    ];
    for (expected, break_it) in broken {
        let tree = Tree::synthetic();
        break_it(&tree);
        let said = flaws(&tree);
        let told = said
            .iter()
            .any(|flaw| flaw.contains(file) && flaw.contains(expected));
        assert!(told, "{expected:?} is missing in {said:?}");
    }
}
