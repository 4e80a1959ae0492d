//! Writes depth images and labels of ten persons in the published layout, lists them, and draws parts with no person in common.
//!
//! `cargo run -p ppa-dataset --example split_by_person`

use std::error::Error;

use image::{ImageBuffer, Luma};
use ppa_dataset::labels::{LabelFile, LabelRow, LabelSource};
use ppa_dataset::layout::{LimbId, Side, View};
use ppa_dataset::{BodyShape, Split, published::Published};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let root = folder.path();
    for patient in 0..10 {
        let side = Side::Right;
        let limb = LimbId { patient, side };
        // One pose, at 18 degrees, is step 36: a wall at 1 m, and two readers' grades.
        let path = root.join(limb.depth(BodyShape::Orig, View::Left, 36));
        std::fs::create_dir_all(path.parent().expect("a file in a folder"))?;
        ImageBuffer::from_pixel(64, 48, Luma([1000_u16])).save(path)?;
        let row = LabelRow::of_grades(&[1.5, 2.0], 36);
        LabelFile::new(LabelSource::Readers, row)?.write(root, limb)?;
    }

    let dataset = Published::read(root)?;
    let shares = [("train".to_owned(), 0.8), ("test".to_owned(), 0.2)];
    let split = Split::draw(&dataset.patients(), &shares, 1)?;
    split.write(root, "first")?;
    println!(
        "{} poses, test on patients {:?}",
        dataset.pairs.len(),
        split.parts["test"]
    );
    Ok(())
}
