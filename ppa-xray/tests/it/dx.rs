//! DICOM Digital X-Ray images, written and read back.

use dicom_core::VR;
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileDicomObject, InMemDicomObject, Tag, open_file};
use nalgebra::Isometry3;
use ppa_xray::{
    Collimation, DxExposure, DxIntent, Examination, FastSettings, Laterality, OutputError,
    Presentation, Projection, Radiograph, Region, Spectrum, TubeSpec, View, fast,
};

use crate::scenes::{frontal, limb};

fn tube() -> TubeSpec {
    TubeSpec::new(
        60.0,
        12.0,
        vec!["Al:2.5".parse().unwrap(), "Cu:0.1".parse().unwrap()],
    )
}

/// A limb with the field collimated to 30 × 40 of 60 × 60 pixels.
fn exposed() -> (Projection, Radiograph) {
    let mut projection = frontal(60, 3.0);
    projection.source.collimation = Collimation::Rectangle {
        size_mm: [90.0, 120.0],
        centre_mm: [0.0, 0.0],
    };
    let settings = FastSettings::default().with_scatter_histories(50_000);
    let phantom = limb(&Isometry3::identity());
    let spectrum = Spectrum::tungsten(&tube()).unwrap();
    let radiograph = fast(&phantom, &spectrum, &projection, &settings).unwrap();
    (projection, radiograph)
}

fn write(
    projection: &Projection,
    radiograph: &Radiograph,
    study: &str,
    intent: DxIntent,
) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.dcm");
    let examination = Examination {
        region: Region::Ankle,
        side: Laterality::Right,
        view: View::AnteroPosteriorOblique,
    };
    let tube = tube();
    let exposure = DxExposure::new(projection, &tube, examination, study)
        .with_source_patient_mm(Some(1_000.0))
        .with_target_exposure_index(Some(400.0));
    radiograph.write_dicom(&path, &exposure, intent).unwrap();
    std::fs::read(&path).unwrap()
}

fn read(bytes: &[u8]) -> FileDicomObject<InMemDicomObject> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.dcm");
    std::fs::write(&path, bytes).unwrap();
    open_file(&path).unwrap()
}

fn text(object: &InMemDicomObject, tag: Tag) -> String {
    let element = object
        .element(tag)
        .unwrap_or_else(|_| panic!("{tag} is missing"));
    element.to_str().unwrap().trim_end().to_owned()
}

fn pixels(object: &InMemDicomObject) -> Vec<u16> {
    object
        .element(tags::PIXEL_DATA)
        .unwrap()
        .to_multi_int()
        .unwrap()
}

