//! Tube load of an exposure: a number of mAs, or the result of automatic exposure control.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::engine::fast_settings::FastSettings;
use crate::engine::prepared_phantom::PreparedPhantom;
use crate::transport::tracking::TransportError;

/// Amount of radiation of an exposure.
///
/// In a file it is `{ mas = 4 }` or `{ exposure_index = 250 }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum TubeLoad {
    /// Tube current times exposure time, mAs.
    Mas(f64),
    /// Automatic exposure control: the load that gives this exposure index (IEC 62494-1), see
    /// [`Radiograph::exposure_index`](crate::Radiograph::exposure_index).
    ExposureIndex(f64),
}

impl TubeLoad {
    /// Allowed values; the noise of an image represents at most 1e18 histories.
    const RANGE: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

    /// # Errors
    /// [`TransportError::Setting`] for a number outside 1e-6 to 1e6.
    pub fn check(&self) -> Result<(), TransportError> {
        let (what, found) = match *self {
            Self::Mas(mas) => ("the tube load in mAs", mas),
            Self::ExposureIndex(index) => ("the exposure index of the tube load", index),
        };
        if Self::RANGE.contains(&found) {
            return Ok(());
        }
        Err(TransportError::Setting {
            what,
            found,
            expected: "1e-6 to 1e6",
        })
    }
}

impl PreparedPhantom<'_> {
    /// Number of histories of a tube load, for [`FastSettings::dose_histories`].
    ///
    /// For an exposure index it is computed from a [`preview`](PreparedPhantom::preview) without noise, which takes less than a tenth of
    /// the time of the image. The index of the image then differs from the requested one by less than 2 %, mostly because of pixel noise.
    ///
    /// # Errors
    /// The same as [`PreparedPhantom::fast`]; [`TransportError::TubeLoad`] if nothing reaches the receptor, or if the spectrum does not
    /// come from the tube model, the only source of photons per mAs.
    pub fn histories(
        &self,
        load: TubeLoad,
        spectrum: &Spectrum,
        projection: &Projection,
        settings: &FastSettings,
    ) -> Result<f64, TransportError> {
        load.check()?;
        match load {
            TubeLoad::Mas(mas) => {
                let per_mas = projection.photons_per_mas(spectrum)?;
                Ok(mas
                    * per_mas.ok_or(TransportError::TubeLoad {
                        why: "the spectrum does not specify the number of photons per mAs",
                    })?)
            }
            TubeLoad::ExposureIndex(index) => {
                let expected = FastSettings {
                    dose_histories: f64::INFINITY,
                    ..*settings
                };
                let go_on = |_| ControlFlow::Continue(());
                let preview = self.preview(spectrum, projection, &expected, &go_on)?;
                let per_history = preview
                    .exposure_index_per_history(&projection.receptor)
                    .map_err(|error| TransportError::Projection(error.into()))?;
                Ok(index
                    / per_history.ok_or(TransportError::TubeLoad {
                        why: "nothing reaches the receptor",
                    })?)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::small_limb;
    use crate::matter::compton::ComptonModel;

    #[test]
    fn automatic_exposure_meets_its_exposure_index() {
        let (phantom, spectrum, mut projection) = small_limb::exposure();
        projection.detector.pixel_mm = 0.6;
        projection.detector.columns = 200;
        projection.detector.rows = 200;
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::default());
        let mut settings = FastSettings {
            scatter_histories: 64_000,
            ..FastSettings::default()
        };
        for index in [50.0, 400.0] {
            let load = TubeLoad::ExposureIndex(index);
            settings.dose_histories = prepared
                .histories(load, &spectrum, &projection, &settings)
                .unwrap();
            let image = prepared.fast(&spectrum, &projection, &settings).unwrap();
            let found = image.exposure_index(&projection.receptor).unwrap().unwrap();
            assert!(
                (found / index - 1.0).abs() < 0.02,
                "{found}, asked for {index}"
            );
        }
    }

    #[test]
    fn a_tube_load_in_mas_is_that_of_the_image() {
        let (phantom, spectrum, projection) = small_limb::exposure();
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::default());
        let settings = FastSettings::default();
        let of = |load, spectrum| prepared.histories(load, spectrum, &projection, &settings);
        let histories = of(TubeLoad::Mas(4.0), &spectrum).unwrap();
        let per_mas = projection.photons_per_mas(&spectrum).unwrap().unwrap();
        assert!((histories / per_mas - 4.0).abs() < 1e-12);
        let line = Spectrum::monoenergetic(40.0).unwrap();
        let error = of(TubeLoad::Mas(4.0), &line).unwrap_err().to_string();
        assert!(error.contains("mAs"), "{error}");
        for load in [TubeLoad::Mas(0.0), TubeLoad::ExposureIndex(f64::NAN)] {
            let error = of(load, &spectrum).unwrap_err().to_string();
            assert!(error.contains("1e-6 to 1e6"), "{error}");
        }
    }
}
