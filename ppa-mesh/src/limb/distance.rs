//! Distances on the voxel lattice.

use rayon::prelude::*;

/// Far enough from everything: larger than any squared distance in a scan, small enough to add.
pub const FAR_MM2: f32 = 1e12;
/// Rows of columns along z that are gathered at a time, so that working memory stays small.
const STRIPE: usize = 16;

/// Squared distance in mm² from each voxel to the nearest one with `target`.
pub fn squared_distances(
    size: [usize; 3],
    spacing_mm: [f64; 3],
    target: impl Fn(usize) -> bool + Sync,
) -> Vec<f32> {
    let count: usize = size.iter().product();
    let mut squared: Vec<f32> = (0..count)
        .into_par_iter()
        .map(|at| if target(at) { 0.0 } else { FAR_MM2 })
        .collect();
    spread(size, spacing_mm, &mut squared, &mut vec![(); count], None);
    squared
}

/// From voxels with 0 in `squared` ([`FAR_MM2`] elsewhere), carries the squared distance in mm² and
/// the nearest such voxel's value to all others; beyond `limit_sq` the distance stays far and the
/// value has no meaning.
///
/// Exact on a lattice of orthogonal axes: lower envelopes of parabolas, one axis after the other
/// (Felzenszwalb and Huttenlocher 2012, doi:10.4086/toc.2012.v008a019).
pub fn spread<T: Copy + Default + Send + Sync>(
    size: [usize; 3],
    spacing_mm: [f64; 3],
    squared: &mut [f32],
    value: &mut [T],
    limit_sq: Option<f32>,
) {
    let [nx, ny, nz] = size;
    let sweep = |axis: usize| Sweep {
        weight: spacing_mm[axis] * spacing_mm[axis],
        limit_sq: limit_sq.unwrap_or(FAR_MM2),
        count: size[axis],
    };
    squared
        .par_chunks_mut(nx * ny)
        .zip(value.par_chunks_mut(nx * ny))
        .for_each_init(Envelope::default, |envelope, (squared, value)| {
            let rows = squared.chunks_mut(nx).zip(value.chunks_mut(nx));
            rows.for_each(|(squared, value)| sweep(0).line(envelope, squared, value));
            let mut columns = Columns::new(nx, ny);
            for j in 0..ny {
                let row = j * nx..(j + 1) * nx;
                columns.gather(j, &squared[row.clone()], &value[row]);
            }
            if columns.sweep(&sweep(1), envelope) {
                for j in 0..ny {
                    let row = j * nx..(j + 1) * nx;
                    columns.scatter(j, &mut squared[row.clone()], &mut value[row]);
                }
            }
        });
    for first in (0..ny).step_by(STRIPE) {
        let stripe = first..(first + STRIPE).min(ny);
        let swept: Vec<Option<Columns<T>>> = stripe
            .clone()
            .into_par_iter()
            .map_init(Envelope::default, |envelope, j| {
                let mut columns = Columns::new(nx, nz);
                for k in 0..nz {
                    let start = nx * (j + ny * k);
                    columns.gather(k, &squared[start..start + nx], &value[start..start + nx]);
                }
                columns.sweep(&sweep(2), envelope).then_some(columns)
            })
            .collect();
        squared
            .par_chunks_mut(nx * ny)
            .zip(value.par_chunks_mut(nx * ny))
            .enumerate()
            .for_each(|(k, (squared, value))| {
                for (j, columns) in stripe.clone().zip(&swept) {
                    if let Some(columns) = columns {
                        let row = j * nx..(j + 1) * nx;
                        columns.scatter(k, &mut squared[row.clone()], &mut value[row]);
                    }
                }
            });
    }
}

/// Columns of voxels across the rows of x, each contiguous.
struct Columns<T> {
    squared: Vec<f32>,
    value: Vec<T>,
    length: usize,
}

impl<T: Copy + Default> Columns<T> {
    fn new(count: usize, length: usize) -> Self {
        Self {
            squared: vec![0.0; count * length],
            value: vec![T::default(); count * length],
            length,
        }
    }

    fn gather(&mut self, place: usize, squared: &[f32], value: &[T]) {
        for (i, (&squared, &value)) in squared.iter().zip(value).enumerate() {
            self.squared[i * self.length + place] = squared;
            self.value[i * self.length + place] = value;
        }
    }

    /// Whether anything may have changed.
    fn sweep(&mut self, sweep: &Sweep, envelope: &mut Envelope<T>) -> bool {
        if self.squared.iter().all(|&s| s == 0.0) || self.squared.iter().all(|&s| s >= FAR_MM2) {
            return false;
        }
        let columns = self.squared.chunks_mut(self.length);
        columns
            .zip(self.value.chunks_mut(self.length))
            .for_each(|(squared, value)| sweep.line(envelope, squared, value));
        true
    }

