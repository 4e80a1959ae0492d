//! Checks a receptor without simulating it.

use crate::beam::detector::Detector;
use crate::beam::receptor::{Receptor, ReceptorError};
use crate::detector::readout::Readout;
use crate::detector::response::Response;

impl Receptor {
    /// Checks the receptor on a detector, as both engines do first.
    ///
    /// # Errors
    /// [`ReceptorError`] naming the invalid number, curve or material.
    pub fn check(&self, detector: &Detector) -> Result<(), ReceptorError> {
        Readout::new(self, detector)?;
        Response::new(self, detector.centre_mm).map(drop)
    }
}
