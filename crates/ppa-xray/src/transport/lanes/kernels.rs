//! The straight-line arithmetic of many photons at once.
//!
//! Every function is a plain loop over arrays, which the compiler turns into vector instructions; whatever needs a table
//! or a decision stays with the caller. A photon's place is in cells from the corner of the voxel box, its way in mm.

#![expect(
    clippy::needless_range_loop,
    reason = "one index runs through all arrays of a photon"
)]

use crate::matter::impulse_approximation::BoundElectron;
use crate::philox;
use crate::transport::lanes::elementary::{ln, sin_cos_turn};
use crate::transport::lanes::isa::Kernel;
use crate::transport::majorants::EDGE;

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
}

/// Where the flights stand in the lattice of blocks.
#[derive(Debug)]
pub(super) struct Blocks {
    /// Block coordinates.
    at: [Each<f32>; 3],
    pub index: Each<u32>,
    /// Blocks around it over which `bound` holds.
    pub reach: Each<f32>,
    /// mm⁻¹.
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

/// What the next step of each flight leads to.
#[derive(Debug)]
pub(super) struct Steps {
    /// Voxel coordinates of a tentative collision.
    pub voxel: [Each<u32>; 3],
    /// One of [`Steps::ON`], [`Steps::TENTATIVE`], [`Steps::OUT`].
    pub outcome: Each<u32>,
}

impl Steps {
    /// The flight goes on in another block.
    pub const ON: u32 = 0;
    /// A tentative collision, to be accepted or not.
    pub const TENTATIVE: u32 = 1;
    /// The box, or the space before the detector plane, is left.
    pub const OUT: u32 = 2;

    pub fn new() -> Self {
        Self {
            voxel: [[0; LANES]; 3],
            outcome: [0; LANES],
        }
    }
}

/// Random numbers of many histories: one Philox block each.
#[derive(Debug)]
pub(super) struct Draws {
    pub counter: [Each<u32>; 4],
    pub block: [Each<u32>; 4],
}

impl Draws {
    pub fn new() -> Self {
        Self {
            counter: [[0; LANES]; 4],
            block: [[0; LANES]; 4],
        }
    }

    #[inline(always)]
    pub fn block(&self, photon: usize) -> [u32; 4] {
        let [a, b, c, d] = &self.block;
        [a[photon], b[photon], c[photon], d[photon]]
    }
}

/// The three components of one photon.
#[inline(always)]
pub(super) fn each<T: Copy>(vectors: &[Each<T>; 3], photon: usize) -> [T; 3] {
    [vectors[0][photon], vectors[1][photon], vectors[2][photon]]
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Largest whole number not above `x`, for 0 ≤ x < 2²²; as a number and as an index.
///
/// Adding 2²³ rounds in the last place, and leaves the integer in the low bits: casts and libraries would not vectorise.
#[inline(always)]
fn floor(x: f32) -> (f32, u32) {
    const MAGIC: f32 = 8_388_608.0;
    let rounded = (x + MAGIC) - MAGIC;
    let floor = rounded - if rounded > x { 1.0 } else { 0.0 };
    (floor, (floor + MAGIC).to_bits() & 0x007F_FFFF)
}

/// Uniform in (0, 1]: fine near zero, so that free paths reach 22 mean free paths.
#[inline(always)]
fn open_unit(word: u32) -> f32 {
    // Halves are exact in `f32`, and signed conversions are one instruction.
    let half = (word >> 1) as i32 as f32;
    (half + 0.25) * (1.0 / 2_147_483_648.0)
}

/// Uniform in [0, 1) in steps of 2⁻²⁴.
#[inline(always)]
pub(super) fn unit(word: u32) -> f32 {
    (word >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// One Philox block per photon.
pub(super) struct Draw<'a> {
    pub key: [u32; 2],
    pub draws: &'a mut Draws,
    pub count: usize,
}

impl Kernel for Draw<'_> {
    #[inline(always)]
    fn run(self) {
        let Draws { counter, block } = self.draws;
        let key = self.key;
        for i in 0..self.count.min(LANES) {
            let [a, b, c, d] = philox::rounds(
                [counter[0][i], counter[1][i], counter[2][i], counter[3][i]],
                key,
            );
            block[0][i] = a;
            block[1][i] = b;
            block[2][i] = c;
            block[3][i] = d;
        }
    }
}

/// Optical depths of mean 1 from one random word each.
pub(super) struct Depths<'a> {
    pub word: &'a Each<u32>,
    pub depth: &'a mut Each<f32>,
    pub count: usize,
}

impl Kernel for Depths<'_> {
    #[inline(always)]
    fn run(self) {
        for i in 0..self.count.min(LANES) {
            self.depth[i] = -ln(open_unit(self.word[i]));
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
    for i in 0..count {
        let (x, x_index) = floor(flights.position[0][i] * (1.0 / EDGE as f32));
        let (y, y_index) = floor(flights.position[1][i] * (1.0 / EDGE as f32));
        let (z, z_index) = floor(flights.position[2][i] * (1.0 / EDGE as f32));
        blocks.at[0][i] = x;
        blocks.at[1][i] = y;
        blocks.at[2][i] = z;
        blocks.index[i] = x_index + nx * (y_index + ny * z_index);
    }
}

/// Takes each flight to its next tentative collision, or to the end of the cube over which its bound holds.
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
            low[axis] = greatest((at - reach) * EDGE as f32, 0.0);
            high[axis] = least((at + reach + 1.0) * EDGE as f32, size[axis]);
            // Leaving backwards means the first number below the wall.
            let below = low[axis] - (low[axis] * 2.5e-7 + 1e-6);
            let forward = flights.slope[axis][i] > 0.0;
            wall[axis] = if forward { high[axis] } else { below };
            exit[axis] = (wall[axis] - flights.position[axis][i]) * flights.inverse[axis][i];
        }
        let leave = least(least(exit[0], exit[1]), exit[2]);
        let bound = blocks.bound[i];
        let collide = flights.depth[i] / bound;
        let plane = flights.to_plane_mm[i];
        let way = least(least(leave, collide), plane);
        flights.depth[i] -= way * bound;
        flights.to_plane_mm[i] = plane - way;
        let mut inside = true;
        for axis in 0..3 {
            let moved = flights.position[axis][i] + flights.slope[axis][i] * way;
            // Rounding must neither leave the cube early, not even onto its far wall, nor fail to leave it.
            let kept = least(greatest(moved, low[axis]), high[axis] * (1.0 - 1.2e-7));
            let place = if exit[axis] <= way { wall[axis] } else { kept };
            inside &= (place >= 0.0) & (place < size[axis]);
            flights.position[axis][i] = place;
            steps.voxel[axis][i] = floor(least(kept, high[axis] - 1.0)).1;
        }
        let tentative = (collide < leave) & (collide < plane);
        let out = (plane <= way) | !inside;
        steps.outcome[i] = if tentative {
            Steps::TENTATIVE
        } else if out {
            Steps::OUT
        } else {
            Steps::ON
        };
    }
}

