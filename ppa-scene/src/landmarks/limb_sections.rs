//! Cross-sections of a limb along the scan: skin outline, bones, density along a line.

use std::borrow::Cow;

use nalgebra::{Point3, Vector3};
use ppa_ct::{Volume, VolumeError};

use crate::landmarks::outlines::{filled, flood, parts};
use crate::landmarks::reslice::Resliced;

/// HU from which a voxel is bone; trabecular bone next to a joint starts near 150 to 200.
const BONE_HU: f32 = 200.0;

/// Tibia and fibula are connected in coarse voxels by necks narrower than twice this, mm.
const NECK_MM: f64 = 3.0;

/// Slices of a limb across the scan's limb direction, numbered as in the volume.
pub(crate) struct Sections<'a> {
    volume: Cow<'a, Volume>,
    mask: Cow<'a, [bool]>,
    /// Grid axis that runs along the limb, then the two in-slice axes.
    axes: [usize; 3],
    /// Unit normal of the slices, towards proximal.
    pub(crate) direction: Vector3<f64>,
    /// Slices that show only part of the limb's cross-section, since the scan ends there.
    cut: Vec<bool>,
}

/// One bone in one slice, with everything inside its outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BoneSection {
    pub(crate) area_mm2: f64,
    pub(crate) centre: Point3<f64>,
}

impl<'a> Sections<'a> {
    /// Slices along the grid axis closest to `towards_proximal`.
    pub(crate) fn along(
        volume: &'a Volume,
        mask: &'a [bool],
        towards_proximal: &Vector3<f64>,
    ) -> Self {
        let affine = volume.grid().ct_from_voxel().matrix();
        let column = |axis: usize| affine.fixed_view::<3, 1>(0, axis).into_owned();
        let normal = |axis: usize| {
            column((axis + 1) % 3)
                .cross(&column((axis + 2) % 3))
                .normalize()
        };
        let alignment = |axis: usize| normal(axis).dot(towards_proximal);
        let axis = (0..3)
            .max_by(|a, b| alignment(*a).abs().total_cmp(&alignment(*b).abs()))
            .unwrap_or(2);
        Self {
            cut: vec![false; volume.grid().size()[axis]],
            volume: Cow::Borrowed(volume),
            mask: Cow::Borrowed(mask),
            axes: [axis, (axis + 1) % 3, (axis + 2) % 3],
            direction: normal(axis) * alignment(axis).signum(),
        }
    }

    /// Slices across `towards_proximal` of a limb that is oblique in the scan, interpolated.
    pub(crate) fn across(
        volume: &Volume,
        mask: &[bool],
        towards_proximal: &Vector3<f64>,
    ) -> Result<Self, VolumeError> {
        let resliced = Resliced::across(volume, mask, towards_proximal)?;
        Ok(Self {
            volume: Cow::Owned(resliced.volume),
            mask: Cow::Owned(resliced.mask),
            axes: [2, 0, 1],
            direction: *towards_proximal,
            cut: resliced.cut,
        })
    }

    /// Whether a slice shows the limb's whole cross-section.
    pub(crate) fn is_whole(&self, slice: usize) -> bool {
        !self.cut[slice]
    }

    /// Number of slices.
    pub(crate) fn count(&self) -> usize {
        self.volume.grid().size()[self.axes[0]]
    }

    /// Position of a slice along [`Self::direction`], mm; every voxel of a slice shares it.
    pub(crate) fn level(&self, slice: usize) -> f64 {
        let centre = self
            .volume
            .grid()
            .centre(self.voxel(slice, 0, 0).map(|v| v as f64));
        self.direction.dot(&centre.coords)
    }

    /// Whole slices that show the limb, from proximal to distal.
    pub(crate) fn proximal_to_distal(&self) -> Vec<usize> {
        let mut slices: Vec<usize> = (0..self.count())
            .filter(|slice| self.is_whole(*slice) && self.limb_pixels(*slice).next().is_some())
            .collect();
        slices.sort_by(|a, b| self.level(*b).total_cmp(&self.level(*a)));
        slices
    }

    /// Centre of the limb in a slice; `None` where there is no limb.
    pub(crate) fn limb_centre(&self, slice: usize) -> Option<Point3<f64>> {
        self.mean(slice, self.limb_pixels(slice))
    }

    /// Area of the limb in a slice, mm², and its centre; `None` where there is no limb.
    pub(crate) fn limb_section(&self, slice: usize) -> Option<(f64, Point3<f64>)> {
        Some((self.limb_mm2(slice), self.limb_centre(slice)?))
    }

