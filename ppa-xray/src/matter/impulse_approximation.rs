//! Compton scattering off bound, moving electrons: the impulse approximation.
//!
//! dσ/dΩ = ½ rₑ² τ² (τ + 1/τ − sin²θ) Σ f Θ(E − U) n(p_max). At a given angle the electron's momentum p along the scattering
//! vector follows its one-electron profile up to p_max, the limit at which it is just freed; p gives the energy (Ribberfors and Berggren
//! 1982, doi:10.1103/PhysRevA.26.3325; Brusa et al. 1996, doi:10.1016/0168-9002(96)00652-3, as in PENELOPE and MC-GPU).
//! Momenta are in units of mₑc.

use crate::matter::{
    cross_sections::ELECTRON_REST_KEV,
    electron_shell::{ATOMIC_MOMENTA_PER_MC, Shell},
    klein_nishina::KleinNishina,
    natural_log::{exp, ln},
};

/// Consecutive rejections after which the shells are weighted individually at a given angle.
const TRIALS: u32 = 8;

/// Consecutive rejections after which the electron counts as free and at rest. User tables may contain shells that are almost
/// always rejected, and the loop must end. The embedded elements need a few.
const PATIENCE: u32 = 1000;

/// Momentum beyond which the correction factor of the differential cross-section stays constant, as in PENELOPE.
const LARGEST_CORRECTED: f32 = 0.2;

/// Smallest share of the electrons that is resolved in the tail of a profile.
const SMALLEST_TAIL: f32 = 1e-30;

/// Sampler of Compton scattering in one material.
#[derive(Clone, Debug)]
pub(crate) struct ImpulseApproximation {
    angles: &'static KleinNishina,
    /// Walker's alias table over the shells by electron number: the share `keep` of entry i stays with shell i.
    entries: Vec<Entry>,
    /// Share of the electrons in each shell.
    shells: Vec<(f32, BoundElectron)>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    keep: f32,
    /// The shell of this entry, and the shell that fills it up.
    shells: [BoundElectron; 2],
}

/// An electron of a shell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundElectron {
    pub(crate) binding_kev: f32,
    /// 1/(2 J₀).
    pub(crate) momentum: f32,
}

/// Returned by [`BoundElectron::outcome`] instead of an energy: the electron cannot be freed.
const NOT_FREED: f32 = -1.0;

/// The electron could be freed, but the correction factor of the cross section rejects its momentum.
const TURNED_DOWN: f32 = 0.0;