/// New directions: a polar angle and an azimuth about the old one.
#[derive(Debug)]
pub(super) struct Turns {
    pub direction: [Each<f32>; 3],
    pub cos_theta: Each<f32>,
    /// Random word of the azimuth.
    pub azimuth: Each<u32>,
}

impl Turns {
    pub fn new() -> Self {
        Self {
            direction: [[0.0; LANES]; 3],
            cos_theta: [0.0; LANES],
            azimuth: [0; LANES],
        }
    }
}

/// Turns directions.
pub(super) struct Turn<'a> {
    pub turns: &'a mut Turns,
    pub count: usize,
}

impl Kernel for Turn<'_> {
    #[inline(always)]
    fn run(self) {
        turn(self.turns, self.count.min(LANES));
    }
}

#[inline(always)]
fn turn(turns: &mut Turns, count: usize) {
    for i in 0..count {
        let (sin_phi, cos_phi) = sin_cos_turn(unit(turns.azimuth[i]));
        let cos_theta = turns.cos_theta[i];
        let sin_theta = greatest((1.0 - cos_theta) * (1.0 + cos_theta), 0.0).sqrt();
        // Orthonormal basis without a branch near the pole (Duff et al., JCGT 6(1), 2017).
        let [x, y, z] = each(&turns.direction, i);
        let sign = 1.0_f32.copysign(z);
        let a = -1.0 / (sign + z);
        let b = x * y * a;
        let (u, v) = (sin_theta * cos_phi, sin_theta * sin_phi);
        let new = [
            (1.0 + sign * x * x * a) * u + b * v + x * cos_theta,
            sign * b * u + (sign + y * y * a) * v + y * cos_theta,
            z * cos_theta - sign * x * u - y * v,
        ];
        // One Newton step back to length 1.
        let square = new[0] * new[0] + new[1] * new[1] + new[2] * new[2];
        let length = 1.5 - 0.5 * square;
        for axis in 0..3 {
            turns.direction[axis][i] = new[axis] * length;
        }
    }
}

/// Attempts at Compton scattering in the impulse approximation.
#[derive(Debug)]
pub(super) struct Attempts {
    pub energy_kev: Each<f32>,
    /// sin²(θ/2).
    pub half: Each<f32>,
    /// Of the struck electron, as `momentum`.
    pub binding_kev: Each<f32>,
    pub momentum: Each<f32>,
    /// Energy of the scattered photon, or what [`BoundElectron::outcome`] says instead.
    pub scattered_kev: Each<f32>,
}

