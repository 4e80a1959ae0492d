//! Layers are public: writers check that each still has a value per pixel.

use crate::image::presentation::PresentationError;
use crate::image::radiograph::Radiograph;
use crate::transport::tally::Category;

impl Radiograph {
    /// # Errors
    /// [`PresentationError::Pixels`] where a layer does not have one value and one standard error per pixel.
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
