//! A spectrum as a few energies.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::transport::tracking::Transport;

/// Energies in keV and how many photons each stands for.
///
/// Integrals of smooth functions over a spectrum of 110 bins need no 110 energies: the Gauss quadrature of the
/// spectrum with n energies is exact for polynomials of degree 2n − 1 in 1/E (Golub and Welsch, Math. Comp.
/// 23 (1969) 221). An absorption edge is not smooth: the spectrum is cut there.
#[derive(Debug, Clone)]
pub(crate) struct SpectralQuadrature {
    pub energy_kev: Vec<f64>,
    pub photons: Vec<f64>,
}

impl SpectralQuadrature {
    /// Every energy bin of every spectrum that the source has.
    pub fn exact(transport: &Transport) -> Vec<Self> {
        Self::of_spectra(transport, Self::of_lines)
    }

    /// At most `nodes` energies between two absorption edges of phantom or detector, for every spectrum that the source
    /// has.
    pub fn compressed(transport: &Transport, nodes: usize) -> Vec<Self> {
        let mut edges: Vec<f64> = transport
            .phantom
            .materials()
            .iter()
            .flat_map(|material| material.edges_kev())
            .chain(transport.response.edges_kev())
            .collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        Self::of_spectra(transport, |lines| Self::gauss(lines, &edges, nodes))
    }

    fn of_spectra(transport: &Transport, of: impl Fn(&[(f64, f64)]) -> Self) -> Vec<Self> {
        let lines = transport.emitter.lines();
        lines
            .weights
            .iter()
            .map(|weights| {
                let filled: Vec<(f64, f64)> = lines
                    .energy_kev
                    .iter()
                    .zip(weights)
                    .map(|(&energy_kev, &photons)| (energy_kev, photons))
                    .filter(|(_, photons)| *photons > 0.0)
                    .collect();
                of(&filled)
            })
            .collect()
    }

    /// All `lines` (energy in ascending order, photons) as they are.
    fn of_lines(lines: &[(f64, f64)]) -> Self {
        let (energy_kev, photons) = lines.iter().copied().unzip();
        Self {
            energy_kev,
            photons,
        }
    }

    /// At most `nodes` energies between two neighbouring `edges_kev`, in ascending order.
    fn gauss(lines: &[(f64, f64)], edges_kev: &[f64], nodes: usize) -> Self {
        let mut rest = lines;
        let mut chosen = Vec::new();
        for edge in edges_kev.iter().copied().chain([f64::INFINITY]) {
            let (below, above) = rest.split_at(rest.partition_point(|line| line.0 < edge));
            chosen.extend(gauss(below, nodes));
            rest = above;
        }
        Self::of_lines(&chosen)
    }
}

/// The quadrature of one smooth piece.
fn gauss(lines: &[(f64, f64)], nodes: usize) -> Vec<(f64, f64)> {
    if lines.len() <= nodes {
        return lines.to_vec();
    }
    let total: f64 = lines.iter().map(|line| line.1).sum();
    let n = lines.len();
    // Lanczos on diag(1/E) from the square roots of the weights gives the Jacobi matrix of the measure; full
    // orthogonalisation keeps it exact.
    let x = DVector::from_fn(n, |i, _| 1.0 / lines[i].0);
    let mut basis = vec![DVector::from_fn(n, |i, _| (lines[i].1 / total).sqrt())];
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
    let mut chosen: Vec<(f64, f64)> = (0..nodes)
        .map(|k| {
            let share = eigen.eigenvectors[(0, k)].powi(2);
            (1.0 / eigen.eigenvalues[k], total * share)
        })
        .collect();
    chosen.sort_by(|a, b| a.0.total_cmp(&b.0));
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::spectrum::Spectrum;
    use crate::beam::tube::TubeSpec;
    use crate::matter::material::Material;

    /// Energy and squared energy behind water, bone and copper: 12 energies for 100 bins.
    #[test]
    fn a_dozen_energies_stand_for_a_spectrum() {
        let spectrum = Spectrum::tungsten(&TubeSpec {
            kvp: 100.0,
            anode_angle_deg: 12.0,
            filters: vec!["Al:2.5".parse().unwrap()],
        })
        .unwrap();
        let lines: Vec<(f64, f64)> = spectrum.bins().filter(|bin| bin.0 >= 5.0).collect();
        let exact = SpectralQuadrature::of_lines(&lines);
        let few = SpectralQuadrature::gauss(&lines, &[], 12);
        assert_eq!(few.energy_kev.len(), 12);
        for (name, cm) in [("water", 25.0), ("bone_cortical", 5.0), ("copper", 0.1)] {
            let material = Material::named(name).unwrap();
            let behind = |quadrature: &SpectralQuadrature, power: i32| -> f64 {
                let nodes = quadrature.energy_kev.iter().zip(&quadrature.photons);
                nodes
                    .map(|(&energy, photons)| {
                        let mu = material.total_cm2_g(energy).unwrap() * material.density_g_cm3();
                        photons * energy.powi(power) * (-mu * cm).exp()
                    })
                    .sum()
            };
            for power in [1, 2] {
                let error = behind(&few, power) / behind(&exact, power) - 1.0;
                assert!(error.abs() < 2e-4, "{name}: {error:e}");
            }
        }
    }

    #[test]
    fn an_absorption_edge_cuts_the_spectrum() {
        let lines: Vec<(f64, f64)> = (0..100).map(|i| (20.0 + f64::from(i), 1.0)).collect();
        let cut = SpectralQuadrature::gauss(&lines, &[69.5], 6);
        assert_eq!(cut.energy_kev.len(), 12);
        let below: f64 = cut.photons[..6].iter().sum();
        assert!(
            (below - 50.0).abs() < 1e-9 && cut.energy_kev[5] < 69.5 && cut.energy_kev[6] > 69.5
        );
    }
}
