//! Air kerma at the entrance of a prepared phantom, without following photons.

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::dose::air_kerma::entrance_gy_per_history;
use crate::engine::prepared_phantom::PreparedPhantom;
use crate::transport::tracking::{Transport, TransportError};

impl PreparedPhantom<'_> {
    /// Incident air kerma (without backscatter) where the central ray enters the patient, Gy per history; equal to
    /// [`Dose::entrance_air_kerma_gy_per_history`](crate::Dose). Multiply by [`Radiograph::histories`](crate::Radiograph) for the exposure.
    ///
    /// `None` if the central ray meets nothing denser than 0.3 g/cm³, or is blocked by the collimator.
    ///
    /// # Errors
    /// [`TransportError`] if the geometry or the spectrum is invalid.
    pub fn entrance_air_kerma_gy_per_history(
        &self,
        spectrum: &Spectrum,
        projection: &Projection,
    ) -> Result<Option<f64>, TransportError> {
        projection.validate()?;
        let tables = self.tables().transport.clone();
        let transport = Transport::new(tables, spectrum, projection)?;
        Ok(entrance_gy_per_history(&transport))
    }
}
