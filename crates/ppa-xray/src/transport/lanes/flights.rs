//! Straight flights of many photons, and the box they fly through, as arrays that loops turn into vector instructions.
//!
//! A photon's place is in cells from the corner of the voxel box, its way in mm.

/// Photons under way at once.
pub(crate) const LANES: usize = 64;

/// One number of every photon.
pub(super) type Each<T> = [T; LANES];

/// Straight flights of many photons, one array per quantity.
#[derive(Debug, Clone)]
pub(super) struct Flights {
    /// Cells from the corner of the box.
    pub position: [Each<f32>; 3],
    /// Unit vector in the device frame.
    pub direction: [Each<f32>; 3],
    /// Cells per mm.
    pub slope: [Each<f32>; 3],
    /// mm per cell.
    pub inverse: [Each<f32>; 3],
    /// Optical depth left to the next tentative collision.
    pub depth: Each<f32>,
    /// Way to the detector plane, mm; infinite for photons that fly away from it.
    pub to_plane_mm: Each<f32>,
}

impl Flights {
    pub fn new() -> Self {
        Self {
            position: [[0.0; LANES]; 3],
            direction: [[0.0; LANES]; 3],
            slope: [[1.0; LANES]; 3],
            inverse: [[1.0; LANES]; 3],
            depth: [0.0; LANES],
            to_plane_mm: [0.0; LANES],
        }
    }

    /// Overwrites photon `to` with photon `from` of another bundle.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, other: &Self, from: usize) {
        for axis in 0..3 {
            self.position[axis][to] = other.position[axis][from];
            self.direction[axis][to] = other.direction[axis][from];
            self.slope[axis][to] = other.slope[axis][from];
            self.inverse[axis][to] = other.inverse[axis][from];
        }
        self.depth[to] = other.depth[from];
        self.to_plane_mm[to] = other.to_plane_mm[from];
    }

    /// Overwrites photon `to` with photon `from`.
    pub fn move_within(&mut self, to: usize, from: usize) {
        for axis in 0..3 {
            self.position[axis][to] = self.position[axis][from];
            self.direction[axis][to] = self.direction[axis][from];
            self.slope[axis][to] = self.slope[axis][from];
            self.inverse[axis][to] = self.inverse[axis][from];
        }
        self.depth[to] = self.depth[from];
        self.to_plane_mm[to] = self.to_plane_mm[from];
    }
}

/// The voxel box seen from the device, in `f32`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Box32 {
    /// Cells from the device frame: three rows, then the offset.
    pub cell_from_device: [[f32; 4]; 3],
    /// Height above the source over cells: device z = row · cell + offset.
    pub device_z: [f32; 4],
    pub source_detector_mm: f32,
    /// Cells along each axis.
    pub size: [f32; 3],
    pub blocks: [u32; 3],
    /// Cells along the edge of a block.
    pub edge: f32,
}

/// The three components of one photon.
#[inline(always)]
pub(super) fn each<T: Copy>(vectors: &[Each<T>; 3], photon: usize) -> [T; 3] {
    [vectors[0][photon], vectors[1][photon], vectors[2][photon]]
}
