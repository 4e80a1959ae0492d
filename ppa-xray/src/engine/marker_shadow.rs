//! The shadow of the side marker in the expected signal of the pixels.

use crate::beam::detector::Detector;
use crate::beam::marker::SideMarker;
use crate::engine::scatter_field::PixelScatter;
use crate::transport::tally::Moments;

/// Removes the part covered by the letter from all layers. Within a pixel the signal is taken as uniform.
///
/// `shared` is the covariance of the errors of Compton and Rayleigh, keV².
pub(super) fn shade(
    marker: &SideMarker,
    detector: &Detector,
    primary: &mut [Moments],
    scattered: &mut [PixelScatter; 3],
    shared: &mut [f64],
) {
    for (pixel, share) in marker.covered(detector) {
        let free = 1.0 - share;
        primary[pixel] = primary[pixel].scaled(free);
        shared[pixel] *= free * free;
        for scatter in &mut *scattered {
            let (sum, error) = scatter.sum_kev;
            let taken = share * scatter.moments[pixel].mean_kev;
            scatter.sum_kev = (sum - taken, error);
            scatter.moments[pixel] = scatter.moments[pixel].scaled(free);
            scatter.variance_kev2[pixel] *= free * free;
        }
    }
}
