//! Lattices derived from another one: other spacing, right angles, axes in LPS order.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::grid::Grid;
use crate::volume_error::VolumeError;

/// Largest number of voxels of a lattice to resample to: 16 GiB of values.
pub(crate) const MOST_VOXELS: f64 = 4_294_967_296.0;

impl Grid {
    /// Angle between the k axis and the normal of the slices, degrees: the tilt of a gantry.
    pub fn tilt_deg(&self) -> f64 {
        let axes = self.direction();
        let normal = axes.column(0).cross(&axes.column(1)).normalize();
        // The sine of the angle stays exact where its cosine is 1 to rounding.
        let across = axes.column(2).cross(&normal).norm();
        let along = axes.column(2).dot(&normal).abs();
        across.atan2(along).to_degrees()
    }

    /// The same box and axes with other spacings along i, j, k.
    ///
    /// The box encloses whole voxels, not only their centres. Its centre does not move, and each side
    /// gets the number of voxels that comes closest to filling it.
    ///
    /// # Errors
    /// [`VolumeError::Spacing`] unless each spacing is above 0, [`VolumeError::TooCoarse`] if an axis would have no voxel left,
    /// [`VolumeError::TooFine`] for more than 2^32 voxels.
    pub fn with_spacing(&self, spacing_mm: Vector3<f64>) -> Result<Self, VolumeError> {
        if let Some(bad) = spacing_mm.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
            return Err(VolumeError::Spacing(*bad));
        }
        let old = self.spacing_mm();
        let sides_mm = [0, 1, 2].map(|axis| self.size()[axis] as f64 * old[axis]);
        let counts = [0, 1, 2].map(|axis| (sides_mm[axis] / spacing_mm[axis]).round());
        if let Some(axis) = counts.iter().position(|n| *n < 1.0) {
            return Err(VolumeError::TooCoarse {
                spacing_mm: spacing_mm[axis],
                side_mm: sides_mm[axis],
            });
        }
        let voxels = counts.iter().product::<f64>();
        if voxels > MOST_VOXELS {
            return Err(VolumeError::TooFine {
                spacing_mm: spacing_mm.min(),
                voxels,
                most: MOST_VOXELS,
            });
        }
        let middle = self.centre(self.size().map(|n| (n - 1) as f64 / 2.0));
        let half = Vector3::from(counts.map(|n| (n - 1.0) / 2.0));
        let origin = middle - self.direction() * spacing_mm.component_mul(&half);
        let size = counts.map(|n| n as usize);
        Ok(Self::from_parts(
            size,
            self.direction(),
            spacing_mm,
            origin,
        )?)
    }

    /// A lattice with right angles in the slice planes that contains every voxel centre.
    ///
    /// Its i axis is the old one and its k axis the normal of the slices, so that a tilted gantry
    /// only shifts slices within their planes. It is larger than the sheared lattice by the lean.
    ///
    /// # Errors
    /// [`VolumeError::TooFine`] if it has more than 2^32 voxels.
    pub fn upright(&self) -> Result<Self, VolumeError> {
        let columns = self.ct_from_voxel().matrix();
        let [a, b, c] =
            [0, 1, 2].map(|axis| Vector3::from(columns.fixed_view::<3, 1>(0, axis).into_owned()));
        let u = a.normalize();
        let across = b - u * u.dot(&b);
        let v = across.normalize();
        let through = c - u * u.dot(&c) - v * v.dot(&c);
        let n = through.normalize();
        let spacing = Vector3::new(a.norm(), across.norm(), through.norm());
        let direction = Matrix3::from_columns(&[u, v, n]);

        let (mut low, mut high) = (
            Vector3::repeat(f64::INFINITY),
            Vector3::repeat(f64::NEG_INFINITY),
        );
        for corner in 0..8 {
            let voxel = [0, 1, 2].map(|axis| {
                let last = (self.size()[axis] - 1) as f64;
                if corner >> axis & 1 == 1 { last } else { 0.0 }
            });
            let place = direction.tr_mul(&self.centre(voxel).coords);
            low = low.inf(&place);
            high = high.sup(&place);
        }
        let counts = (high - low)
            .component_div(&spacing)
            .map(|steps| (steps - 1e-6).ceil().max(0.0) + 1.0);
        let voxels = counts.product();
        if voxels > MOST_VOXELS {
            return Err(VolumeError::TooFine {
                spacing_mm: spacing.min(),
                voxels,
                most: MOST_VOXELS,
            });
        }
        let origin = Point3::from(direction * low);
        let size = [0, 1, 2].map(|axis| counts[axis] as usize);
        Ok(Self::from_parts(size, direction, spacing, origin)?)
    }

    /// For each of the directions L, P and S, returns the voxel axis closest to it and whether
    /// that axis points the opposite way.
    pub fn lps_axes(&self) -> [(usize, bool); 3] {
        const ORDERS: [[usize; 3]; 6] = [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ];
        let axes = self.direction();
        let along = |order: &[usize; 3]| (0..3).map(|d| axes[(d, order[d])].abs()).sum::<f64>();
        let best = ORDERS
            .into_iter()
            .max_by(|a, b| along(a).total_cmp(&along(b)));
        let order = best.expect("there are six orders");
        [0, 1, 2].map(|d| (order[d], axes[(d, order[d])] < 0.0))
    }
}