    /// Area of the limb in a slice, mm².
    pub(crate) fn limb_mm2(&self, slice: usize) -> f64 {
        self.limb_pixels(slice).count() as f64 * self.pixel_mm2()
    }

    /// The bones of a slice, largest outline first.
    pub(crate) fn bones(&self, slice: usize) -> Vec<BoneSection> {
        let (nu, nv) = self.extent();
        let mut open = self.bone_pixels(slice);
        let mut bones = Vec::new();
        for start in 0..open.len() {
            if !open[start] {
                continue;
            }
            let pixels = flood(start, (nu, nv), true, |p| std::mem::take(&mut open[p]));
            for part in parts(filled(&pixels), self.pixel_mm(), NECK_MM) {
                let centre = self.mean(slice, part.iter().copied());
                bones.extend(centre.map(|centre| BoneSection {
                    area_mm2: part.len() as f64 * self.pixel_mm2(),
                    centre,
                }));
            }
        }
        bones.sort_by(|a, b| b.area_mm2.total_cmp(&a.area_mm2));
        bones
    }

    /// Connected pieces of bone in a slice, as centres of their voxels in the `ct` frame.
    pub(crate) fn bone_pieces(&self, slice: usize) -> Vec<Vec<Point3<f64>>> {
        let (nu, nv) = self.extent();
        let mut open = self.bone_pixels(slice);
        let mut pieces = Vec::new();
        for start in 0..open.len() {
            if open[start] {
                let pixels = flood(start, (nu, nv), true, |p| std::mem::take(&mut open[p]));
                let centre = |(u, v)| {
                    let voxel = self.voxel(slice, u, v);
                    self.volume.grid().centre(voxel.map(|v| v as f64))
                };
                pieces.push(pixels.into_iter().map(centre).collect());
            }
        }
        pieces
    }

    /// Mean HU of the limb's voxels of a slice within `radius_mm` of a point of that slice.
    pub(crate) fn mean_hu(
        &self,
        slice: usize,
        centre: &Point3<f64>,
        radius_mm: f64,
    ) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0_u32);
        for (u, v) in self.limb_pixels(slice) {
            let voxel = self.voxel(slice, u, v);
            let offset = self.volume.grid().centre(voxel.map(|v| v as f64)) - centre;
            let across = offset - self.direction * self.direction.dot(&offset);
            if across.norm_squared() <= radius_mm * radius_mm {
                sum += f64::from(self.volume.at(voxel));
                count += 1;
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }

    /// Which pixels (u, v) of a slice, at u + nu · v, hold bone of the limb.
    fn bone_pixels(&self, slice: usize) -> Vec<bool> {
        let (nu, nv) = self.extent();
        let mut bone = vec![false; nu * nv];
        for (u, v) in self.limb_pixels(slice) {
            bone[u + nu * v] = self.volume.at(self.voxel(slice, u, v)) >= BONE_HU;
        }
        bone
    }

    fn extent(&self) -> (usize, usize) {
        let size = self.volume.grid().size();
        (size[self.axes[1]], size[self.axes[2]])
    }

    fn voxel(&self, slice: usize, u: usize, v: usize) -> [usize; 3] {
        let mut voxel = [0; 3];
        for (axis, index) in self.axes.into_iter().zip([slice, u, v]) {
            voxel[axis] = index;
        }
        voxel
    }

    fn pixel_mm(&self) -> [f64; 2] {
        let spacing = self.volume.grid().spacing_mm();
        [spacing[self.axes[1]], spacing[self.axes[2]]]
    }

    fn pixel_mm2(&self) -> f64 {
        let affine = self.volume.grid().ct_from_voxel().matrix();
        let column = |axis: usize| affine.fixed_view::<3, 1>(0, axis).into_owned();
        column(self.axes[1]).cross(&column(self.axes[2])).norm()
    }

    fn limb_pixels(&self, slice: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let (nu, nv) = self.extent();
        (0..nv)
            .flat_map(move |v| (0..nu).map(move |u| (u, v)))
            .filter(move |(u, v)| self.mask[self.volume.grid().index(self.voxel(slice, *u, *v))])
    }

    fn mean(
        &self,
        slice: usize,
        pixels: impl Iterator<Item = (usize, usize)>,
    ) -> Option<Point3<f64>> {
        let (mut su, mut sv, mut n) = (0.0, 0.0, 0.0);
        for (u, v) in pixels {
            su += u as f64;
            sv += v as f64;
            n += 1.0;
        }
        if n == 0.0 {
            return None;
        }
        let mut voxel = [0.0; 3];
        for (axis, index) in self.axes.into_iter().zip([slice as f64, su / n, sv / n]) {
            voxel[axis] = index;
        }
        Some(self.volume.grid().centre(voxel))
    }
}
