//! Compton scattering of many photons off bound electrons, one attempt each.

use crate::isa::Kernel;
use crate::matter::impulse_approximation::BoundElectron;
use crate::transport::lanes::draws::unit;
use crate::transport::lanes::flights::{Each, LANES};
use crate::vector_math::least;

/// Attempts at Compton scattering in the impulse approximation.
#[derive(Debug)]
pub(super) struct Attempts {
    pub energy_kev: Each<f32>,
    /// sin²(θ/2).
    pub sin2_half_theta: Each<f32>,
    /// Binding energy of the struck electron; `momentum` is also that of the electron.
    pub binding_kev: Each<f32>,
    pub momentum: Each<f32>,
    /// Energy of the scattered photon, or a special value of [`BoundElectron::outcome`].
    pub scattered_kev: Each<f32>,
}

impl Attempts {
    pub fn new() -> Self {
        Self {
            energy_kev: [0.0; LANES],
            sin2_half_theta: [0.0; LANES],
            binding_kev: [0.0; LANES],
            momentum: [0.0; LANES],
            scattered_kev: [0.0; LANES],
        }
    }
}

/// Computes the energies of scattered photons.
pub(super) struct Attempt<'a> {
    pub attempts: &'a mut Attempts,
    /// Random words.
    pub momentum: &'a Each<u32>,
    pub sign_word: &'a Each<u32>,
    pub count: usize,
}

impl Kernel for Attempt<'_> {
    #[inline(always)]
    fn run(self) {
        attempt(
            self.attempts,
            self.momentum,
            self.sign_word,
            self.count.min(LANES),
        );
    }
}

#[inline(always)]
fn attempt(attempts: &mut Attempts, momentum: &Each<u32>, sign_word: &Each<u32>, count: usize) {
    for i in 0..count {
        let electron = BoundElectron {
            binding_kev: attempts.binding_kev[i],
            momentum: attempts.momentum[i],
        };
        let (energy_kev, sin2_half_theta) = (attempts.energy_kev[i], attempts.sin2_half_theta[i]);
        // Midpoints of steps of 2⁻²³: neither 0 nor 1, whose momentum would be infinite.
        let u = ((momentum[i] >> 9) as i32 as f32 + 0.5) * (1.0 / 8_388_608.0);
        let scattered = electron.outcome(energy_kev, sin2_half_theta, u, unit(sign_word[i]));
        attempts.scattered_kev[i] = least(scattered, energy_kev);
    }
}
