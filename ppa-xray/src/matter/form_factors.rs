//! Choice of form factors for coherent scattering.

use serde::{Deserialize, Serialize};

/// Form factors of Rayleigh scattering.
///
/// Written in snake case in plans: `"independent_atoms"`, `"molecular"`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FormFactors {
    /// Those of free atoms, as in MC-GPU and in the codes of AAPM Report 195.
    #[default]
    IndependentAtoms,
    /// Measured ones, with the interference of neighbouring molecules, for materials that have them: water, muscle, fat,
    /// blood, breast and PMMA (Peplow and Verghese, Phys. Med. Biol. 43 (1998) 2431), and for their share in a mixture.
    /// Free atoms for the rest.
    Molecular,
}
