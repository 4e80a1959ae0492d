//! Photons from outside the focal spot.

use nalgebra::Point2;

use crate::beam::emitter::Emitter;
use crate::beam::projection::Projection;
use crate::beam::projection_error::ProjectionError;
use crate::beam::spectrum::Spectrum;

/// Extrafocal radiation of one exposure.
#[derive(Debug, Clone)]
pub(crate) struct ExtrafocalEmitter {
    /// Emits the photons, with the entire extrafocal area as its focal spot.
    pub emitter: Emitter,
    /// Share of the histories that are extrafocal: of all photons that pass the blades.
    pub share: f64,
    /// Photons per solid angle relative to those of the focal spot, where the blades cover neither.
    ratio: f64,
}

impl ExtrafocalEmitter {
    /// The extrafocal radiation of a projection, if any; `focal` emits the photons of its focal spot.
    ///
    /// # Errors
    /// The same as [`Emitter::new`].
    pub fn beside(
        focal: &Emitter,
        projection: &Projection,
        spectrum: &Spectrum,
    ) -> Result<Option<Self>, ProjectionError> {
        let Some(extrafocal) = projection.source.extrafocal else {
            return Ok(None);
        };
        let emitter = Emitter::of_spot(projection, spectrum, extrafocal.area())?;
        let photons = extrafocal.ratio * emitter.emitted_sr();
        Ok(Some(Self {
            share: photons / (focal.emitted_sr() + photons),
            ratio: extrafocal.ratio,
            emitter,
        }))
    }

    /// Histories per mAs: photons of the focal spot and of `beside`, if the spectrum came from the tube model.
    pub fn histories_per_mas(focal: &Emitter, beside: Option<&Self>) -> Option<f64> {
        let share = beside.map_or(0.0, |beside| beside.share);
        Some(focal.photons_per_mas()? / (1.0 - share))
    }

    /// Ratio of the fluence per history with the collimator fully open to that of the focal photons per focal history.
    pub fn open_over_focal(&self) -> f64 {
        (1.0 - self.share) * (1.0 + self.ratio)
    }

    /// The same as [`ExtrafocalEmitter::open_over_focal`], at `depth` of the way from the middle of the focal spot to a point of the
    /// detector plane, where the blades cover a part of the area.
    pub fn lit_over_focal(&self, at: Point2<f64>, depth: f64) -> f64 {
        const POINTS: usize = 32;
        let spots = self.emitter.spot_points(POINTS);
        let lit = spots.iter().filter(|spot| {
            // Intersection of the ray through that point with the detector plane.
            let end = at - spot.xy().coords * (1.0 / depth - 1.0);
            self.emitter.lights(spot, end)
        });
        let lit = lit.count() as f64 / spots.len() as f64;
        (1.0 - self.share) * (1.0 + self.ratio * lit)
    }
}

impl Projection {
    /// Histories per mAs: photons that the tube emits into the field, including extrafocal ones. `None` if `spectrum` does not come from
    /// the tube model, which is needed to know them.
    ///
    /// # Errors
    /// [`ProjectionError`] if the exposure is invalid.
    pub fn photons_per_mas(&self, spectrum: &Spectrum) -> Result<Option<f64>, ProjectionError> {
        let focal = Emitter::new(self, spectrum)?;
        let beside = ExtrafocalEmitter::beside(&focal, self, spectrum)?;
        Ok(ExtrafocalEmitter::histories_per_mas(
            &focal,
            beside.as_ref(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::beam::detector::Detector;
    use crate::beam::source::{Collimation, Extrafocal, Source};
    use crate::scenes::sixty_kvp;

    /// A field of 10 mm at 1 m; blades at 250 mm.
    fn projection(extrafocal: Option<Extrafocal>) -> Projection {
        let collimation = Collimation::Rectangle {
            size_mm: [10.0, 10.0],
            centre_mm: [0.0, 0.0],
        };
        let source = Source {
            collimation,
            blades_mm: Some(250.0),
            extrafocal,
            ..Source::default()
        };
        let detector = Detector::centred(10, 10, 40.0);
        Projection::new(Isometry3::identity(), 1_000.0, detector).with_source(source)
    }

    /// The fluence of the tube model times the area at 1 m of a small field; the opening of the blades is as large for every point
    /// of the extrafocal area.
    #[test]
    fn histories_per_mas_follow_from_the_fluence_at_1_m() {
        let spectrum = sixty_kvp();
        let expected = spectrum.fluence_per_mas_cm2_at_1m().unwrap(); // 1 cm² at 1 m
        for (extrafocal, factor) in [(None, 1.0), (Some(Extrafocal::new(0.25, 30.0)), 1.25)] {
            let photons = projection(extrafocal).photons_per_mas(&spectrum);
            let found = photons.unwrap().unwrap() / (factor * expected);
            assert!((found - 1.0).abs() < 1e-3, "{found}");
        }
    }

    /// From the opening of the blades the entire area is visible, from the detector plane a ninth of each side.
    #[test]
    fn blades_cover_a_part_of_the_area() {
        let projection = projection(Some(Extrafocal::new(0.25, 30.0)));
        let spectrum = sixty_kvp();
        let focal = Emitter::new(&projection, &spectrum).unwrap();
        let beside = ExtrafocalEmitter::beside(&focal, &projection, &spectrum);
        let beside = beside.unwrap().unwrap();
        assert!((beside.open_over_focal() - 0.8 * 1.25).abs() < 1e-3);
        // On the detector plane: 10 mm of 3 · 30 mm along both axes.
        let lit = |depth| beside.lit_over_focal(Point2::origin(), depth) / (1.0 - beside.share);
        let expected = 1.0 + 0.25 / 81.0;
        assert!((lit(1.0) - expected).abs() < 2e-3, "{}", lit(1.0));
        // At the blades: the entire area.
        assert!((lit(0.25) - 1.25).abs() < 1e-12, "{}", lit(0.25));
    }
}
