//! A coarse copy of a volume: means over blocks of about 2 mm, ordered along the body's axes.

use rayon::prelude::*;

use crate::lps_view::LpsView;
use crate::volume::Volume;

/// Approximate side of a block, mm.
const BLOCK_MM: f64 = 2.0;

/// Means over blocks of voxels; x runs to the left, y posterior, z superior, x fastest.
pub(super) struct Survey {
    pub size: [usize; 3],
    pub spacing_mm: [f64; 3],
    pub hu: Vec<f32>,
}

impl Survey {
    pub fn of(volume: &Volume) -> Self {
        let view = LpsView::of(volume);
        let (fine, spacing) = (view.size(), view.spacing_mm());
        let block = [0, 1, 2].map(|axis| {
            let wanted = (BLOCK_MM / spacing[axis]).round().max(1.0) as usize;
            wanted.min(fine[axis])
        });
        let size = [0, 1, 2].map(|axis| fine[axis].div_ceil(block[axis]));
        let mut hu = vec![0.0; size.iter().product()];
        let rows = hu.par_chunks_mut(size[0]).enumerate();
        rows.for_each(|(row, means)| {
            let (y, z) = (row % size[1], row / size[1]);
            for (x, mean) in means.iter_mut().enumerate() {
                // The last block of an axis may hold fewer voxels, so that the faces are kept.
                let from = [x * block[0], y * block[1], z * block[2]];
                let to = [0, 1, 2].map(|axis| (from[axis] + block[axis]).min(fine[axis]));
                let (mut sum, mut count) = (0.0, 0);
                for k in from[2]..to[2] {
                    for j in from[1]..to[1] {
                        for i in from[0]..to[0] {
                            sum += f64::from(view.at([i, j, k]));
                            count += 1;
                        }
                    }
                }
                *mean = (sum / f64::from(count)) as f32;
            }
        });
        Self {
            size,
            spacing_mm: [0, 1, 2].map(|axis| spacing[axis] * block[axis] as f64),
            hu,
        }
    }

    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// Area of a block's face across `axis`, cm².
    pub fn face_cm2(&self, axis: usize) -> f64 {
        let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
        self.spacing_mm[a] * self.spacing_mm[b] / 100.0
    }
}