impl ImpulseApproximation {
    pub(crate) fn new(shells: &[Shell]) -> Self {
        let electrons: f64 = shells.iter().map(|shell| shell.electrons).sum();
        let share = |shell: &Shell| shell.electrons / electrons * shells.len() as f64;
        let bound = |shell: &Shell| BoundElectron {
            binding_kev: shell.binding_kev as f32,
            momentum: (0.5 / shell.profile_at_zero / ATOMIC_MOMENTA_PER_MC) as f32,
        };
        let mut shares: Vec<f64> = shells.iter().map(share).collect();
        let mut entries: Vec<Entry> = shells
            .iter()
            .map(|shell| Entry {
                keep: 1.0,
                shells: [bound(shell); 2],
            })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..shells.len()).partition(|&i| shares[i] < 1.0);
        while let (Some(poor), Some(&rich)) = (small.pop(), large.last()) {
            entries[poor].keep = shares[poor] as f32;
            entries[poor].shells[1] = bound(&shells[rich]);
            shares[rich] -= 1.0 - shares[poor];
            if shares[rich] < 1.0 {
                small.extend(large.pop());
            }
        }
        Self {
            angles: KleinNishina::table(),
            entries,
            shells: shells
                .iter()
                .map(|shell| ((shell.electrons / electrons) as f32, bound(shell)))
                .collect(),
        }
    }

    /// Samples sin²(θ/2) and the energy of the scattered photon in keV.
    ///
    /// Samples the angle from Klein–Nishina, the shell by its electrons, and the momentum from the full profile, and repeats all three if
    /// the electron cannot be freed. This gives the product with Σ f n(p_max) without computing it.
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f32, mut uniform: impl FnMut() -> f32) -> (f32, f32) {
        for _ in 0..PATIENCE {
            let (sin2_half_theta, electron) = self.attempt(energy_kev, uniform(), uniform());
            let scattered = electron.outcome(energy_kev, sin2_half_theta, uniform(), uniform());
            if scattered > TURNED_DOWN {
                return (sin2_half_theta, scattered);
            }
            if scattered == TURNED_DOWN {
                return (
                    sin2_half_theta,
                    self.sample_energy(energy_kev, sin2_half_theta, uniform),
                );
            }
        }
        let sin2_half_theta = self.angles.half_angle_squared(energy_kev, uniform());
        (sin2_half_theta, off_resting(energy_kev, sin2_half_theta))
    }

    /// Samples sin²(θ/2) of Klein–Nishina and an electron, whether or not the photon can free it at that angle.
    #[inline(always)]
    pub(crate) fn attempt(
        &self,
        energy_kev: f32,
        u_angle: f32,
        u_shell: f32,
    ) -> (f32, BoundElectron) {
        let sin2_half_theta = self.angles.half_angle_squared(energy_kev, u_angle);
        (sin2_half_theta, self.electron(u_shell))
    }

    /// Samples the energy of a photon scattered by a given angle.
    pub(crate) fn sample_energy(
        &self,
        energy_kev: f32,
        sin2_half_theta: f32,
        mut uniform: impl FnMut() -> f32,
    ) -> f32 {
        if sin2_half_theta == 0.0 {
            return energy_kev; // straight on no electron can be freed
        }
        for trial in 0..PATIENCE {
            let scattered = if trial < TRIALS {
                let electron = self.electron(uniform());
                electron.outcome(energy_kev, sin2_half_theta, uniform(), uniform())
            } else {
                let Some((electron, share)) =
                    self.electron_freed(energy_kev, sin2_half_theta, uniform())
                else {
                    break;
                };
                electron.outcome(energy_kev, sin2_half_theta, uniform() * share, uniform())
            };
            if scattered > TURNED_DOWN {
                return scattered;
            }
        }
        off_resting(energy_kev, sin2_half_theta)
    }

    /// Samples an electron of a shell by f n(p_max), and returns n(p_max): for angles so small that hardly any electron can be freed.
    fn electron_freed(
        &self,
        energy_kev: f32,
        sin2_half_theta: f32,
        u: f32,
    ) -> Option<(BoundElectron, f32)> {
        let freed = |electron: &BoundElectron| electron.share_freed(energy_kev, sin2_half_theta);
        let all: f32 = self.shells.iter().map(|(f, e)| f * freed(e)).sum();
        let mut left = u * all;
        self.shells.iter().find_map(|(f, electron)| {
            let share = freed(electron);
            left -= f * share;
            (left < 0.0).then_some((*electron, share))
        })
    }

    /// Samples an electron of a shell by its number of electrons.
    #[inline(always)]
    fn electron(&self, u: f32) -> BoundElectron {
        let at = u * self.entries.len() as f32;
        let index = (at as usize).min(self.entries.len() - 1);
        let entry = &self.entries[index];
        entry.shells[usize::from(at - index as f32 > entry.keep)]
    }
}

impl BoundElectron {
    /// p_max = a/√b: a = E (E − U)(1 − cos θ)/mc² − U and b = 2 E (E − U)(1 − cos θ) + U².
    #[inline(always)]
    fn limit(&self, energy_kev: f32, sin2_half_theta: f32) -> (f32, f32) {
        let binding = self.binding_kev;
        let transfer = 4.0 * energy_kev * (energy_kev - binding) * sin2_half_theta;
        (
            transfer * (0.5 / ELECTRON_REST_KEV) as f32 - binding,
            transfer + binding * binding,
        )
    }

    /// n(p_max): share of the electrons of this shell that the photon can free.
    fn share_freed(&self, energy_kev: f32, sin2_half_theta: f32) -> f32 {
        let (limit, squared) = self.limit(energy_kev, sin2_half_theta);
        if self.binding_kev >= energy_kev || squared == 0.0 {
            return 0.0;
        }
        let reach = 1.0 + limit.abs() / squared.sqrt() / self.momentum;
        let beyond = 0.5 * exp(0.5 - 0.5 * reach * reach);
        if limit < 0.0 { beyond } else { 1.0 - beyond }
    }

