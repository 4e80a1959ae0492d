//! A label for every voxel, such as a segmentation.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A label for every voxel of a phantom, first axis fastest; 0 means no label.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct VoxelLabels(pub Vec<u8>);

/// Shows only the number of labels, since there are many.
impl fmt::Debug for VoxelLabels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "VoxelLabels({} voxels)", self.0.len())
    }
}

/// The labels in use, with a number for each.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LabelNumbers([Option<u8>; 256]);

impl VoxelLabels {
    /// The labels in use, in ascending order, without 0.
    pub(crate) fn found(&self) -> Vec<u8> {
        let mut occurs = [false; 256];
        for &label in &self.0 {
            occurs[usize::from(label)] = true;
        }
        (1..=255)
            .filter(|&label| occurs[usize::from(label)])
            .collect()
    }
}

impl LabelNumbers {
    /// Numbers the given labels in their order.
    pub fn of(labels: &[u8]) -> Self {
        let mut numbers = [None; 256];
        for (number, &label) in (0..).zip(labels) {
            numbers[usize::from(label)] = Some(number);
        }
        Self(numbers)
    }

    /// Number of labels that have a number.
    pub fn count(&self) -> usize {
        self.0.iter().flatten().count()
    }

    /// Number of a label, or `None` if it is not in use.
    #[inline]
    pub fn get(&self, label: u8) -> Option<usize> {
        self.0[usize::from(label)].map(usize::from)
    }
}
