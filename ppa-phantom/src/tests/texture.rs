//! Spongy bone: spectrum, spacing and directions of its texture, and its density.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector3};

use super::LIMB;
use crate::lower_leg::{CALCANEUS, TALUS, TIBIA};
use crate::parameters::{P01, Parameters};
use crate::texture::Texture;
use crate::trabeculae::{Trabeculae, volume_fraction};
use crate::*;

const SPONGY: [(&str, usize); 3] = [("talus", TALUS), ("calcaneus", CALCANEUS), ("tibia", TIBIA)];

fn trabeculae(bone: usize) -> &'static Trabeculae {
    &LIMB.skeleton.bones()[bone].filling.trabeculae
}

/// The field around the middle of a bone, whose first axis runs across the trabeculae and whose last runs along them.
fn field(texture: &Texture, bone: usize, q_mm: [f64; 3], voxel_mm: f64) -> f64 {
    let trabeculae = trabeculae(bone);
    let scale = trabeculae.width(1.0);
    let place = Point3::from(Vector3::from_fn(|axis, _| q_mm[axis] * scale[axis]));
    texture.at(&place, trabeculae.width(voxel_mm))
}

/// Exponent of the radially averaged power spectrum of a square image between two frequencies in waves per mm.
fn exponent(image: &[f64], n: usize, pixel_mm: f64, [low, high]: [f64; 2]) -> f64 {
    let mean = image.iter().sum::<f64>() / image.len() as f64;
    let window = |i: usize| (PI * (i as f64 + 0.5) / n as f64).sin().powi(2);
    let step = 1.0 / (n as f64 * pixel_mm);
    let most = (high / step) as i32;
    let wave = |f: i32, i: usize| (TAU * f64::from(f) * i as f64 / n as f64).sin_cos();
    // Rows first: one sum per row and horizontal frequency.
    let rows: Vec<Vec<[f64; 2]>> = (0..n)
        .map(|j| {
            let row = |f: i32| {
                (0..n).fold([0.0; 2], |[re, im], i| {
                    let value = (image[j * n + i] - mean) * window(i) * window(j);
                    let (sine, cosine) = wave(f, i);
                    [re + value * cosine, im - value * sine]
                })
            };
            (-most..=most).map(row).collect()
        })
        .collect();
    let bins = ((high / low).ln() / 0.2) as usize;
    let mut rings = vec![(0.0, 0.0); bins];
    for v in 0..=most {
        for u in -most..=most {
            let [re, im] = (0..n).fold([0.0; 2], |[re, im], j| {
                let [a, b] = rows[j][(u + most) as usize];
                let (sine, cosine) = wave(v, j);
                [re + a * cosine + b * sine, im + b * cosine - a * sine]
            });
            let frequency = f64::from(u).hypot(f64::from(v)) * step;
            let bin = (frequency / low).ln() / (high / low).ln() * bins as f64;
            if (0.0..bins as f64).contains(&bin) {
                let (power, count) = &mut rings[bin as usize];
                *power += re * re + im * im;
                *count += 1.0;
            }
        }
    }
    let points: Vec<[f64; 2]> = (0..bins)
        .map(|bin| {
            let (power, count) = rings[bin];
            [
                (bin as f64 + 0.5) / bins as f64 * (high / low).ln(),
                (power / count).ln(),
            ]
        })
        .collect();
    let mean = |axis: usize| points.iter().map(|p| p[axis]).sum::<f64>() / bins as f64;
    let [x, y] = [mean(0), mean(1)];
    let product: f64 = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    -product / points.iter().map(|p| (p[0] - x).powi(2)).sum::<f64>()
}

/// For a block of 32 x 12 x 32 mm. The exponents of seeds vary by 0.18, so that the mean of four is accurate to 0.09.
#[test]
fn projected_texture_falls_by_a_power_of_2_6_to_3() {
    const N: usize = 128;
    const PIXEL_MM: f64 = 0.25;
    for (name, bone) in SPONGY {
        let exponents: Vec<f64> = (0..4)
            .map(|seed| {
                let texture = Texture::new(seed);
                let project = |n: usize| {
                    let [x, z] = [n % N, n / N].map(|i| PIXEL_MM * i as f64);
                    (0..48)
                        .map(|j| field(&texture, bone, [x, PIXEL_MM * f64::from(j), z], PIXEL_MM))
                        .sum()
                };
                let image: Vec<f64> = (0..N * N).map(project).collect();
                exponent(&image, N, PIXEL_MM, [0.2, 1.2])
            })
            .collect();
        let mean = exponents.iter().sum::<f64>() / 4.0;
        println!("{name}: {mean:.2} of {exponents:.2?}");
        assert!((2.6..3.0).contains(&mean), "{name}: {exponents:?}");
    }
}

