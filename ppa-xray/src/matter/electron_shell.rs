//! Electron shells and the momentum distribution of their electrons.

/// mₑc in atomic units of momentum: the inverse fine-structure constant (CODATA 2018).
pub(crate) const ATOMIC_MOMENTA_PER_MC: f64 = 137.035_999_084;

/// Electrons that share a binding energy and a Compton profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    /// Number of electrons, in any unit common to the shells of a material.
    pub electrons: f64,
    /// Binding energy in keV; 0 for conduction electrons.
    pub binding_kev: f64,
    /// One-electron Compton profile J(0) in atomic units.
    pub profile_at_zero: f64,
}

impl Shell {
    /// Share of the shell's electrons whose momentum along the scattering vector is at most `p`, in atomic units.
    ///
    /// Integral of the one-electron profile J(p) = J₀ (1 + 2 J₀|p|) exp(½ − (1 + 2 J₀|p|)²/2) (Brusa et al. 1996,
    /// doi:10.1016/0168-9002(96)00652-3).
    pub(crate) fn electrons_below(&self, p: f64) -> f64 {
        let reach = 1.0 + 2.0 * self.profile_at_zero * p.abs();
        let beyond = 0.5 * (0.5 - 0.5 * reach * reach).exp();
        if p < 0.0 { beyond } else { 1.0 - beyond }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_electrons_move_against_the_scattering_vector() {
        let shell = Shell {
            electrons: 2.0,
            binding_kev: 0.5,
            profile_at_zero: 0.113,
        };
        assert_eq!(shell.electrons_below(0.0), 0.5);
        assert!(shell.electrons_below(-60.0) < 1e-12 && shell.electrons_below(60.0) > 1.0 - 1e-12);
        // The slope at rest is J(0).
        let slope = (shell.electrons_below(1e-5) - shell.electrons_below(-1e-5)) / 2e-5;
        assert!((slope / shell.profile_at_zero - 1.0).abs() < 1e-6);
    }
}
