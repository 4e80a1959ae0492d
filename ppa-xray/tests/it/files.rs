//! Pictures and files.

use exr::prelude::{AttributeValue, ReadChannels, ReadLayers, read};
use nalgebra::Isometry3;
use ppa_xray::{Category, EXR_ATTRIBUTE, FastSettings, Presentation, Radiograph, Spectrum, fast};

use crate::scenes::{frontal, limb};

fn radiograph() -> Radiograph {
    let settings = FastSettings::default()
        .with_scatter_histories(50_000)
        .with_seed(77);
    let spectrum = Spectrum::monoenergetic(40.0).unwrap();
    fast(
        &limb(&Isometry3::identity()),
        &spectrum,
        &frontal(60, 3.0),
        &settings,
    )
    .unwrap()
}

#[test]
fn exr_returns_every_layer_and_the_same_bytes_each_time() {
    let (image, folder) = (radiograph(), tempfile::tempdir().unwrap());
    let (one, two) = (folder.path().join("one.exr"), folder.path().join("two.exr"));
    image.write_exr(&one).unwrap();
    image.write_exr(&two).unwrap();
    assert_eq!(std::fs::read(&one).unwrap(), std::fs::read(&two).unwrap());
    let file = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(&one)
        .unwrap();
    let channels = &file.layer_data.channel_data.list;
    assert_eq!(channels.len(), 9);
    for category in Category::ALL {
        for (part, expected) in [
            ("value", &image.layer(category).value),
            ("sigma", &image.layer(category).sigma),
        ] {
            let name = format!("{}.{part}", category.name());
            let channel = channels.iter().find(|c| c.name == *name.as_str()).unwrap();
            let found: Vec<f32> = channel.sample_data.values_as_f32().collect();
            assert_eq!(&found, expected, "{name}");
        }
    }
    let (name, text) = file.layer_data.attributes.other.iter().next().unwrap();
    assert_eq!(name.to_string(), EXR_ATTRIBUTE);
    let AttributeValue::Text(text) = text else {
        panic!("{text:?}");
    };
    let table: toml::Table = text.to_string().parse().unwrap();
    assert_eq!(table["seed"].as_integer(), Some(77));
    assert_eq!(table["source_detector_mm"].as_integer(), Some(1_100));
    assert_eq!(table["unit"].as_str(), Some("eV/cm2 per history"));
    // A monoenergetic spectrum without a tube: its output is unknown.
    assert!(!table.contains_key("mas"));
}

#[test]
fn png_holds_sixteen_bits_with_bone_white_and_air_black() {
    let (image, folder) = (radiograph(), tempfile::tempdir().unwrap());
    let path = folder.path().join("limb.png");
    image.write_png(&path, &Presentation::default()).unwrap();
    let png = image::open(&path).unwrap().into_luma16();
    assert_eq!(
        png.as_raw(),
        &image.present(&Presentation::default()).unwrap()
    );
    let (corner, centre) = (png.get_pixel(2, 2).0[0], png.get_pixel(30, 30).0[0]);
    assert!(corner < 2_000 && centre > 40_000, "{corner} {centre}");
}

/// Steps 60 mm wide, large compared with the size of detail, each doubling the exposure; for every protocol.
#[test]
fn a_step_wedge_gets_darker_with_every_step_of_exposure() {
    let mut wedge = radiograph();
    let pixels = wedge.detector.pixels();
    for layer in &mut wedge.layers {
        layer.value.fill(0.0);
        layer.sigma.fill(0.0);
    }
    for pixel in 0..pixels {
        let step = 2 * (pixel / 60 / 20) + pixel % 60 / 30;
        let share = f64::exp2(-(step as f64));
        wedge.layers[0].value[pixel] = (share * wedge.open_field_at(pixel)) as f32;
    }
    for name in Presentation::protocols() {
        let presentation = Presentation::protocol(name).unwrap();
        let grey = wedge.present(&presentation).unwrap();
        let middles: Vec<u16> = (0..6)
            .map(|step| grey[(20 * (step / 2) + 10) * 60 + 30 * (step % 2) + 15])
            .collect();
        assert_eq!(middles[0], 0, "{name}");
        assert!(
            middles.is_sorted_by(|a, b| b.saturating_sub(*a) > 2_000),
            "{name}: {middles:?}"
        );
    }
}

/// The window is fixed: a metal plate in one corner does not change the far corner. A fitted window is optional.
#[test]
fn grey_values_do_not_depend_on_the_rest_of_the_image() {
    let image = radiograph();
    let mut with_plate = image.clone();
    for row in 0..10 {
        for layer in &mut with_plate.layers {
            layer.value[row * 60..row * 60 + 10].fill(0.0);
        }
    }
    let presentation = Presentation::default();
    let (a, b) = (
        image.present(&presentation).unwrap(),
        with_plate.present(&presentation).unwrap(),
    );
    // The coarsest bands reach across this small image: 0.1 % of the scale.
    assert!(a[59 * 60 + 59].abs_diff(b[59 * 60 + 59]) < 66);
    assert!(b[0] > a[0]);
    let fitted = presentation.fitted(&image).unwrap();
    let wider = presentation.fitted(&with_plate).unwrap();
    assert!(fitted.width < wider.width && fitted.detail == presentation.detail);
}

#[test]
fn a_failed_write_leaves_nothing_and_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("missing").join("image.exr");
    let error = radiograph().write_exr(&path).unwrap_err();
    assert!(error.to_string().contains("image.exr"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn cut_layers_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut image = radiograph();
    image.layers[1].sigma.truncate(100);
    let errors = [
        image.write_png(&folder.path().join("x.png"), &Presentation::default()),
        image.write_exr(&folder.path().join("x.exr")),
    ];
    for error in errors.map(Result::unwrap_err) {
        assert_eq!(
            error.to_string(),
            "layer compton has 100 values, expected 3600, one per pixel"
        );
    }
    image.layers[1].value.truncate(100);
    assert!(image.total()[100].is_nan() && image.sigma()[100].is_nan());
    assert!(image.total()[99].is_finite() && image.sigma()[99].is_finite());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
