//! Compton scattering off bound, moving electrons: the impulse approximation.
//!
//! dσ/dΩ = ½ rₑ² τ² (τ + 1/τ − sin²θ) Σ f Θ(E − U) n(p_max), and within an angle the electron's momentum p along the scattering
//! vector from its one-electron profile up to p_max, which frees it just so; p gives the energy (Ribberfors and Berggren 1982,
//! doi:10.1103/PhysRevA.26.3325; Brusa et al. 1996, doi:10.1016/0168-9002(96)00652-3, as in PENELOPE and MC-GPU).
//! Momenta are in units of mₑc.

use crate::matter::{
    cross_sections::ELECTRON_REST_KEV,
    electron_shell::{ATOMIC_MOMENTA_PER_MC, Shell},
    klein_nishina::KleinNishina,
    natural_log::{exp, ln},
};

/// Rejections in a row after which the shells are weighed one by one at a given angle.
const TRIALS: u32 = 8;

/// Rejections in a row after which the electron counts as free and at rest: tables of a user may hold shells that let
/// almost nothing through, and no photon may hang. The embedded elements need a few.
const PATIENCE: u32 = 1000;

/// Momentum beyond which the correction factor of the differential cross-section stays constant, as in PENELOPE.
const LARGEST_CORRECTED: f32 = 0.2;

/// Smallest share of the electrons that is told apart in the tail of a profile.
const SMALLEST_TAIL: f32 = 1e-30;

/// Sampler of Compton scattering in one material.
#[derive(Clone, Debug)]
pub(crate) struct ImpulseApproximation {
    angles: &'static KleinNishina,
    /// Walker's alias table over the shells by electron number: of entry i, `keep` stays with shell i.
    entries: Vec<Entry>,
    /// Share of the electrons in each shell.
    shells: Vec<(f32, BoundElectron)>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    keep: f32,
    here: BoundElectron,
    other: BoundElectron,
}

#[derive(Clone, Copy, Debug)]
struct BoundElectron {
    binding_kev: f32,
    /// 1/(2 J₀).
    momentum: f32,
}

/// An electron that a photon can free at its angle.
#[derive(Clone, Copy, Debug)]
struct Struck {
    /// |p| along the scattering vector.
    momentum: f32,
    /// Whether it could be freed moving either way; otherwise only with −p.
    either_way: bool,
}

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
                here: bound(shell),
                other: bound(shell),
            })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..shells.len()).partition(|&i| shares[i] < 1.0);
        while let (Some(poor), Some(&rich)) = (small.pop(), large.last()) {
            entries[poor].keep = shares[poor] as f32;
            entries[poor].other = bound(&shells[rich]);
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

    /// sin²(θ/2) and the energy of the scattered photon in keV.
    ///
    /// Angle from Klein–Nishina, shell by its electrons, momentum from the whole profile; all three again if that electron
    /// cannot be freed. This is the product with Σ f n(p_max) without computing it.
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f32, mut uniform: impl FnMut() -> f32) -> (f32, f32) {
        for _ in 0..PATIENCE {
            let half = self.angles.half_angle_squared(energy_kev, uniform());
            if let Some(struck) = self.strike(energy_kev, half, uniform(), uniform()) {
                let scattered = recoil(energy_kev, half, struck, uniform())
                    .unwrap_or_else(|| self.sample_energy(energy_kev, half, uniform));
                return (half, scattered);
            }
        }
        let half = self.angles.half_angle_squared(energy_kev, uniform());
        (half, off_resting(energy_kev, half))
    }

    /// Energy of a photon scattered by a given angle.
    pub(crate) fn sample_energy(
        &self,
        energy_kev: f32,
        half: f32,
        mut uniform: impl FnMut() -> f32,
    ) -> f32 {
        for trial in 0..PATIENCE {
            let struck = if trial < TRIALS {
                self.strike(energy_kev, half, uniform(), uniform())
            } else {
                self.strike_weighed(energy_kev, half, uniform(), uniform())
            };
            let scattered = struck.and_then(|struck| recoil(energy_kev, half, struck, uniform()));
            if let Some(scattered) = scattered {
                return scattered;
            }
        }
        off_resting(energy_kev, half)
    }

    /// An electron by the weights f n(p_max) of the shells, for angles so small that hardly one can be freed.
    fn strike_weighed(
        &self,
        energy_kev: f32,
        half: f32,
        u_shell: f32,
        u_momentum: f32,
    ) -> Option<Struck> {
        let freed = |electron: &BoundElectron| electron.share_freed(energy_kev, half);
        let all: f32 = self.shells.iter().map(|(f, e)| f * freed(e)).sum();
        let mut left = u_shell * all;
        let (_, electron) = self.shells.iter().find(|(f, electron)| {
            left -= f * freed(electron);
            left < 0.0
        })?;
        electron.struck(energy_kev, half, u_momentum * freed(electron))
    }

    /// An electron, if the photon can free it.
    #[inline(always)]
    fn strike(&self, energy_kev: f32, half: f32, u_shell: f32, u_momentum: f32) -> Option<Struck> {
        let at = u_shell * self.entries.len() as f32;
        let index = (at as usize).min(self.entries.len() - 1);
        let entry = &self.entries[index];
        let electron = if at - index as f32 <= entry.keep {
            entry.here
        } else {
            entry.other
        };
        electron.struck(energy_kev, half, u_momentum)
    }
}