#[test]
fn a_header_says_what_the_exposure_was_and_that_it_was_none() {
    let (projection, radiograph) = exposed();
    let intent = DxIntent::Presentation(Presentation::default());
    let object = read(&write(&projection, &radiograph, "scan", intent));
    let meta = object.meta().media_storage_sop_class_uid();
    assert_eq!(
        meta.trim_end_matches('\0'),
        uids::DIGITAL_X_RAY_IMAGE_STORAGE_FOR_PRESENTATION
    );
    let mas = radiograph.mas().unwrap();
    for (tag, expected) in [
        (tags::IMAGE_TYPE, "DERIVED\\PRIMARY"),
        (tags::PATIENT_IDENTITY_REMOVED, "YES"),
        (tags::PATIENT_NAME, ""),
        (tags::PATIENT_ID, ""),
        (tags::STUDY_DATE, ""),
        (tags::BURNED_IN_ANNOTATION, "NO"),
        (tags::CONTENT_QUALIFICATION, "RESEARCH"),
        (tags::PRESENTATION_INTENT_TYPE, "FOR PRESENTATION"),
        (tags::PIXEL_INTENSITY_RELATIONSHIP, "LOG"),
        (tags::PRESENTATION_LUT_SHAPE, "IDENTITY"),
        (tags::KVP, "60"),
        (tags::FILTER_MATERIAL, "ALUMINUM\\COPPER"),
        (tags::FILTER_THICKNESS_MAXIMUM, "2.5\\0.1"),
        (tags::DISTANCE_SOURCE_TO_DETECTOR, "1100"),
        (tags::DISTANCE_SOURCE_TO_PATIENT, "1000"),
        (tags::ESTIMATED_RADIOGRAPHIC_MAGNIFICATION_FACTOR, "1.1"),
        (tags::EXPOSURE_INU_AS, &format!("{:.0}", 1e3 * mas)),
        (tags::IMAGER_PIXEL_SPACING, "3\\3"),
        (tags::PIXEL_SPACING, "3\\3"),
        (tags::FIELD_OF_VIEW_DIMENSIONS, "180\\180"),
        (tags::GRID, "NONE"),
        (tags::IMAGE_LATERALITY, "R"),
        (tags::BODY_PART_EXAMINED, "ANKLE"),
        // Device axes along those of the ct frame: rows towards the left, columns towards posterior.
        (tags::PATIENT_ORIENTATION, "L\\P"),
        // 30 of 60 columns and 40 of 60 rows are exposed: the last dark ones are 15 and 10, the first ones 46 and 51.
        (tags::COLLIMATOR_LEFT_VERTICAL_EDGE, "15"),
        (tags::COLLIMATOR_RIGHT_VERTICAL_EDGE, "46"),
        (tags::SHUTTER_UPPER_HORIZONTAL_EDGE, "10"),
        (tags::SHUTTER_LOWER_HORIZONTAL_EDGE, "51"),
    ] {
        assert_eq!(text(&object, tag), expected, "{tag}");
    }
    let region = object.element(tags::ANATOMIC_REGION_SEQUENCE).unwrap();
    let region = &region.items().unwrap()[0];
    assert_eq!(text(region, tags::CODE_VALUE), "70258002");
    let view = object.element(tags::VIEW_CODE_SEQUENCE).unwrap();
    assert_eq!(
        text(&view.items().unwrap()[0], tags::CODE_VALUE),
        "399312000"
    );
}

#[test]
fn exposure_indices_are_decimal_strings_of_the_image() {
    let (projection, mut radiograph) = exposed();
    let object = read(&write(&projection, &radiograph, "", DxIntent::Processing));
    let index = radiograph.exposure_index(&projection.receptor).unwrap();
    let index = index.unwrap();
    for (tag, expected) in [
        (Tag(0x0018, 0x1411), index),
        (Tag(0x0018, 0x1412), 400.0),
        (Tag(0x0018, 0x1413), 10.0 * (index / 400.0).log10()),
    ] {
        assert_eq!(object.element(tag).unwrap().vr(), VR::DS);
        let found: f64 = text(&object, tag).parse().unwrap();
        assert!((found - expected).abs() <= 1e-7 * expected.abs(), "{tag}");
    }
    // An expected image corresponds to no exposure.
    radiograph.histories = f64::INFINITY;
    let object = read(&write(&projection, &radiograph, "", DxIntent::Processing));
    assert!(object.element(tags::EXPOSURE_INDEX).is_err());
    assert!(object.element(tags::DEVIATION_INDEX).is_err());
}

/// Rotating the detector about its centre does not change its distance from the source.
#[test]
fn the_detector_is_as_far_as_the_central_ray_says() {
    let (projection, mut radiograph) = exposed();
    let turned = projection.with_detector_turned(0.5, -0.2);
    radiograph.source_detector_mm = turned.source_detector_mm;
    let object = read(&write(&turned, &radiograph, "scan", DxIntent::Processing));
    for (tag, expected) in [
        (tags::DISTANCE_SOURCE_TO_DETECTOR, 1_100.0),
        (tags::ESTIMATED_RADIOGRAPHIC_MAGNIFICATION_FACTOR, 1.1),
    ] {
        let found: f64 = text(&object, tag).parse().unwrap();
        assert!((found / expected - 1.0).abs() < 1e-9, "{tag}: {found}");
    }
}

