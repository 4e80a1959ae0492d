//! Numbers of the vertices on the edges of the lattice.

/// Kind of a vertex, in the two highest bits of its number: crossings of edges, voxels that equal the iso
/// value and are vertices themselves, and extra vertices inside cells are numbered separately, so that the
/// numbers of the crossings of a slice are known before the cells below it are filled.
pub const AT_VOXEL: u32 = 1 << KIND_SHIFT;
pub const EXTRA: u32 = 2 << KIND_SHIFT;
pub const KIND_SHIFT: u32 = 30;

/// Vertex numbers on the crossed edges along one axis in a slice or between two, row by row.
#[derive(Default)]
pub struct Numbers {
    ids: Vec<u32>,
    /// Start of each row; one entry more than there are rows.
    starts: Vec<usize>,
}

impl Numbers {
    pub fn clear(&mut self) {
        self.ids.clear();
        self.starts.clear();
        self.starts.push(0);
    }

    pub fn push(&mut self, id: u32) {
        self.ids.push(id);
    }

    pub fn end_row(&mut self) {
        self.starts.push(self.ids.len());
    }

    /// Numbers of the edges from row j, in the order of x.
    pub fn row(&self, j: usize) -> &[u32] {
        &self.ids[self.starts[j]..self.starts[j + 1]]
    }
}

/// Vertex numbers of one slice.
#[derive(Default)]
pub struct Slice {
    /// Voxels that are vertices because they equal the iso value, ascending, with their numbers.
    pub at_voxel: Vec<(u32, u32)>,
    /// Numbers on edges along x and y.
    pub along: [Numbers; 2],
}

impl Slice {
    /// The number of a voxel that equals the iso value and has an outside neighbour.
    pub fn number_at(&self, voxel: usize) -> u32 {
        let later = (self.at_voxel).partition_point(|&(at, _)| at <= voxel as u32);
        self.at_voxel[later - 1].1
    }
}
