//! Check that each layer has one value per pixel. Layers are public, so writers need it.

use crate::image::presentation::PresentationError;
use crate::image::radiograph::Radiograph;
use crate::transport::tally::Category;

impl Radiograph {
    /// # Errors
    /// [`PresentationError::Pixels`] if a layer does not have one value and one standard error per pixel.
    pub(crate) fn check_layers(&self) -> Result<(), PresentationError> {
        let expected = self.detector.pixels();
        let names = Category::ALL.map(Category::name).into_iter();
        for (name, layer) in names.chain(["electronic"]).zip(self.planes()) {
            for found in [layer.value.len(), layer.sigma.len()] {
                if found != expected {
                    return Err(PresentationError::Pixels {
                        layer: name,
                        found,
                        expected,
                    });
                }
            }
        }
        Ok(())
    }
}
