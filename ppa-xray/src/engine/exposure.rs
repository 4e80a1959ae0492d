//! Data of one exposure that both engines need: transport, response of the detector, readout.

use std::borrow::Cow;
use std::sync::Arc;

use crate::beam::projection::Projection;
use crate::beam::projection_error::ProjectionError;
use crate::beam::spectrum::Spectrum;
use crate::detector::readout::Readout;
use crate::detector::response::Response;
use crate::image::memory;
use crate::matter::compton::ComptonModel;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::phantom_tables::PhantomTables;
use crate::transport::tracking::{Transport, TransportError};

/// Transport through the phantom to the detector plane, and the response of the detector to photons.
pub(crate) struct Exposure<'a> {
    pub transport: Transport<'a>,
    pub response: Response,
    pub readout: Readout,
}

impl<'a> Exposure<'a> {
    /// # Errors
    /// [`TransportError`] if geometry, receptor or spectrum are invalid, or if the image does not fit into memory.
    pub fn new(
        phantom: &'a VoxelPhantom,
        spectrum: &'a Spectrum,
        projection: &'a Projection,
        compton_model: ComptonModel,
    ) -> Result<Self, TransportError> {
        let tables = PhantomTables::new(Arc::new(Cow::Borrowed(phantom)), compton_model);
        Self::with_tables(Arc::new(tables), spectrum, projection)
    }

    /// The same as [`Exposure::new`], with tables shared by several exposures.
    pub fn with_tables(
        tables: Arc<PhantomTables<'a>>,
        spectrum: &'a Spectrum,
        projection: &'a Projection,
    ) -> Result<Self, TransportError> {
        projection.validate()?;
        memory::check(&projection.detector)?;
        let (receptor, detector) = (&projection.receptor, &projection.detector);
        Ok(Self {
            response: Response::new(receptor, detector.centre_mm).map_err(ProjectionError::from)?,
            readout: Readout::new(receptor, detector).map_err(ProjectionError::from)?,
            transport: Transport::new(tables, spectrum, projection)?,
        })
    }

    /// The same photons and response with another detector in the same plane, with the same centre.
    pub fn with_projection<'b>(&'b self, projection: &'b Projection) -> Exposure<'b> {
        Exposure {
            transport: self.transport.with_projection(projection),
            response: self.response.clone(),
            readout: self.readout.clone(),
        }
    }

    /// The same exposure with extrafocal photons only, and their share of the histories.
    pub fn of_extrafocal(&self) -> Option<(Self, f64)> {
        let (transport, share) = self.transport.of_extrafocal()?;
        let alone = Self {
            transport,
            response: self.response.clone(),
            readout: self.readout.clone(),
        };
        Some((alone, share))
    }
}