    fn scatter(&self, place: usize, squared: &mut [f32], value: &mut [T]) {
        for (i, (squared, value)) in squared.iter_mut().zip(value).enumerate() {
            *squared = self.squared[i * self.length + place];
            *value = self.value[i * self.length + place];
        }
    }
}

/// Parameters of the pass along one axis.
struct Sweep {
    /// Squared spacing, mm².
    weight: f64,
    limit_sq: f32,
    count: usize,
}

/// Working memory for one line of voxels: parabolas by their apex, and where each begins to be lowest.
#[derive(Default)]
struct Envelope<T> {
    parabolas: Vec<(usize, f32, T)>,
    from: Vec<f64>,
}

impl Sweep {
    /// Targets separate a line: each stretch between two of them is processed by itself.
    fn line<T: Copy>(&self, envelope: &mut Envelope<T>, squared: &mut [f32], value: &mut [T]) {
        let mut at = 0;
        while at < self.count {
            if squared[at] == 0.0 {
                at += 1;
                continue;
            }
            let first = at.saturating_sub(1);
            while at < self.count && squared[at] != 0.0 {
                at += 1;
            }
            let last = (at + 1).min(self.count);
            self.stretch(envelope, &mut squared[first..last], &mut value[first..last]);
        }
    }

    fn stretch<T: Copy>(&self, envelope: &mut Envelope<T>, squared: &mut [f32], value: &mut [T]) {
        let (parabolas, from) = (&mut envelope.parabolas, &mut envelope.from);
        parabolas.clear();
        from.clear();
        for at in (0..squared.len()).filter(|&at| squared[at] < FAR_MM2) {
            let mut begins = f64::NEG_INFINITY;
            while let (Some(&(last, height, _)), Some(&start)) = (parabolas.last(), from.last()) {
                let rise = f64::from(squared[at]) - f64::from(height);
                let steps = (at - last) as f64;
                let meets = 0.5 * ((at + last) as f64 + rise / (self.weight * steps));
                if meets > start {
                    begins = meets;
                    break;
                }
                parabolas.pop();
                from.pop();
            }
            parabolas.push((at, squared[at], value[at]));
            from.push(begins);
        }
        if parabolas.is_empty() {
            return;
        }
        let mut lowest = 0;
        for at in 0..squared.len() {
            while lowest + 1 < from.len() && from[lowest + 1] < at as f64 {
                lowest += 1;
            }
            let (apex, height, carried) = parabolas[lowest];
            let steps = at as f64 - apex as f64;
            let here = height + (self.weight * steps * steps) as f32;
            squared[at] = if here > self.limit_sq { FAR_MM2 } else { here };
            value[at] = carried;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn agrees_with_looking_at_every_target(
            size in prop::array::uniform3(1..7_usize),
            spacing in prop::array::uniform3(0.5..3.0_f64),
            seeds in prop::collection::vec(any::<prop::sample::Index>(), 1..6),
            limit_sq in prop::option::of(1.0..30.0_f32),
        ) {
            let count: usize = size.iter().product();
            let mut squared = vec![FAR_MM2; count];
            seeds.iter().for_each(|s| squared[s.index(count)] = 0.0);
            let target: Vec<bool> = squared.iter().map(|&s| s == 0.0).collect();
            let mut source: Vec<usize> = (0..count).collect();
            spread(size, spacing, &mut squared, &mut source, limit_sq);
            let voxel = |at: usize| [at % size[0], at / size[0] % size[1], at / size[0] / size[1]];
            let between = |a: usize, b: usize| -> f64 {
                (0..3).map(|x| ((voxel(a)[x] as f64 - voxel(b)[x] as f64) * spacing[x]).powi(2)).sum()
            };
            for at in 0..count {
                let best = (0..count).filter(|&t| target[t]).map(|t| between(at, t)).fold(f64::MAX, f64::min);
                let near = 1e-4 * (1.0 + best);
                if limit_sq.is_some_and(|limit| best > f64::from(limit) + near) {
                    prop_assert_eq!(squared[at], FAR_MM2);
                } else if limit_sq.is_none_or(|limit| best < f64::from(limit) - near) {
                    prop_assert!((f64::from(squared[at]) - best).abs() < near);
                    prop_assert!(target[source[at]]);
                    prop_assert!((between(at, source[at]) - best).abs() < near);
                }
            }
        }
    }
}
