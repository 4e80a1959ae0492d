//! Walks along a ray from cell to cell of a lattice.

use crate::phantom::lattice::Ray;

/// Whether a walk continues.
pub(crate) type Step = std::ops::ControlFlow<()>;

/// Lengths along a path are counted in integers of this many mm: they add and compare faster than floating-point numbers.
const MM: f64 = 1.0 / (1_u64 << 32) as f64;

/// Walks from cell to cell of a lattice between two lengths on a ray, until `visit` ends it (Amanatides and Woo, Eurographics 1987).
#[inline(always)]
pub(super) fn walk(
    ray: &Ray,
    size: [usize; 3],
    enter: f64,
    end: f64,
    mut visit: impl FnMut(usize, f64, f64) -> Step,
) -> Step {
    if enter >= end {
        return Step::Continue(());
    }
    let mut cross = [i64::MAX; 3];
    let mut pitch = [0_i64; 3];
    let mut stride = [0_isize; 3];
    let (mut index, mut layer) = (0_isize, 1_isize);
    for axis in 0..3 {
        let (origin, slope) = (ray.origin[axis], ray.slope[axis]);
        let cells = size[axis];
        let cell = ((origin + slope * enter).max(0.0) as usize).min(cells - 1);
        index += cell as isize * layer;
        if slope != 0.0 {
            let inverse = 1.0 / slope;
            let face = (cell + usize::from(slope > 0.0)) as f64;
            cross[axis] = fixed((face - origin) * inverse);
            pitch[axis] = fixed(inverse.abs());
            stride[axis] = if slope > 0.0 { layer } else { -layer };
        }
        layer *= cells as isize;
    }
    let [mut x, mut y, mut z] = cross;
    let end = fixed(end);
    let mut at = fixed(enter);
    loop {
        let (first_x, first_y) = (x <= y && x <= z, y < x && y <= z);
        let next = x.min(y).min(z);
        let to = next.min(end).max(at);
        // Rounding may lead slightly out of the lattice at its far side.
        if index < 0 || index >= layer {
            return Step::Continue(());
        }
        visit(index as usize, at as f64 * MM, to as f64 * MM)?;
        if next >= end {
            return Step::Continue(());
        }
        at = to;
        let first_z = !(first_x | first_y);
        x += if first_x { pitch[0] } else { 0 };
        y += if first_y { pitch[1] } else { 0 };
        z += if first_z { pitch[2] } else { 0 };
        index += if first_x {
            stride[0]
        } else if first_y {
            stride[1]
        } else {
            stride[2]
        };
    }
}

/// Converts a length to counts; lengths beyond any phantom stay so without overflow.
#[inline(always)]
fn fixed(mm: f64) -> i64 {
    ((mm * (1.0 / MM)) as i64).min(i64::MAX / 4)
}
