//! Consequences of each finding for depth images and radiographs.

use super::findings::FindingCode;
use crate::scan::WarningCode;

impl FindingCode {
    /// Consequences for depth images, then for radiographs.
    pub(super) fn meaning(self) -> (&'static str, &'static str) {
        use FindingCode as F;
        match self {
            F::Reader(code) => of_warning(code),
            F::LeftHanded => (
                "None: ppa keeps the affine. Programs that look at the voxels alone show the limb mirrored.",
                "None: the beam is traced in world coordinates.",
            ),
            F::CoarseVoxels => (
                "The skin is interpolated between the voxels; toes, heel and creases are smoother than they are.",
                "Fine bone texture is lost; edges along the coarse axis are blurred by about a voxel.",
            ),
            F::GapsBetweenSlices => (
                "The skin between slices is a guess.",
                "Attenuation between slices is a guess; fracture lines or small bones may be missing.",
            ),
            F::OverlappingSlices => (
                "None worth mentioning: the skin is a little smoother along the scan.",
                "Edges along the scan are blurred by the slice thickness, not by the smaller step.",
            ),
            F::LossyPixels => (
                "Block artefacts may roughen the skin by less than a voxel.",
                "HU values are off by a few tens; flat regions may show blocks.",
            ),
            F::ShiftedValues => (
                "The skin threshold finds no surface, or the wrong one.",
                "Air would be taken for tissue, and everything would be opaque. Correct the values first.",
            ),
            F::NoAir => (
                "There is no skin to find: the scan lies inside the body.",
                "The limb has no outline in the radiograph.",
            ),
            F::AirOffScale => (
                "The skin may be off by up to a voxel, since its threshold lies between air and tissue.",
                "Densities are off by as much: check the calibration with `ppa xray audit`.",
            ),
            F::NoTissue => (
                "There is no skin to find.",
                "The radiograph would be empty.",
            ),
            F::TissueOffScale => (
                "Little: the skin threshold lies far below tissue.",
                "Soft tissue gets the density of something else: a phantom, contrast agent or a wrong rescale slope.",
            ),
            F::NoBone => (
                "Landmarks that depend on bone cannot be found.",
                "The radiograph shows no bone.",
            ),
            F::ClippedAbove => (
                "None.",
                "Metal and dense bone at the limit get one density: the shadows of implants are too light.",
            ),
            F::ClippedBelow => (
                "Air, foam and couch cannot be distinguished; the skin threshold may be below the lowest value.",
                "Air outside and inside the limb attenuates.",
            ),
            F::BelowAir => (
                "None: the padding lies outside the field of view.",
                "None: values below air count as air.",
            ),
            F::Metal => (
                "Streaks may roughen the skin where metal lies close to it.",
                "Implants show; their density depends on the calibration's metal segment, and streaks show as false lines.",
            ),
            F::Couch => (
                "The couch must be removed, which `ppa prepare` does; where the limb pressed on it, the skin is flat.",
                "`ppa prepare` keeps it out of the beam; in the raw scan it would cast a shadow.",
            ),
            F::CouchMisplaced => (
                "If the volume is flipped, left and right or front and back are swapped. Compare with the patient.",
                "As for depth images: a mirrored ankle is labelled as the other side.",
            ),
            F::CutAtSide => (
                "The cut is a flat wall that a camera on that side sees; regions of interest there are useless.",
                "Tissue beyond the cut does not attenuate: a false edge, and too bright a shadow next to it.",
            ),
            F::CutAtEnd => (
                "The limb ends in a flat cut there; keep it out of the camera's region of interest.",
                "Beyond the end the detector sees open field, and scatter from there is missing.",
            ),
            F::Identifiers => (
                "None: these values do not reach any image.",
                "None. The scan itself is a patient's record: do not share it.",
            ),
        }
    }
}

fn of_warning(code: WarningCode) -> (&'static str, &'static str) {
    match code {
        WarningCode::GantryTilt => (
            "None: the sheared grid is kept as acquired, and the skin is right in space.",
            "None: the beam is traced through the sheared grid.",
        ),
        WarningCode::SingleSlice => (
            "A slab as thick as one slice is not a limb.",
            "The radiograph shows a slab of constant cross-section.",
        ),
        WarningCode::LocalizersDropped | WarningCode::NonImagesDropped => ("None.", "None."),
        WarningCode::FilesMissing => (
            "If slices are missing at an end, the limb is cut there.",
            "If slices are missing at an end, tissue there does not attenuate.",
        ),
        WarningCode::NoRescale => (
            "If stored values are not HU, the skin threshold finds the wrong surface.",
            "If stored values are not HU, every density is wrong.",
        ),
        WarningCode::PixelPadding => (
            "None, unless the limb reaches the edge of the field of view.",
            "None: padding is read as air.",
        ),
        WarningCode::GapsFilled => (
            "The skin runs straight over the slices that were missing.",
            "Bone in the slices that were missing is a mixture of its neighbours.",
        ),
        WarningCode::NotHu | WarningCode::NotCt => (
            "The skin threshold finds the wrong surface, or none.",
            "Every density is wrong. Use the original scan.",
        ),
        WarningCode::NoOrientation => (
            "A right limb may be taken for a left one and rotated the wrong way.",
            "A right limb may be taken for a left one and rotated the wrong way.",
        ),
    }
}
