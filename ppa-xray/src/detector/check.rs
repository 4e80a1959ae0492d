//! Whether a receptor can be simulated, without simulating it.

use crate::beam::detector::Detector;
use crate::beam::receptor::{Receptor, ReceptorError};
use crate::detector::readout::Readout;
use crate::detector::response::Response;

impl Receptor {
    /// Checks the receptor on a detector, as both engines do before they begin.
    ///
    /// # Errors
    /// [`ReceptorError`] naming the number, curve or material at fault.
    pub fn check(&self, detector: &Detector) -> Result<(), ReceptorError> {
        Readout::new(self, detector)?;
        Response::new(self, detector.centre_mm).map(drop)
    }
}
