//! Gauss quadrature of the spectrum between absorption edges, with as few energies as the accuracy requires.
//!
//! Golub and Welsch, Math. Comp. 23 (1969) 221; docs/physics.md, "Fast engine", primary.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::beam::spectral_lines::SpectralLines;
use crate::engine::exposure::Exposure;

/// Accuracy of a quadrature over a spectrum.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Accuracy {
    /// Largest number of energies between two absorption edges.
    pub most: usize,
    /// Largest relative error of energy and squared energy behind any thickness if there are fewer energies than [`Accuracy::most`].
    pub tolerance: f64,
}

/// Energies of the quadrature over the spectrum; the errors are then 3e-5 of the primary behind any thickness, and 1e-3 of the scatter.
pub(crate) const PRIMARY_ENERGIES: Accuracy = Accuracy {
    most: 12,
    tolerance: 1e-5,
};
pub(crate) const SCATTER_ENERGIES: Accuracy = Accuracy {
    most: 8,
    tolerance: 3e-4,
};

/// Thicknesses at which errors are evaluated: attenuation exponents at the mean energy of the spectrum.
const EXPONENTS: [f64; 7] = [0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Energies between the absorption edges of phantom and detector, the same for every spectrum of the source.
///
/// Integrals of smooth functions over a spectrum of 110 bins do not need 110 energies: the Gauss quadrature of the
/// spectrum with n energies is exact for polynomials of degree 2n − 1 in 1/E (Golub and Welsch, Math. Comp.
/// 23 (1969) 221). An absorption edge is not smooth, so the spectrum is cut there. The energies are those of the mean of all
/// spectra; the weights of a single one, which differs little, are exact for polynomials of degree n − 1 times the mean.
/// A piece of the spectrum with few photons or a narrow range of energies needs few of them.
pub(crate) fn compressed(exposure: &Exposure, accuracy: Accuracy) -> SpectralLines {
    let transport = &exposure.transport;
    let mut edges: Vec<f64> = transport
        .tables
        .phantom
        .materials()
        .iter()
        .flat_map(|material| material.edges_kev())
        .chain(exposure.response.edges_kev())
        .collect();
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    gauss(&transport.emitter.lines(), &edges, accuracy)
}

/// Energies between neighbouring `edges_kev`, in ascending order.
fn gauss(lines: &SpectralLines, edges_kev: &[f64], accuracy: Accuracy) -> SpectralLines {
    let transmission = Transmission::new(lines);
    let allowed = transmission
        .of(lines)
        .map(|whole| accuracy.tolerance * whole);
    let mut chosen = SpectralLines {
        energy_kev: Vec::new(),
        weights: vec![Vec::new(); lines.weights.len()],
    };
    let mut first = 0;
    for edge in edges_kev.iter().copied().chain([f64::INFINITY]) {
        let end = lines.energy_kev.partition_point(|&energy| energy < edge);
        let piece = SpectralLines {
            energy_kev: lines.energy_kev[first..end].to_vec(),
            weights: lines
                .weights
                .iter()
                .map(|w| w[first..end].to_vec())
                .collect(),
        };
        let exact = transmission.of(&piece);
        let is_accurate = |few: &SpectralLines| {
            let errors = transmission.of(few).into_iter().zip(exact);
            let mut errors = errors.map(|(few, exact)| (few - exact).abs()).zip(allowed);
            errors.all(|(error, allowed)| error <= allowed)
        };
        let few = (1..accuracy.most)
            .map(|nodes| smooth_piece(&piece, nodes))
            .find(is_accurate)
            .unwrap_or_else(|| smooth_piece(&piece, accuracy.most));
        chosen.energy_kev.extend(few.energy_kev);
        for (all, piece) in chosen.weights.iter_mut().zip(few.weights) {
            all.extend(piece);
        }
        first = end;
    }
    chosen
}

/// Energy and squared energy of the mean of all spectra behind absorbers of all [`EXPONENTS`].
///
/// Between edges attenuation is approximately a constant plus a multiple of 1/E³; the constant cancels in relative errors.
struct Transmission {
    mean_kev: f64,
}

impl Transmission {
    fn new(lines: &SpectralLines) -> Self {
        let (mut photons, mut energy) = (f64::MIN_POSITIVE, 0.0);
        for (line, &kev) in lines.energy_kev.iter().enumerate() {
            photons += total(lines, line);
            energy += total(lines, line) * kev;
        }
        Self {
            mean_kev: energy / photons,
        }
    }

    fn of(&self, lines: &SpectralLines) -> [f64; 2 * EXPONENTS.len()] {
        let mut sums = [0.0; 2 * EXPONENTS.len()];
        for (line, &kev) in lines.energy_kev.iter().enumerate() {
            let relative = (self.mean_kev / kev).powi(3);
            for (sums, exponent) in sums.chunks_exact_mut(2).zip(EXPONENTS) {
                let photons = total(lines, line) * (-exponent * relative).exp();
                sums[0] += photons * kev;
                sums[1] += photons * kev * kev;
            }
        }
        sums
    }
}

/// Photons of a line in all spectra.
fn total(lines: &SpectralLines, line: usize) -> f64 {
    lines.weights.iter().map(|weights| weights[line]).sum()
}

/// The quadrature of one smooth piece.
fn smooth_piece(lines: &SpectralLines, nodes: usize) -> SpectralLines {
    let n = lines.energy_kev.len();
    if n <= nodes {
        return lines.clone();
    }
    let root = DVector::from_fn(n, |line, _| total(lines, line).sqrt());
    let norm = root.norm();
    // Lanczos on diag(1/E) from the square roots of the weights gives the Jacobi matrix of the measure; full
    // orthogonalisation keeps it exact. Each vector is an orthonormal polynomial of 1/E times those roots.
    let x = DVector::from_fn(n, |line, _| 1.0 / lines.energy_kev[line]);
    let mut basis = vec![&root / norm];
    let mut jacobi = DMatrix::zeros(nodes, nodes);
    for k in 0..nodes {
        let mut next = x.component_mul(&basis[k]);
        jacobi[(k, k)] = next.dot(&basis[k]);
        if k + 1 == nodes {
            break;
        }
        for _ in 0..2 {
            for vector in &basis {
                let overlap = next.dot(vector);
                next.axpy(-overlap, vector, 1.0);
            }
        }
        let norm = next.norm();
        jacobi[(k, k + 1)] = norm;
        jacobi[(k + 1, k)] = norm;
        basis.push(next / norm);
    }
    let eigen = SymmetricEigen::new(jacobi);
    let mut order: Vec<usize> = (0..nodes).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    // An eigenvector contains the polynomials at its energy times the square root of the weight there; it must reproduce the sums of
    // the polynomials over a spectrum.
    let weights = lines.weights.iter().map(|weights| {
        let moments: Vec<f64> = basis
            .iter()
            .map(|vector| {
                let terms = (0..n).filter(|&line| root[line] > 0.0);
                terms
                    .map(|line| weights[line] * vector[line] / root[line])
                    .sum::<f64>()
                    * norm
            })
            .collect();
        let at = |k: usize| -> f64 {
            let vector = eigen.eigenvectors.column(k);
            vector[0] * vector.iter().zip(&moments).map(|(v, m)| v * m).sum::<f64>()
        };
        order.iter().map(|&k| at(k)).collect()
    });
    SpectralLines {
        weights: weights.collect(),
        energy_kev: order.iter().map(|&k| 1.0 / eigen.eigenvalues[k]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::spectrum::Spectrum;
    use crate::beam::tube::TubeSpec;
    use crate::matter::material::Material;

    fn lines(spectra: &[Spectrum]) -> SpectralLines {
        let bins = |spectrum: &Spectrum| spectrum.bins().filter(|bin| bin.0 >= 5.0).unzip();
        let all: Vec<(Vec<f64>, Vec<f64>)> = spectra.iter().map(bins).collect();
        assert!(all.iter().all(|one| one.0 == all[0].0), "the same bins");
        SpectralLines {
            energy_kev: all[0].0.clone(),
            weights: all.into_iter().map(|one| one.1).collect(),
        }
    }

    /// Sum of photons times a power of their energy behind `cm` of a material.
    fn behind(lines: &SpectralLines, of: &Material, cm: f64, spectrum: usize, power: i32) -> f64 {
        let nodes = lines.energy_kev.iter().zip(&lines.weights[spectrum]);
        nodes
            .map(|(&energy, photons)| {
                let mu = of.total_cm2_g(energy).unwrap() * of.density_g_cm3();
                photons * energy.powi(power) * (-mu * cm).exp()
            })
            .sum()
    }

    /// Energy and squared energy behind water, bone and copper, from the anode side to the opposite side: the same 12 energies for
    /// 100 bins of three spectra.
    #[test]
    fn a_dozen_energies_stand_for_all_spectra_of_a_source() {
        let spectra = [4.0, 8.0, 20.0].map(|anode_angle_deg| {
            let filters = vec!["Al:2.5".parse().unwrap()];
            let tube = TubeSpec {
                kvp: 100.0,
                anode_angle_deg,
                filters,
            };
            Spectrum::tungsten(&tube).unwrap()
        });
        let exact = lines(&spectra);
        let few = gauss(
            &exact,
            &[],
            Accuracy {
                most: 12,
                tolerance: 0.0,
            },
        );
        assert_eq!(few.energy_kev.len(), 12);
        for (name, cm) in [("water", 25.0), ("bone_cortical", 5.0), ("copper", 0.1)] {
            let material = Material::named(name).unwrap();
            for spectrum in 0..spectra.len() {
                for power in [1, 2] {
                    let [few, exact] =
                        [&few, &exact].map(|of| behind(of, &material, cm, spectrum, power));
                    let error = few / exact - 1.0;
                    println!("{name} {spectrum} {power}: {error:e}");
                    assert!(error.abs() < 2e-4, "{name}, spectrum {spectrum}: {error:e}");
                }
            }
        }
    }

    /// The edges of lead, caesium and iodine divide the spectrum of 100 kVp into seven pieces. Fewer than half of the possible 84 energies
    /// are accurate to 1.4e-4 in energy and squared energy behind water and bone, twice the tolerance of each piece.
    #[test]
    fn quadrature_uses_few_energies_within_its_tolerance() {
        let filters = vec!["Al:2.5".parse().unwrap()];
        let tube = TubeSpec {
            kvp: 100.0,
            anode_angle_deg: 12.0,
            filters,
        };
        let exact = lines(&[Spectrum::tungsten(&tube).unwrap()]);
        let edges = [13.04, 15.2, 15.86, 33.17, 35.98, 88.0];
        let accuracy = Accuracy {
            most: 12,
            tolerance: 1e-5,
        };
        let few = gauss(&exact, &edges, accuracy);
        println!("{} energies", few.energy_kev.len());
        assert!(few.energy_kev.len() < 40, "{:?}", few.energy_kev);
        for (name, cm) in [("water", 25.0), ("water", 2.0), ("bone_cortical", 3.0)] {
            let material = Material::named(name).unwrap();
            for power in [1, 2] {
                let [few, exact] = [&few, &exact].map(|of| behind(of, &material, cm, 0, power));
                let error = few / exact - 1.0;
                assert!(
                    error.abs() < 1.4e-4,
                    "{cm} cm of {name}, power {power}: {error:e}"
                );
            }
        }
    }

    #[test]
    fn an_absorption_edge_cuts_the_spectrum() {
        let even = SpectralLines {
            energy_kev: (0..100).map(|i| 20.0 + f64::from(i)).collect(),
            weights: vec![vec![1.0; 100]],
        };
        let accuracy = Accuracy {
            most: 6,
            tolerance: 0.0,
        };
        let cut = gauss(&even, &[69.5], accuracy);
        assert_eq!(cut.energy_kev.len(), 12);
        let below: f64 = cut.weights[0][..6].iter().sum();
        assert!(
            (below - 50.0).abs() < 1e-9 && cut.energy_kev[5] < 69.5 && cut.energy_kev[6] > 69.5
        );
    }
}
