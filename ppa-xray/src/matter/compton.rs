//! Compton scattering by one of two models.

use serde::{Deserialize, Serialize};

use crate::{
    matter::impulse_approximation::{ImpulseApproximation, off_resting},
    matter::incoherent_function::IncoherentFunction,
    matter::material::Material,
    octaves::Octaves,
};

/// Model of Compton scattering off electrons. Both models use the tabulated total cross section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ComptonModel {
    /// Binding and Doppler broadening shell by shell, from one-electron Compton profiles, as PENELOPE and MC-GPU do.
    #[default]
    ImpulseApproximation,
    /// Klein–Nishina times the incoherent scattering function S(q); the energy is that of a free electron at rest.
    IncoherentFunction,
}

/// Sampler of Compton scattering in one material.
#[derive(Clone, Debug)]
pub(crate) enum Compton {
    ImpulseApproximation(ImpulseApproximation),
    IncoherentFunction(IncoherentFunction),
}

impl Compton {
    pub(crate) fn new(material: &Material, model: ComptonModel, q_squared: Octaves) -> Self {
        match model {
            ComptonModel::ImpulseApproximation => {
                Self::ImpulseApproximation(ImpulseApproximation::new(&material.shells()))
            }
            ComptonModel::IncoherentFunction => {
                Self::IncoherentFunction(IncoherentFunction::new(material, q_squared))
            }
        }
    }

    /// Samples the energy in keV of a photon scattered by sin²(θ/2) = `sin2_half_theta`.
    #[inline]
    pub(crate) fn sample_energy(
        &self,
        energy_kev: f32,
        sin2_half_theta: f32,
        uniform: impl FnMut() -> f32,
    ) -> f32 {
        match self {
            Self::ImpulseApproximation(impulse) => {
                impulse.sample_energy(energy_kev, sin2_half_theta, uniform)
            }
            Self::IncoherentFunction(_) => off_resting(energy_kev, sin2_half_theta),
        }
    }

    /// Samples sin²(θ/2) and the energy of the scattered photon in keV.
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f32, uniform: impl FnMut() -> f32) -> (f32, f32) {
        match self {
            Self::ImpulseApproximation(impulse) => impulse.sample(energy_kev, uniform),
            Self::IncoherentFunction(function) => function.sample(energy_kev, uniform),
        }
    }
}
