//! Voxels connected by faces.

/// Voxels that can be reached from `starts` through `free` voxels.
pub(super) fn flooded(
    size: [usize; 3],
    starts: impl Iterator<Item = usize>,
    free: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let mut reached = vec![false; size.iter().product()];
    let mut front: Vec<usize> = starts.filter(|&at| free(at)).collect();
    front.iter().for_each(|&at| reached[at] = true);
    while let Some(at) = front.pop() {
        for near in neighbours(size, at) {
            if !reached[near] && free(near) {
                reached[near] = true;
                front.push(near);
            }
        }
    }
    reached
}

/// The voxels that share a face with a voxel.
pub(super) fn neighbours(size: [usize; 3], at: usize) -> impl Iterator<Item = usize> {
    let [nx, ny, nz] = size;
    let strides = [1, nx, nx * ny];
    let place = [at % nx, at / nx % ny, at / (nx * ny)];
    let last = [nx - 1, ny - 1, nz - 1];
    (0..3).flat_map(move |axis| {
        let below = (place[axis] > 0).then(|| at - strides[axis]);
        let above = (place[axis] < last[axis]).then(|| at + strides[axis]);
        below.into_iter().chain(above)
    })
}
