//! Exposure index of IEC 62494-1.

use nalgebra::Isometry3;
use ppa_xray::{
    AntiScatterGrid, DetectorModel, FastSettings, LinesAlong, Radiograph, Receptor, Spectrum,
    TubeSpec, VoxelPhantom, deviation_index, fast,
};

use crate::scenes::{frontal, limb, slab};

/// Side of the detector, mm, and its distance from the source.
const SIDE_MM: f64 = 60.0;
const DISTANCE_MM: f64 = 1_100.0;

fn rqa5() -> Spectrum {
    let tube = TubeSpec::new(
        70.0,
        12.0,
        vec!["Al:2.5".parse().unwrap(), "Al:21".parse().unwrap()],
    );
    Spectrum::tungsten(&tube).unwrap()
}

fn receptors() -> [Receptor; 3] {
    let models = [
        DetectorModel::Ideal,
        DetectorModel::Csi {
            thickness_um: 500.0,
            packing: 0.8,
        },
        DetectorModel::Selenium {
            thickness_um: 500.0,
        },
    ];
    models.map(|model| Receptor::default().with_model(model))
}

fn expose(phantom: &VoxelPhantom, receptor: &Receptor, histories: f64) -> Radiograph {
    let projection = frontal(40, SIDE_MM / 40.0).with_receptor(receptor.clone());
    let settings = FastSettings::default()
        .with_dose_histories(histories)
        .with_scatter_histories(20_000);
    fast(phantom, &rqa5(), &projection, &settings).unwrap()
}

fn index(phantom: &VoxelPhantom, receptor: &Receptor, histories: f64) -> f64 {
    let radiograph = expose(phantom, receptor, histories);
    radiograph.exposure_index(receptor).unwrap().unwrap()
}

fn vacuum() -> VoxelPhantom {
    slab(10.0, 1e-7)
}

/// Photons into the field that give 2.5 µGy at the centre of the detector. They are emitted uniformly into its solid angle,
/// 4 atan(a²/(d √(2a² + d²))) for a square of half side a.
fn histories_of_2_5_ugy() -> f64 {
    let (a, d) = (0.5 * SIDE_MM, DISTANCE_MM);
    let solid_angle = 4.0 * (a * a / (d * (2.0 * a * a + d * d).sqrt())).atan();
    let per_cm2 = 100.0 / (solid_angle * d * d);
    2.5e-6 / (rqa5().kerma_gy_cm2() * per_cm2)
}

#[test]
fn index_of_2_5_ugy_of_rqa5_is_250() {
    for receptor in receptors() {
        let index = index(&vacuum(), &receptor, histories_of_2_5_ugy());
        assert!((index / 250.0 - 1.0).abs() < 0.01, "{index} {receptor:?}");
    }
}

/// The grid absorbs part of the signal, and the calibration does not compensate for it.
#[test]
fn a_grid_lowers_the_index_by_its_transmission() {
    let [_, csi, _] = receptors();
    let grid = AntiScatterGrid::new(8.0, 36.0)
        .with_strip_mm(0.06)
        .with_strip("lead".to_owned())
        .with_interspace("polyethylene".to_owned())
        .with_focus_mm(Some(DISTANCE_MM))
        .with_lines_along(LinesAlong::X);
    let with_grid = csi.clone().with_grid(Some(grid));
    let histories = histories_of_2_5_ugy();
    let open = |receptor: &Receptor| expose(&vacuum(), receptor, histories).open_field_ev_cm2;
    let expected = open(&with_grid) / open(&csi);
    let found = index(&vacuum(), &with_grid, histories) / index(&vacuum(), &csi, histories);
    assert!(expected < 0.9, "{expected}");
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
}

#[test]
fn index_is_proportional_to_the_exposure() {
    let [_, csi, _] = receptors();
    let limb = limb(&Isometry3::identity());
    let histories = histories_of_2_5_ugy();
    let index = |factor: f64| index(&limb, &csi, factor * histories);
    let once = index(1.0);
    for factor in [0.5, 2.0, 10.0] {
        let ratio = index(factor) / once / factor;
        assert!((ratio - 1.0).abs() < 0.01, "{factor}: {ratio}");
    }
    let expected_image = expose(&limb, &csi, f64::INFINITY);
    assert_eq!(expected_image.exposure_index(&csi).unwrap(), None);
}

/// A slab over the whole field transmits part of the beam; only the limb, in half of the field, determines the index.
#[test]
fn index_is_that_of_the_limb_not_of_the_open_field() {
    let [ideal, ..] = receptors();
    let histories = histories_of_2_5_ugy();
    let behind = |thickness_mm: f64| expose(&slab(thickness_mm, 1.0), &ideal, histories);
    let water = behind(100.0);
    let index = water.exposure_index(&ideal).unwrap().unwrap();
    let mut half = water.clone();
    let open = expose(&vacuum(), &ideal, histories);
    for (layer, open) in half.layers.iter_mut().zip(&open.layers) {
        let columns = 40;
        for pixel in (0..layer.value.len()).filter(|pixel| pixel % columns < 30) {
            layer.value[pixel] = open.value[pixel];
        }
    }
    let found = half.exposure_index(&ideal).unwrap().unwrap();
    assert!(index < 100.0, "{index}");
    assert!((found / index - 1.0).abs() < 0.05, "{found} {index}");
}

#[test]
fn deviation_is_one_for_a_quarter_more() {
    assert_eq!(deviation_index(400.0, 400.0), 0.0);
    assert!((deviation_index(500.0, 400.0) - 0.969).abs() < 1e-3);
    assert!((deviation_index(200.0, 400.0) + 3.010).abs() < 1e-3);
}
