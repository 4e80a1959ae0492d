//! Distances on the voxel lattice.

use rayon::prelude::*;

/// Far enough from everything: larger than any squared distance in a scan, small enough to add.
const FAR_MM2: f32 = 1e12;

/// Squared distance in mm² from each voxel to the nearest voxel with `target`, and which one that
/// is (`u32::MAX` when there is none).
///
/// Exact on a lattice of orthogonal axes: lower envelopes of parabolas, one axis after the other
/// (Felzenszwalb and Huttenlocher 2012, doi:10.4086/toc.2012.v008a019).
pub fn nearest(size: [usize; 3], spacing_mm: [f64; 3], target: &[bool]) -> (Vec<f32>, Vec<u32>) {
    let [nx, ny, nz] = size;
    let mut squared: Vec<f32> = target
        .iter()
        .map(|&t| if t { 0.0 } else { FAR_MM2 })
        .collect();
    let mut source: Vec<u32> = (0..target.len() as u32)
        .map(|at| if target[at as usize] { at } else { u32::MAX })
        .collect();
    squared
        .par_chunks_mut(nx)
        .zip(source.par_chunks_mut(nx))
        .for_each_init(Envelope::default, |envelope, (squared, source)| {
            envelope.sweep(squared, source, spacing_mm[0]);
        });
    squared
        .par_chunks_mut(nx * ny)
        .zip(source.par_chunks_mut(nx * ny))
        .for_each_init(Envelope::default, |envelope, (squared, source)| {
            for i in 0..nx {
                envelope.sweep_strided(squared, source, i, nx, ny, spacing_mm[1]);
            }
        });
    // Columns along z are scattered in memory: they are gathered by rows of y into contiguous ones.
    let rows: Vec<(Vec<f32>, Vec<u32>)> = (0..ny)
        .into_par_iter()
        .map_init(Envelope::default, |envelope, j| {
            let gather = |i: usize, k: usize| i + nx * (j + ny * k);
            let mut row = (vec![0.0; nx * nz], vec![0; nx * nz]);
            for k in 0..nz {
                for i in 0..nx {
                    row.0[i * nz + k] = squared[gather(i, k)];
                    row.1[i * nz + k] = source[gather(i, k)];
                }
            }
            for i in 0..nx {
                let column = i * nz..(i + 1) * nz;
                envelope.sweep(
                    &mut row.0[column.clone()],
                    &mut row.1[column],
                    spacing_mm[2],
                );
            }
            row
        })
        .collect();
    squared
        .par_chunks_mut(nx)
        .zip(source.par_chunks_mut(nx))
        .enumerate()
        .for_each(|(at, (squared, source))| {
            let (j, k) = (at % ny, at / ny);
            for i in 0..nx {
                squared[i] = rows[j].0[i * nz + k];
                source[i] = rows[j].1[i * nz + k];
            }
        });
    (squared, source)
}

/// Working memory for one line of voxels.
#[derive(Default)]
struct Envelope {
    values: Vec<f32>,
    sources: Vec<u32>,
    apex: Vec<usize>,
    from: Vec<f64>,
}

impl Envelope {
    fn sweep_strided(
        &mut self,
        squared: &mut [f32],
        source: &mut [u32],
        first: usize,
        stride: usize,
        count: usize,
        step_mm: f64,
    ) {
        let mut values: Vec<f32> = (0..count).map(|n| squared[first + n * stride]).collect();
        let mut sources: Vec<u32> = (0..count).map(|n| source[first + n * stride]).collect();
        self.sweep(&mut values, &mut sources, step_mm);
        for n in 0..count {
            squared[first + n * stride] = values[n];
            source[first + n * stride] = sources[n];
        }
    }

    fn sweep(&mut self, squared: &mut [f32], source: &mut [u32], step_mm: f64) {
        self.values.clear();
        self.values.extend_from_slice(squared);
        self.sources.clear();
        self.sources.extend_from_slice(source);
        self.apex.clear();
        self.from.clear();
        let weight = step_mm * step_mm;
        let height = |at: usize| f64::from(squared[at]) / weight + (at * at) as f64;
        for at in (0..squared.len()).filter(|&at| squared[at] < FAR_MM2) {
            let mut begins = f64::NEG_INFINITY;
            while let (Some(&last), Some(&start)) = (self.apex.last(), self.from.last()) {
                let meets = (height(at) - height(last)) / (2.0 * (at - last) as f64);
                if meets > start {
                    begins = meets;
                    break;
                }
                self.apex.pop();
                self.from.pop();
            }
            self.apex.push(at);
            self.from.push(begins);
        }
        if self.apex.is_empty() {
            return;
        }
        let mut parabola = 0;
        for at in 0..squared.len() {
            while parabola + 1 < self.apex.len() && self.from[parabola + 1] < at as f64 {
                parabola += 1;
            }
            let apex = self.apex[parabola];
            let steps = at as f64 - apex as f64;
            squared[at] = self.values[apex] + (weight * steps * steps) as f32;
            source[at] = self.sources[apex];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn agrees_with_looking_at_every_target(
            size in prop::array::uniform3(1..7_usize),
            spacing in prop::array::uniform3(0.5..3.0_f64),
            seeds in prop::collection::vec(any::<prop::sample::Index>(), 1..6),
        ) {
            let count: usize = size.iter().product();
            let mut target = vec![false; count];
            seeds.iter().for_each(|s| target[s.index(count)] = true);
            let (squared, source) = nearest(size, spacing, &target);
            let voxel = |at: usize| [at % size[0], at / size[0] % size[1], at / size[0] / size[1]];
            let between = |a: usize, b: usize| -> f64 {
                (0..3).map(|x| ((voxel(a)[x] as f64 - voxel(b)[x] as f64) * spacing[x]).powi(2)).sum()
            };
            for at in 0..count {
                let best = (0..count).filter(|&t| target[t]).map(|t| between(at, t)).fold(f64::MAX, f64::min);
                prop_assert!((f64::from(squared[at]) - best).abs() < 1e-4 * (1.0 + best));
                prop_assert!(target[source[at] as usize]);
                prop_assert!((between(at, source[at] as usize) - best).abs() < 1e-4 * (1.0 + best));
            }
        }
    }
}
