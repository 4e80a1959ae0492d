//! What can be wrong with an exposure.

use crate::beam::raster::MAX_PIXELS;
use crate::beam::receptor::ReceptorError;

/// Why a projection cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProjectionError {
    /// The detector has no pixels, or more than can be addressed.
    #[error("the detector has {columns} x {rows} pixels; each side needs 1 to 65536")]
    PixelCount {
        /// Pixels along device x.
        columns: u32,
        /// Pixels along device y.
        rows: u32,
    },
    /// The planes of such an image would not fit into memory.
    #[error(
        "the detector has {columns} x {rows} pixels, expected at most {MAX_PIXELS}: each takes 32 bytes in the result"
    )]
    TooManyPixels {
        /// Pixels along device x.
        columns: u32,
        /// Pixels along device y.
        rows: u32,
    },
    /// The image does not fit into the memory of this machine.
    #[error(
        "the image of {columns} x {rows} pixels needs about {needed_gib:.1} GiB of memory while it is computed, more than is available"
    )]
    Memory {
        /// Pixels along device x.
        columns: u32,
        /// Pixels along device y.
        rows: u32,
        /// What it takes.
        needed_gib: f64,
    },
    /// Pixel side or source-detector distance is not a length that makes sense.
    #[error("{what} is {found_mm} mm, expected 0.001 mm to 1 km")]
    Length {
        /// Which length.
        what: &'static str,
        /// What it was.
        found_mm: f64,
    },
    /// The size of the focal spot is invalid or out of proportion.
    #[error(
        "the focal spot is {size_mm} mm wide at {source_detector_mm} mm from the detector, expected 0 to 2 % of that distance"
    )]
    FocalSpot {
        /// Its side or full width at half maximum.
        size_mm: f64,
        /// Distance from the source to the detector plane, mm.
        source_detector_mm: f64,
    },
    /// Blades behind the detector, or so close to the spot that their penumbra fills the field.
    #[error(
        "the collimator blades are {blades_mm} mm from the focal spot, expected {least_mm:.1} mm, where their penumbra fills the field, to {source_detector_mm} mm, the distance of the detector"
    )]
    Blades {
        /// Distance from the focal spot, mm.
        blades_mm: f64,
        /// Where the penumbra fills the field, mm.
        least_mm: f64,
        /// Distance from the source to the detector plane, mm.
        source_detector_mm: f64,
    },
    /// Extrafocal radiation out of proportion.
    #[error(
        "the extrafocal radiation is {ratio} of that of the focal spot and comes from a square of {size_mm} mm, expected a ratio above 0 and up to 1 and a square above 0 and up to {most_mm} mm, a tenth of the distance to the detector"
    )]
    Extrafocal {
        /// Its photons over those of the focal spot.
        ratio: f64,
        /// Side of the square that it leaves from, mm.
        size_mm: f64,
        /// Largest side, mm.
        most_mm: f64,
    },
    /// Blades so close to the focal spot that next to no extrafocal photon passes them.
    #[error(
        "the penumbra of the extrafocal radiation is {penumbra_mm:.0} mm wide, expected at most {most_mm:.0} mm, twenty times the shorter side of the field"
    )]
    ExtrafocalPenumbra {
        /// Its width on the detector plane, mm.
        penumbra_mm: f64,
        /// Largest width, mm.
        most_mm: f64,
    },
    /// Extrafocal radiation and a field with sharp edges.
    #[error(
        "extrafocal radiation requires the distance of the collimator blades, which determines how far it spreads beyond the field"
    )]
    ExtrafocalWithoutBlades,
    /// Opening angles of the fan.
    #[error("the x-ray field has opening angles of {} x {} degrees, expected above 0 and below 170", found_deg[0], found_deg[1])]
    FanAngle {
        /// Angles along device x and y, degrees.
        found_deg: [f64; 2],
    },
    /// Sides of the field.
    #[error(
        "the x-ray field measures {} x {} mm on the detector plane, expected sides of 0.001 to 10000000 mm",
        size_mm[0], size_mm[1]
    )]
    Field {
        /// Sides along device x and y.
        size_mm: [f64; 2],
    },
    /// The field or the detector reaches nearly to the horizon.
    #[error(
        "the {what} reaches {reach_mm} mm from the foot of the perpendicular through the source, which is {source_detector_mm} mm away, expected at most ten times that distance"
    )]
    FieldTooWide {
        /// Field or detector.
        what: &'static str,
        /// Largest coordinate on the detector plane.
        reach_mm: f64,
        /// Distance from the source to the detector plane.
        source_detector_mm: f64,
    },
    /// The tube looks along the detector or away from it.
    #[error(
        "the central ray meets the detector plane at {angle_deg:.1}° from its normal, expected below 84°"
    )]
    CentralRay {
        /// Angle between central ray and device z, degrees.
        angle_deg: f64,
    },
    /// A side marker of invalid size, or off the detector.
    #[error(
        "the side marker is {height_mm} mm high with its middle at ({}, {}) mm, expected a height of 1 to 100 mm and a middle on the detector, from ({:.1}, {:.1}) to ({:.1}, {:.1}) mm",
        centre_mm[0], centre_mm[1], detector_mm[0][0], detector_mm[0][1], detector_mm[1][0], detector_mm[1][1]
    )]
    Marker {
        /// Height of the letter, mm.
        height_mm: f64,
        /// Its middle in device x and y, mm.
        centre_mm: [f64; 2],
        /// Lowest and highest x and y of the detector, mm.
        detector_mm: [[f64; 2]; 2],
    },
    /// Direction of the anode.
    #[error("the direction of the anode is {found_deg} degrees, expected a finite number")]
    Anode {
        /// What it was.
        found_deg: f64,
    },
    /// The heel effect needs the tube model.
    #[error("the heel effect needs a spectrum of the tube model; the anode of this one is unknown")]
    HeelWithoutTube,
    /// The tube model has no spectrum at a take-off angle of the field.
    #[error(
        "no spectrum at a take-off angle of {anode_angle_deg:.1}° for the heel effect: {message}"
    )]
    Heel {
        /// Take-off angle, degrees.
        anode_angle_deg: f64,
        /// What the tube model said.
        message: String,
    },
    /// A pose, direction or place holds NaN or infinity.
    #[error("the {what} is not finite, expected finite numbers")]
    NotFinite {
        /// Which one.
        what: &'static str,
    },
    /// The image receptor.
    #[error(transparent)]
    Receptor(#[from] ReceptorError),
    /// Not one ray of the field can meet the voxel box.
    #[error("the x-ray field misses the voxel box altogether")]
    FieldMissesPhantom,
    /// Tissue would lie behind the detector plane.
    #[error(
        "the detector cuts through the patient: voxel ({}, {}, {}) of {density_g_cm3} g/cm³ lies {depth_mm:.1} mm behind its plane",
        voxel[0], voxel[1], voxel[2]
    )]
    DetectorInsidePhantom {
        /// The offending voxel (i, j, k).
        voxel: [usize; 3],
        /// Its density.
        density_g_cm3: f32,
        /// Distance of its centre behind the plane.
        depth_mm: f64,
    },
    /// The focal spot would lie in tissue.
    #[error("the x-ray source lies inside voxel ({}, {}, {}) of {density_g_cm3} g/cm³", voxel[0], voxel[1], voxel[2])]
    SourceInsidePhantom {
        /// The offending voxel (i, j, k).
        voxel: [usize; 3],
        /// Its density.
        density_g_cm3: f32,
    },
}
