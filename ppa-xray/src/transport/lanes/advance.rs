//! One step of every flight: to a tentative collision, or to the end of the cube over which its majorant is valid.

use crate::isa::Kernel;
use crate::transport::lanes::flights::{Box32, Each, Flights, LANES};
use crate::vector_math::{floor, greatest, least};

/// Positions of the flights in the lattice of blocks.
#[derive(Debug)]
pub(super) struct Blocks {
    /// Block coordinates.
    at: [Each<f32>; 3],
    pub index: Each<u32>,
    /// Number of blocks around it over which `bound` is valid.
    pub reach: Each<f32>,
    /// Attenuation bound, mm⁻¹.
    pub bound: Each<f32>,
}

impl Blocks {
    pub fn new() -> Self {
        Self {
            at: [[0.0; LANES]; 3],
            index: [0; LANES],
            reach: [0.0; LANES],
            bound: [0.0; LANES],
        }
    }
}

/// Result of the next step of each flight.
#[derive(Debug)]
pub(super) struct Steps {
    /// Voxel coordinates of a tentative collision.
    pub voxel: [Each<u32>; 3],
    /// One of [`Steps::ON`], [`Steps::TENTATIVE`], [`Steps::OUT`].
    pub outcome: Each<u32>,
}

impl Steps {
    /// The flight continues in another block.
    pub const ON: u32 = 0;
    /// A tentative collision, still to be accepted or rejected.
    pub const TENTATIVE: u32 = 1;
    /// The flight leaves the box or reaches the detector plane.
    pub const OUT: u32 = 2;

    pub fn new() -> Self {
        Self {
            voxel: [[0; LANES]; 3],
            outcome: [0; LANES],
        }
    }
}

/// Finds the block of each flight.
pub(super) struct Locate<'a> {
    pub space: &'a Box32,
    pub flights: &'a Flights,
    pub blocks: &'a mut Blocks,
    pub count: usize,
}

impl Kernel for Locate<'_> {
    #[inline(always)]
    fn run(self) {
        locate(self.space, self.flights, self.blocks, self.count.min(LANES));
    }
}

#[inline(always)]
fn locate(space: &Box32, flights: &Flights, blocks: &mut Blocks, count: usize) {
    let [nx, ny, _] = space.blocks;
    let per_voxel = 1.0 / space.edge;
    for i in 0..count {
        let (x, x_index) = floor(flights.position[0][i] * per_voxel);
        let (y, y_index) = floor(flights.position[1][i] * per_voxel);
        let (z, z_index) = floor(flights.position[2][i] * per_voxel);
        blocks.at[0][i] = x;
        blocks.at[1][i] = y;
        blocks.at[2][i] = z;
        // Idle lanes may hold any values.
        let row = y_index.wrapping_add(ny.wrapping_mul(z_index));
        blocks.index[i] = x_index.wrapping_add(nx.wrapping_mul(row));
    }
}

/// Moves each flight to its next tentative collision, or to the end of the cube over which its bound is valid.
pub(super) struct Advance<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    pub blocks: &'a Blocks,
    pub steps: &'a mut Steps,
    pub count: usize,
}

impl Kernel for Advance<'_> {
    #[inline(always)]
    fn run(self) {
        let count = self.count.min(LANES);
        advance(self.space, self.flights, self.blocks, self.steps, count);
    }
}

#[inline(always)]
fn advance(space: &Box32, flights: &mut Flights, blocks: &Blocks, steps: &mut Steps, count: usize) {
    let size = space.size;
    for i in 0..count {
        let reach = blocks.reach[i];
        let mut wall = [0.0_f32; 3];
        let mut low = [0.0_f32; 3];
        let mut high = [0.0_f32; 3];
        let mut exit = [0.0_f32; 3];
        for axis in 0..3 {
            let at = blocks.at[axis][i];
            low[axis] = greatest((at - reach) * space.edge, 0.0);
            high[axis] = least((at + reach + 1.0) * space.edge, size[axis]);
            // Leaving backwards ends at the first number below the wall.
            let below = low[axis] - (low[axis] * 2.5e-7 + 1e-6);
            let forward = flights.slope[axis][i] > 0.0;
            wall[axis] = if forward { high[axis] } else { below };
            exit[axis] = (wall[axis] - flights.position[axis][i]) * flights.inverse[axis][i];
        }
        let leave = least(least(exit[0], exit[1]), exit[2]);
        let bound = blocks.bound[i];
        let collide = flights.depth[i] / bound;
        let plane = flights.to_plane_mm[i];
        let distance_mm = least(least(leave, collide), plane);
        flights.depth[i] -= distance_mm * bound;
        flights.to_plane_mm[i] = plane - distance_mm;
        let mut inside = true;
        for axis in 0..3 {
            let moved = flights.position[axis][i] + flights.slope[axis][i] * distance_mm;
            // Rounding must not make the flight leave the cube early, not even onto its far wall, or fail to leave it.
            let kept = least(greatest(moved, low[axis]), high[axis] * (1.0 - 1.2e-7));
            let place = if exit[axis] <= distance_mm {
                wall[axis]
            } else {
                kept
            };
            inside &= (place >= 0.0) & (place < size[axis]);
            flights.position[axis][i] = place;
            steps.voxel[axis][i] = floor(least(kept, high[axis] - 1.0)).1;
        }
        let tentative = (collide < leave) & (collide < plane);
        let out = (plane <= distance_mm) | !inside;
        steps.outcome[i] = if tentative {
            Steps::TENTATIVE
        } else if out {
            Steps::OUT
        } else {
            Steps::ON
        };
    }
}
