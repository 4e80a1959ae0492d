//! Errors of an exposure's geometry and source.

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
        /// Memory needed, GiB.
        needed_gib: f64,
    },
    /// The pixel size or the source-detector distance is out of range.
    #[error("{what} is {found_mm} mm, expected 0.001 mm to 1 km")]
    Length {
        /// Name of the length.
        what: &'static str,
        /// Value found, mm.
        found_mm: f64,
    },
    /// The size of the focal spot is invalid or too large for the source-detector distance.
    #[error(
        "the focal spot is {size_mm} mm wide at {source_detector_mm} mm from the detector, expected 0 to 2 % of that distance"
    )]
    FocalSpot {
        /// Side or full width at half maximum of the focal spot, mm.
        size_mm: f64,
        /// Distance from the source to the detector plane, mm.
        source_detector_mm: f64,
    },
    /// The blades are behind the detector, or so close to the spot that their penumbra fills the field.
    #[error(
        "the collimator blades are {blades_mm} mm from the focal spot, expected {least_mm:.1} mm, where their penumbra fills the field, to {source_detector_mm} mm, the distance of the detector"
    )]
    Blades {
        /// Distance from the focal spot, mm.
        blades_mm: f64,
        /// Distance at which the penumbra fills the field, mm.
        least_mm: f64,
        /// Distance from the source to the detector plane, mm.
        source_detector_mm: f64,
    },
    /// The ratio or the size of the extrafocal radiation is out of range.
    #[error(
        "the extrafocal radiation is {ratio} of that of the focal spot and comes from a square of {size_mm} mm, expected a ratio above 0 and up to 1 and a square above 0 and up to {most_mm} mm, a tenth of the distance to the detector"
    )]
    Extrafocal {
        /// Extrafocal photons relative to those of the focal spot.
        ratio: f64,
        /// Side of the square that the extrafocal photons leave from, mm.
        size_mm: f64,
        /// Largest side, mm.
        most_mm: f64,
    },
    /// The blades are so close to the focal spot that almost no extrafocal photon passes them.
    #[error(
        "the penumbra of the extrafocal radiation is {penumbra_mm:.0} mm wide, expected at most {most_mm:.0} mm, twenty times the shorter side of the field"
    )]
    ExtrafocalPenumbra {
        /// Width of the penumbra on the detector plane, mm.
        penumbra_mm: f64,
        /// Largest width, mm.
        most_mm: f64,
    },
    /// Extrafocal radiation is combined with a field that has sharp edges.
    #[error(
        "extrafocal radiation requires the distance of the collimator blades, which determines how far it spreads beyond the field"
    )]
    ExtrafocalWithoutBlades,
    /// The opening angles of the fan are invalid.
    #[error("the x-ray field has opening angles of {} x {} degrees, expected above 0 and below 170", found_deg[0], found_deg[1])]
    FanAngle {
        /// Angles along device x and y, degrees.
        found_deg: [f64; 2],
    },
    /// The sides of the field are out of range.
    #[error(
        "the x-ray field measures {} x {} mm on the detector plane, expected sides of 0.001 to 10000000 mm",
        size_mm[0], size_mm[1]
    )]
    Field {
        /// Sides along device x and y.
        size_mm: [f64; 2],
    },
    /// The field or the detector extends too far from the foot of the perpendicular.
    #[error(
        "the {what} reaches {reach_mm} mm from the foot of the perpendicular through the source, which is {source_detector_mm} mm away, expected at most ten times that distance"
    )]
    FieldTooWide {
        /// Either the field or the detector.
        what: &'static str,
        /// Largest coordinate on the detector plane, mm.
        reach_mm: f64,
        /// Distance from the source to the detector plane, mm.
        source_detector_mm: f64,
    },
    /// The tube points along the detector plane or away from it.
    #[error(
        "the central ray meets the detector plane at {angle_deg:.1}° from its normal, expected below 84°"
    )]
    CentralRay {
        /// Angle between central ray and device z, degrees.
        angle_deg: f64,
    },
    /// The side marker has an invalid size or is off the detector.
    #[error(
        "the side marker is {height_mm} mm high with its middle at ({}, {}) mm, expected a height of 1 to 100 mm and a middle on the detector, from ({:.1}, {:.1}) to ({:.1}, {:.1}) mm",
        centre_mm[0], centre_mm[1], detector_mm[0][0], detector_mm[0][1], detector_mm[1][0], detector_mm[1][1]
    )]
    Marker {
        /// Height of the letter, mm.
        height_mm: f64,
        /// Middle of the letter in device x and y, mm.
        centre_mm: [f64; 2],
        /// Lowest and highest x and y of the detector, mm.
        detector_mm: [[f64; 2]; 2],
    },
    /// The direction of the anode is out of range.
    #[error("the direction of the anode is {found_deg} degrees, expected a finite number")]
    Anode {
        /// Value found, degrees.
        found_deg: f64,
    },
    /// The heel effect needs the tube model.
    #[error("the heel effect needs a spectrum of the tube model; the anode of this one is unknown")]
    HeelWithoutTube,
    /// The tube model has no spectrum at one of the field's take-off angles.
    #[error(
        "no spectrum at a take-off angle of {anode_angle_deg:.1}° for the heel effect: {message}"
    )]
    Heel {
        /// Take-off angle, degrees.
        anode_angle_deg: f64,
        /// Message of the tube model.
        message: String,
    },
    /// A pose, direction or position contains NaN or infinity.
    #[error("the {what} is not finite, expected finite numbers")]
    NotFinite {
        /// Name of the pose, direction or position.
        what: &'static str,
    },
    /// The image receptor is invalid.
    #[error(transparent)]
    Receptor(#[from] ReceptorError),
    /// No ray of the field can meet the voxel box.
    #[error("the x-ray field misses the voxel box altogether")]
    FieldMissesPhantom,
    /// Tissue is behind the detector plane.
    #[error(
        "the detector cuts through the patient: voxel ({}, {}, {}) of {density_g_cm3} g/cm³ lies {depth_mm:.1} mm behind its plane",
        voxel[0], voxel[1], voxel[2]
    )]
    DetectorInsidePhantom {
        /// The offending voxel (i, j, k).
        voxel: [usize; 3],
        /// Density of the voxel.
        density_g_cm3: f32,
        /// Distance of the voxel's centre behind the plane.
        depth_mm: f64,
    },
    /// The focal spot is in tissue.
    #[error("the x-ray source lies inside voxel ({}, {}, {}) of {density_g_cm3} g/cm³", voxel[0], voxel[1], voxel[2])]
    SourceInsidePhantom {
        /// The offending voxel (i, j, k).
        voxel: [usize; 3],
        /// Density of the voxel.
        density_g_cm3: f32,
    },
}
