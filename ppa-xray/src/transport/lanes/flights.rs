//! Straight flights of many photons and the box around them, as arrays whose loops compile to vector instructions.
//!
//! A photon's position is in cells from the corner of the voxel box, its path length in mm.

/// Number of photons followed at once.
pub(crate) const LANES: usize = 64;

/// One value per photon.
pub(super) type Each<T> = [T; LANES];

/// Straight flights of many photons, one array per quantity.
#[derive(Debug)]
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
    /// Distance to the detector plane, mm; infinite for photons that fly away from it.
    pub to_plane_mm: Each<f32>,
}

/// A single flight of [`Flights`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Flight {
    position: [f32; 3],
    direction: [f32; 3],
    slope: [f32; 3],
    inverse: [f32; 3],
    depth: f32,
    to_plane_mm: f32,
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

    #[inline(always)]
    pub fn at(&self, photon: usize) -> Flight {
        Flight {
            position: each(&self.position, photon),
            direction: each(&self.direction, photon),
            slope: each(&self.slope, photon),
            inverse: each(&self.inverse, photon),
            depth: self.depth[photon],
            to_plane_mm: self.to_plane_mm[photon],
        }
    }

    #[inline(always)]
    pub fn put(&mut self, photon: usize, flight: Flight) {
        for axis in 0..3 {
            self.position[axis][photon] = flight.position[axis];
            self.direction[axis][photon] = flight.direction[axis];
            self.slope[axis][photon] = flight.slope[axis];
            self.inverse[axis][photon] = flight.inverse[axis];
        }
        self.depth[photon] = flight.depth;
        self.to_plane_mm[photon] = flight.to_plane_mm;
    }

    /// Gives photon `to` the direction of photon `from` of another bundle, at its own position.
    #[inline(always)]
    pub fn turn(&mut self, to: usize, other: &Self, from: usize) {
        for axis in 0..3 {
            self.direction[axis][to] = other.direction[axis][from];
            self.slope[axis][to] = other.slope[axis][from];
            self.inverse[axis][to] = other.inverse[axis][from];
        }
        self.to_plane_mm[to] = other.to_plane_mm[from];
    }
}

/// The voxel box as seen from the device, in `f32`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Box32 {
    /// Transform from the device frame to cells: three rows, then the offset.
    pub cell_from_device: [[f32; 4]; 3],
    /// Height above the source as a function of cells: device z = row · cell + offset.
    pub device_z: [f32; 4],
    pub source_detector_mm: f32,
    /// Cells along each axis.
    pub size: [f32; 3],
    pub blocks: [u32; 3],
    /// Cells along the edge of a block.
    pub edge: f32,
}

impl Box32 {
    /// Component along `axis`, in cells, of a vector of the device frame, mm.
    #[inline(always)]
    pub fn cells(&self, axis: usize, [x, y, z]: [f32; 3]) -> f32 {
        let [a, b, c, _] = self.cell_from_device[axis];
        a * x + b * y + c * z
    }
}

/// The three components of one photon.
#[inline(always)]
pub(super) fn each<T: Copy>(vectors: &[Each<T>; 3], photon: usize) -> [T; 3] {
    [vectors[0][photon], vectors[1][photon], vectors[2][photon]]
}