/// A reader that applies the look-up table of the header shows the PNG, including the black of the unattenuated field.
#[test]
fn the_table_of_the_header_gives_the_grey_of_the_png() {
    let (projection, radiograph) = exposed();
    let presentation = Presentation::default();
    let intent = DxIntent::Presentation(presentation);
    let object = read(&write(&projection, &radiograph, "scan", intent));
    assert!(object.element(tags::WINDOW_CENTER).is_err());
    let tables = object.element(tags::VOILUT_SEQUENCE).unwrap();
    let [item] = tables.items().unwrap() else {
        panic!("one table is expected");
    };
    let numbers = |tag| -> Vec<u16> { item.element(tag).unwrap().to_multi_int().unwrap() };
    let (descriptor, table) = (numbers(tags::LUT_DESCRIPTOR), numbers(tags::LUT_DATA));
    assert_eq!(descriptor, [table.len() as u16, 6_000, 16]);
    assert_eq!(table[0], 0);
    let png = radiograph.present(&presentation).unwrap();
    for (pixel, (stored, grey)) in pixels(&object).into_iter().zip(png).enumerate() {
        if radiograph.in_field(pixel) {
            let shown = table[usize::from(stored.saturating_sub(6_000))];
            // Half a step of 1/6000 in reduced log exposure, at a slope of at most 65 535.
            assert!(shown.abs_diff(grey) <= 6, "{pixel}: {shown} {grey}");
        } else {
            assert_eq!((stored, grey), (6_000, 0));
        }
    }
}

#[test]
fn an_image_for_processing_is_linear_in_the_reading() {
    let (projection, radiograph) = exposed();
    let object = read(&write(
        &projection,
        &radiograph,
        "scan",
        DxIntent::Processing,
    ));
    assert_eq!(text(&object, tags::PIXEL_INTENSITY_RELATIONSHIP), "LIN");
    assert_eq!(text(&object, tags::PRESENTATION_LUT_SHAPE), "INVERSE");
    assert!(object.element(tags::WINDOW_CENTER).is_err());
    assert!(object.element(tags::VOILUT_SEQUENCE).is_err());
    let total = radiograph.total();
    for (pixel, stored) in pixels(&object).into_iter().enumerate() {
        if radiograph.in_field(pixel) {
            let share = f64::from(total[pixel]) / radiograph.open_field_at(pixel);
            assert!((f64::from(stored) - 40_000.0 * share).abs() <= 0.5);
        }
    }
}

#[test]
fn identifiers_follow_from_the_radiograph() {
    let (projection, radiograph) = exposed();
    let intent = DxIntent::Processing;
    let first = write(&projection, &radiograph, "scan", intent);
    assert_eq!(first, write(&projection, &radiograph, "scan", intent));
    let mut other = radiograph.clone();
    other.layers[0].value[1_830] *= 1.5;
    let identifiers = |bytes: &[u8]| {
        let object = read(bytes);
        [
            tags::STUDY_INSTANCE_UID,
            tags::SERIES_INSTANCE_UID,
            tags::SOP_INSTANCE_UID,
        ]
        .map(|tag| text(&object, tag))
    };
    let [study, series, instance] = identifiers(&first);
    let [same_study, same_series, other_instance] =
        identifiers(&write(&projection, &other, "scan", intent));
    assert_eq!((&study, &series), (&same_study, &same_series));
    assert_ne!(instance, other_instance);
    let presentation = DxIntent::Presentation(Presentation::default());
    let [study_shown, series_shown, _] =
        identifiers(&write(&projection, &radiograph, "scan", presentation));
    assert!(study == study_shown && series != series_shown);
    let [other_study, ..] = identifiers(&write(&projection, &radiograph, "other", intent));
    assert_ne!(study, other_study);
}

#[test]
fn an_image_too_large_for_dicom_is_refused() {
    let (projection, mut radiograph) = exposed();
    radiograph.detector.columns = 65_536;
    let examination = Examination {
        region: Region::Ankle,
        side: Laterality::Left,
        view: View::AnteroPosterior,
    };
    let tube = tube();
    let exposure = DxExposure::new(&projection, &tube, examination, "");
    let path = std::path::Path::new("never-written.dcm");
    let error = radiograph.write_dicom(path, &exposure, DxIntent::Processing);
    assert!(matches!(
        error,
        Err(OutputError::DicomSize {
            columns: 65_536,
            ..
        })
    ));
}