impl Attempts {
    pub fn new() -> Self {
        Self {
            energy_kev: [0.0; LANES],
            half: [0.0; LANES],
            binding_kev: [0.0; LANES],
            momentum: [0.0; LANES],
            scattered_kev: [0.0; LANES],
        }
    }
}

/// Finds the energies of scattered photons.
pub(super) struct Attempt<'a> {
    pub attempts: &'a mut Attempts,
    /// Random words.
    pub momentum: &'a Each<u32>,
    pub way: &'a Each<u32>,
    pub count: usize,
}

impl Kernel for Attempt<'_> {
    #[inline(always)]
    fn run(self) {
        attempt(
            self.attempts,
            self.momentum,
            self.way,
            self.count.min(LANES),
        );
    }
}

#[inline(always)]
fn attempt(attempts: &mut Attempts, momentum: &Each<u32>, way: &Each<u32>, count: usize) {
    for i in 0..count {
        let electron = BoundElectron {
            binding_kev: attempts.binding_kev[i],
            momentum: attempts.momentum[i],
        };
        let (energy_kev, half) = (attempts.energy_kev[i], attempts.half[i]);
        // In the middle of steps of 2⁻²³: neither 0 nor 1, whose momentum would be infinite.
        let u = ((momentum[i] >> 9) as i32 as f32 + 0.5) * (1.0 / 8_388_608.0);
        let scattered = electron.outcome(energy_kev, half, u, unit(way[i]));
        attempts.scattered_kev[i] = least(scattered, energy_kev);
    }
}

/// Finds slopes and the way to the detector plane from positions and directions.
pub(super) struct Aim<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    pub count: usize,
}

impl Kernel for Aim<'_> {
    #[inline(always)]
    fn run(self) {
        aim(self.space, self.flights, self.count.min(LANES));
    }
}

#[inline(always)]
fn aim(space: &Box32, flights: &mut Flights, count: usize) {
    let (m, row) = (space.cell_from_device, space.device_z);
    let plane = space.source_detector_mm;
    for i in 0..count {
        let [u, v, w] = each(&flights.direction, i);
        let [x, y, z] = each(&flights.position, i);
        for axis in 0..3 {
            let slope = m[axis][0] * u + m[axis][1] * v + m[axis][2] * w;
            // A flight along a wall still has a reciprocal.
            let guarded = if slope.abs() < 1e-12 { 1e-12 } else { slope };
            flights.slope[axis][i] = guarded;
            flights.inverse[axis][i] = 1.0 / guarded;
        }
        let height = row[0] * x + row[1] * y + row[2] * z + row[3];
        let way = (plane - height) / w;
        flights.to_plane_mm[i] = if w > 0.0 {
            greatest(way, 0.0)
        } else {
            f32::INFINITY
        };
    }
}

/// Turns positions from mm in the device frame into cells.
pub(super) struct Place<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    pub count: usize,
}

impl Kernel for Place<'_> {
    #[inline(always)]
    fn run(self) {
        let m = self.space.cell_from_device;
        for i in 0..self.count.min(LANES) {
            let [x, y, z] = each(&self.flights.position, i);
            for axis in 0..3 {
                self.flights.position[axis][i] =
                    m[axis][0] * x + m[axis][1] * y + m[axis][2] * z + m[axis][3];
            }
        }
    }
}

/// Takes photons from the source to the box.
pub(super) struct Enter<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    /// Whether the photon meets the box before the detector plane.
    pub meets: &'a mut Each<u32>,
    pub count: usize,
}

impl Kernel for Enter<'_> {
    #[inline(always)]
    fn run(self) {
        enter(self.space, self.flights, self.meets, self.count.min(LANES));
    }
}

#[inline(always)]
fn enter(space: &Box32, flights: &mut Flights, meets: &mut Each<u32>, count: usize) {
    let size = space.size;
    for i in 0..count {
        let (mut first, mut last) = (0.0_f32, flights.to_plane_mm[i]);
        for axis in 0..3 {
            let (at, inverse) = (flights.position[axis][i], flights.inverse[axis][i]);
            let (a, b) = (-at * inverse, (size[axis] - at) * inverse);
            first = greatest(first, least(a, b));
            last = least(last, greatest(a, b));
        }
        let met = first < last;
        let way = if met { first } else { 0.0 };
        for axis in 0..3 {
            let at = flights.position[axis][i] + flights.slope[axis][i] * way;
            // The largest number below the far wall still lies in the box.
            let within = least(greatest(at, 0.0), size[axis] * (1.0 - 1.2e-7));
            flights.position[axis][i] = if met { within } else { at };
        }
        flights.to_plane_mm[i] -= way;
        meets[i] = u32::from(met);
    }
}
