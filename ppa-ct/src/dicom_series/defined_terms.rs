//! Modality and unit of a header as terms of closed lists.
//!
//! These attributes are free text in a file: only terms defined by the standard are repeated in messages.

/// Modality (PS3.3, section C.7.3.1.1.1), retired terms last.
const MODALITIES: &str = "\
    ANN AR ASMT AU BDUS BI BMD CFM CR CT CTPROTOCOL DG DMS DOC DX ECG EEG EMG EOG EPS ES FID GM HC HD IO IOL IVOCT \
    IVUS KER KO LEN LS M3D MG MR NM OAM OCT OP OPM OPT OPTBSV OPTENF OPV OSS OT PA PLAN POS PR PT PX REG RESP RF RG \
    RTDOSE RTIMAGE RTINTENT RTPLAN RTRAD RTRECORD RTSEGANN RTSTRUCT RWV SEG SM SMR SR SRF STAIN TEXTUREMAP TG US VA \
    XA XAPROTOCOL XC \
    AS CD CF CP CS DD DF DM DS EC FA FS LP MA MS OPR ST VF";

/// Rescale Type other than HU and unspecified (PS3.3, section C.11.1.1.2).
const RESCALE_TYPES: &str = "OD MGML Z_EFF ED EDW HU_MOD PCT";

/// Units of maps made from CT (UCUM).
const UNITS: &str = "\
    ml/100ml/s ml/100ml/min ml/100g/min ml/min/100ml ml/min/100g ml/100ml ml/100g mg/ml mg/cm3 g/ml g/cm3 keV s ms % 1";

/// Photometric Interpretation of images in colour (PS3.3, section C.7.6.3.1.2), retired ones included.
const COLOURS: [&str; 12] = [
    "PALETTE COLOR",
    "RGB",
    "HSV",
    "ARGB",
    "CMYK",
    "XYB",
    "YBR_FULL",
    "YBR_FULL_422",
    "YBR_PARTIAL_422",
    "YBR_PARTIAL_420",
    "YBR_ICT",
    "YBR_RCT",
];

/// The photometric interpretation of a colour image, if the standard defines it.
pub(super) fn photometric(text: &str) -> &'static str {
    let known = COLOURS.into_iter().find(|term| *term == text);
    known.unwrap_or("(no DICOM term)")
}

/// The modality, if the standard defines it.
pub(super) fn modality(text: &str) -> &'static str {
    listed(MODALITIES, text).unwrap_or("(no DICOM term)")
}

/// The rescale type or unit, if it is in one of the lists.
pub(super) fn unit(text: &str) -> &'static str {
    listed(RESCALE_TYPES, text)
        .or_else(|| listed(UNITS, text))
        .unwrap_or("another unit")
}

fn listed(terms: &'static str, text: &str) -> Option<&'static str> {
    terms.split(' ').find(|term| *term == text)
}