impl BoundElectron {
    /// Numerator and denominator of p_max = (E (E − U)(1 − cos θ)/mc² − U) / √(2 E (E − U)(1 − cos θ) + U²).
    #[inline(always)]
    fn limit(&self, energy_kev: f32, half: f32) -> (f32, f32) {
        let binding = self.binding_kev;
        let transfer = 4.0 * energy_kev * (energy_kev - binding) * half;
        (
            transfer * (0.5 / ELECTRON_REST_KEV) as f32 - binding,
            (transfer + binding * binding).sqrt(),
        )
    }

    /// n(p_max): share of such electrons that the photon can free.
    fn share_freed(&self, energy_kev: f32, half: f32) -> f32 {
        let (limit, size) = self.limit(energy_kev, half);
        if self.binding_kev >= energy_kev || size == 0.0 {
            return 0.0;
        }
        let reach = 1.0 + (limit / size).abs() / self.momentum;
        let beyond = 0.5 * exp(0.5 - 0.5 * reach * reach);
        if limit < 0.0 { beyond } else { 1.0 - beyond }
    }

    /// This electron with momentum p at the cumulative probability `u` of its profile, if p ≤ p_max.
    #[inline(always)]
    fn struck(&self, energy_kev: f32, half: f32, u: f32) -> Option<Struck> {
        // Share of the profile beyond ±p: t = exp(½ (1 − (1 + 2 J₀|p|)²)).
        let against = u < 0.5;
        let tail = 2.0 * if against { u } else { 1.0 - u };
        let reach = (1.0 - 2.0 * ln(tail.max(SMALLEST_TAIL))).sqrt();
        let momentum = self.momentum * (reach - 1.0);
        let (limit, size) = self.limit(energy_kev, half);
        let either_way = momentum * size <= limit;
        let freed = either_way || (against && -momentum * size <= limit);
        (freed && momentum < 1.0 && self.binding_kev < energy_kev).then_some(Struck {
            momentum,
            either_way,
        })
    }
}

/// E′ of an electron at rest.
#[inline(always)]
pub(crate) fn off_resting(energy_kev: f32, half: f32) -> f32 {
    energy_kev / (1.0 + energy_kev * half * (2.0 / ELECTRON_REST_KEV) as f32)
}

/// Energy of the photon after it met `struck`, or nothing if the correction factor F(p) = 1 + a p turns it down.
///
/// Where both directions of motion are possible, F chooses between them instead of rejecting: their F add up to 2.
#[inline(always)]
fn recoil(energy_kev: f32, half: f32, struck: Struck, u: f32) -> Option<f32> {
    let tau = 1.0 / (1.0 + energy_kev * half * (2.0 / ELECTRON_REST_KEV) as f32);
    let cos = 1.0 - 2.0 * half;
    // q_C²/E² = 1 + τ² − 2τ cos θ, a = (q_C/E)(1 + τ(τ − cos θ) E²/q_C²) ≥ 0.
    let vector = ((1.0 - tau) * (1.0 - tau) + 4.0 * tau * half).max(f32::MIN_POSITIVE);
    let root = vector.sqrt();
    let a = root + tau * (tau - cos) / root;
    let slope = a * struck.momentum.min(LARGEST_CORRECTED);
    let p = if struck.either_way {
        if 2.0 * u < 1.0 + slope {
            struck.momentum
        } else {
            -struck.momentum
        }
    } else if u < slope {
        return None;
    } else {
        -struck.momentum
    };
    // Root of the quadratic for E′ at given p, its cancelling terms collected.
    let t = p * p;
    let sin_squared = 4.0 * half * (1.0 - half);
    let shift = p * (vector - t * tau * tau * sin_squared).max(0.0).sqrt();
    Some(energy_kev * tau * (1.0 - t * tau * cos + shift) / (1.0 - t * tau * tau))
}

/// Σ f Θ(E − U) n(p_max), the electrons that take part at an angle.
pub(crate) fn electrons_freed(shells: &[Shell], energy_kev: f64, half: f64) -> f64 {
    shells
        .iter()
        .filter(|shell| shell.binding_kev < energy_kev)
        .map(|shell| {
            let transfer = 4.0 * energy_kev * (energy_kev - shell.binding_kev) * half;
            let limit = 0.5 * transfer / ELECTRON_REST_KEV - shell.binding_kev;
            let size = (transfer + shell.binding_kev * shell.binding_kev).sqrt();
            if size == 0.0 {
                return 0.5 * shell.electrons; // a free electron hit in passing
            }
            shell.electrons * shell.electrons_below(limit / size * ATOMIC_MOMENTA_PER_MC)
        })
        .sum()
}
