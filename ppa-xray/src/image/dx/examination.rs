//! Anatomy and view of a radiograph in the codes of DICOM PS3.16.

/// A coded concept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Code {
    pub value: &'static str,
    pub scheme: &'static str,
    pub meaning: &'static str,
}

const fn snomed(value: &'static str, meaning: &'static str) -> Code {
    Code {
        value,
        scheme: "SCT",
        meaning,
    }
}

/// Body part, side and view of a radiograph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Examination {
    /// The part of the body.
    pub region: Region,
    /// The side of the body.
    pub side: Laterality,
    /// The direction of the beam.
    pub view: View,
}

/// A part of the body (CID 4009).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// The ankle joint.
    Ankle,
    /// The lower leg.
    LowerLeg,
    /// The foot.
    Foot,
    /// The knee.
    Knee,
    /// The wrist joint.
    Wrist,
    /// The hand.
    Hand,
    /// Any limb.
    Extremity,
}

/// A side of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Laterality {
    /// Left.
    Left,
    /// Right.
    Right,
}

/// Direction of the beam through the body (CID 4010).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// From the front.
    AnteroPosterior,
    /// From the front with the limb rotated, such as a mortise view.
    AnteroPosteriorOblique,
    /// From behind.
    PosteroAnterior,
    /// From the outer side.
    LateroMedial,
    /// From the inner side.
    MedioLateral,
}

impl Region {
    pub(crate) fn code(self) -> Code {
        match self {
            Self::Ankle => snomed("70258002", "Ankle joint"),
            Self::LowerLeg => snomed("30021000", "Lower leg"),
            Self::Foot => snomed("56459004", "Foot"),
            Self::Knee => snomed("72696002", "Knee"),
            Self::Wrist => snomed("74670003", "Wrist joint"),
            Self::Hand => snomed("85562004", "Hand"),
            Self::Extremity => snomed("66019005", "Extremity"),
        }
    }

    /// Body Part Examined (PS3.16 Annex L).
    pub(crate) fn body_part(self) -> &'static str {
        match self {
            Self::Ankle => "ANKLE",
            Self::LowerLeg => "LEG",
            Self::Foot => "FOOT",
            Self::Knee => "KNEE",
            Self::Wrist => "WRIST",
            Self::Hand => "HAND",
            Self::Extremity => "EXTREMITY",
        }
    }
}

impl Laterality {
    pub(crate) fn letter(self) -> &'static str {
        match self {
            Self::Left => "L",
            Self::Right => "R",
        }
    }
}

impl View {
    pub(crate) fn code(self) -> Code {
        match self {
            Self::AnteroPosterior => snomed("399348003", "antero-posterior"),
            Self::AnteroPosteriorOblique => snomed("399312000", "antero-posterior oblique"),
            Self::PosteroAnterior => snomed("272479007", "postero-anterior"),
            Self::LateroMedial => snomed("399352003", "lateral-medial"),
            Self::MedioLateral => snomed("399260004", "medial-lateral"),
        }
    }
}