/// Along a line of 4 m across the trabeculae, sampled 20 times per trabecula: one maximum for each. Along the trabeculae, crossings of
/// the mean are fewer by the anisotropy.
#[test]
fn trabeculae_are_as_far_apart_as_stated() {
    for (name, bone) in SPONGY {
        let distance_mm = trabeculae(bone).distance_mm();
        let texture = Texture::new(3);
        let along = |axis: usize| -> Vec<f64> {
            let step = distance_mm / 20.0;
            let at = |n: u32| {
                let mut q = [0.3, 0.7, 0.1];
                q[axis] += step * f64::from(n);
                field(&texture, bone, q, 0.0)
            };
            (0..100_000).map(at).collect()
        };
        let [across, lengthwise] = [along(0), along(2)];
        let maxima = |w: &&[f64]| w[0] < w[1] && w[1] >= w[2];
        let maxima = across.windows(3).filter(maxima).count() as f64;
        println!("{name}: {:.3} maxima per trabecula", maxima / 5000.0);
        // 5000 maxima, whose number varies less than that of independent ones.
        assert!((maxima / 5000.0 - 1.0).abs() < 0.05, "{name}: {maxima}");
        let crossings = |values: &[f64]| {
            let crossing = |w: &&[f64]| (w[0] < 0.0) != (w[1] < 0.0);
            values.windows(2).filter(crossing).count() as f64
        };
        let ratio = crossings(&across) / crossings(&lengthwise);
        let [width, _, length] = trabeculae(bone).width(1.0);
        println!("{name}: anisotropy {ratio:.2}");
        assert!(
            (ratio / (width / length) - 1.0).abs() < 0.08,
            "{name}: {ratio}"
        );
    }
}

/// P01 without texture and with one of this seed.
fn p01(texture_seed: u64, trabecular_texture_hu: f64) -> LowerLeg {
    let parameters = Parameters {
        texture_seed,
        trabecular_texture_hu,
        ..P01
    };
    LowerLeg::new(parameters, Side::Right)
}

/// Voxels of a box in the spongy bone of the distal tibia.
fn metaphysis(leg: &LowerLeg, half_mm: f64, voxel_mm: f64) -> Vec<f64> {
    let middle = leg.mortise_point(0.0, 0.0, 18.0);
    // The first voxel is centred on the corner: voxels of any size tile the same box.
    let half = Vector3::repeat(half_mm - 0.5 * voxel_mm);
    let more = Vector3::repeat(1e-6);
    let ct = leg.voxelise_box(
        [middle - half, middle + half + more],
        voxel_mm,
        TableTop::Absent,
    );
    ct.unwrap().hu().iter().map(|hu| f64::from(*hu)).collect()
}

/// Means over 4³ voxels of 0.25 mm vary like voxels of 1 mm and agree with them except for detail finer than a voxel.
#[test]
fn coarse_voxels_show_the_mean_of_fine_ones() {
    let (leg, even) = (p01(5, 45.0), p01(5, 0.0));
    let texture = |voxel_mm: f64| -> Vec<f64> {
        let pairs = metaphysis(&leg, 6.0, voxel_mm);
        pairs
            .iter()
            .zip(metaphysis(&even, 6.0, voxel_mm))
            .map(|(a, b)| a - b)
            .collect()
    };
    let (fine, coarse) = (texture(0.25), texture(1.0));
    assert_eq!((fine.len(), coarse.len()), (48 * 48 * 48, 12 * 12 * 12));
    let mut means = vec![0.0; coarse.len()];
    for (n, value) in fine.iter().enumerate() {
        let [i, j, k] = [n % 48, n / 48 % 48, n / (48 * 48)].map(|v| v / 4);
        means[i + 12 * (j + 12 * k)] += value / 64.0;
    }
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let [of_means, of_coarse] = [product(&means, &means), product(&coarse, &coarse)];
    let ratio = (of_means / of_coarse).sqrt();
    let alike = product(&means, &coarse) / (of_means * of_coarse).sqrt();
    println!("deviation {ratio:.3}, correlation {alike:.3}");
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    assert!(alike > 0.85, "{alike}");
}

/// In every bone, with the texture of several seeds, and with volume fractions in assumed ranges: calcaneus 0.13 to 0.2.
#[test]
fn texture_leaves_the_mean_density_of_spongy_bone() {
    let even = p01(0, 0.0).voxelise(2.0, TableTop::Absent).unwrap();
    let names = LIMB.bone_names();
    let labels = LIMB.bone_labels(even.grid());
    let textured: Vec<_> = (1..5)
        .map(|seed| p01(seed, 45.0).voxelise(2.0, TableTop::Absent).unwrap())
        .collect();
    for (name, bone) in SPONGY {
        assert_eq!(names[bone], name);
        // Two centimetres of the tibia above the joint; only voxels away from cortex and marrow.
        let inside: Vec<usize> = (0..labels.len())
            .filter(|n| usize::from(labels[*n]) == bone + 1)
            .filter(|n| {
                let centre = even.grid().centre(even.grid().voxel(*n).map(|v| v as f64));
                let p = LIMB.limb_point(&centre);
                LIMB.skeleton.distance(bone, &p) < -6.0 && p.z < 22.0
            })
            .collect();
        let mean = |hu: &[f32]| {
            inside.iter().map(|n| f64::from(hu[*n])).sum::<f64>() / inside.len() as f64
        };
        let expected = mean(&even.hu());
        let found: Vec<f64> = textured
            .iter()
            .map(|ct| mean(&ct.hu()) - expected)
            .collect();
        println!(
            "{name}: {expected:.1} HU in {} voxels, {found:.1?}",
            inside.len()
        );
        // The coarse octaves shift the mean of a bone by 6 HU: three standard errors of four seeds.
        let shift = found.iter().sum::<f64>() / 4.0;
        assert!(shift.abs() < 9.0, "{name}: {found:?}");
    }
    let fractions = [380.0, 230.0, 280.0].map(volume_fraction);
    let ranges = [0.2..0.3, 0.13..0.2, 0.13..0.2];
    for ((name, _), (fraction, range)) in SPONGY.into_iter().zip(fractions.into_iter().zip(ranges))
    {
        assert!(range.contains(&fraction), "{name}: {fraction}");
    }
}