    /// Energy of the photon scattered by this electron at the cumulative probability `u_momentum` of its profile; or
    /// [`NOT_FREED`] if p > p_max, or [`TURNED_DOWN`] by the factor F(p) = 1 + a p. The arithmetic has no branches.
    ///
    /// If the electron could be freed at both +p and −p, F selects the sign instead of rejecting: the two F add up to 2.
    #[inline(always)]
    pub(crate) fn outcome(
        &self,
        energy_kev: f32,
        sin2_half_theta: f32,
        u_momentum: f32,
        u_sign: f32,
    ) -> f32 {
        // Share of the profile beyond ±p: exp(½ (1 − (1 + 2 J₀|p|)²)).
        let tail = 2.0 * u_momentum.min(1.0 - u_momentum);
        let reach = (1.0 - 2.0 * ln(tail.max(SMALLEST_TAIL))).sqrt();
        let size = self.momentum * (reach - 1.0);
        let t = size * size;
        // −|p| ≤ p_max or |p| ≤ p_max, without computing the roots.
        let (limit, squared) = self.limit(energy_kev, sin2_half_theta);
        let (beyond, below) = (t * squared >= limit * limit, t * squared <= limit * limit);
        let either_way = (limit >= 0.0) & below;
        let backwards = (u_momentum < 0.5) & ((limit >= 0.0) | beyond);
        let freed = (either_way | backwards) & (size < 1.0) & (self.binding_kev < energy_kev);
        // With D = E/E_C and κ = E/mc²: (D q_C/E)² = (D − 1)² + 4 D s, s = sin²(θ/2), and
        // a = (q_C/E)(1 + τ (τ − cos θ) E²/q_C²) = ((D q_C/E)² + 2 s (D − κ)) / (D² q_C/E) ≥ 0.
        let kappa = energy_kev * (1.0 / ELECTRON_REST_KEV) as f32;
        let d = 1.0 + 2.0 * kappa * sin2_half_theta;
        let vector = (d - 1.0) * (d - 1.0) + 4.0 * d * sin2_half_theta;
        let slope = (vector + 2.0 * sin2_half_theta * (d - kappa)) * size.min(LARGEST_CORRECTED);
        let xi = if either_way {
            2.0 * u_sign - 1.0
        } else {
            u_sign
        };
        let below_slope = xi * d * vector.sqrt() < slope;
        let p = if either_way & below_slope {
            size
        } else {
            -size
        };
        // Root of the quadratic for E′ at given p, with the cancelling terms collected.
        let sin_squared = 4.0 * sin2_half_theta * (1.0 - sin2_half_theta);
        let shift = p * (vector - t * sin_squared).max(0.0).sqrt();
        let scattered = energy_kev * (d - t * (1.0 - 2.0 * sin2_half_theta) + shift) / (d * d - t);
        if !freed {
            NOT_FREED
        } else if below_slope & !either_way {
            TURNED_DOWN
        } else {
            scattered
        }
    }
}

/// E′ for an electron at rest.
#[inline(always)]
pub(crate) fn off_resting(energy_kev: f32, sin2_half_theta: f32) -> f32 {
    energy_kev / (1.0 + energy_kev * sin2_half_theta * (2.0 / ELECTRON_REST_KEV) as f32)
}

/// Σ f Θ(E − U) n(p_max), the number of electrons that contribute at an angle.
pub(crate) fn electrons_freed(shells: &[Shell], energy_kev: f64, sin2_half_theta: f64) -> f64 {
    shells
        .iter()
        .filter(|shell| shell.binding_kev < energy_kev)
        .map(|shell| {
            let transfer = 4.0 * energy_kev * (energy_kev - shell.binding_kev) * sin2_half_theta;
            let limit = 0.5 * transfer / ELECTRON_REST_KEV - shell.binding_kev;
            let size = (transfer + shell.binding_kev * shell.binding_kev).sqrt();
            if size == 0.0 {
                return 0.5 * shell.electrons; // a free electron hit in passing
            }
            shell.electrons * shell.electrons_below(limit / size * ATOMIC_MOMENTA_PER_MC)
        })
        .sum()
}
