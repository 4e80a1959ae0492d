//! Dose and air kerma against analytical results.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogRun, AnalogSettings, Dose, DoseError, DoseSettings, Material, Part, PreparedPhantom,
    Projection, Spectrum, Stop, VoxelBox, VoxelLabels, VoxelPhantom,
};

use crate::scenes::{frontal, limb, sixty_kvp, slab};

fn dose(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: AnalogSettings,
    doses: &DoseSettings,
) -> Dose {
    let run = AnalogRun::new(phantom, spectrum, projection, &settings).unwrap();
    let run = run.with_dose(doses).unwrap();
    let mut tally = run.tally(Part::WHOLE);
    run.follow(&mut tally, &Stop::default(), |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    tally.dose().unwrap()
}

/// Materials, voxels and regions add up to the same energy, and masses are those of the voxels.
#[test]
fn materials_voxels_and_regions_add_up() {
    let phantom = limb(&Isometry3::identity());
    let size = phantom.grid().size();
    let whole = VoxelBox::whole(phantom.grid());
    let doses = DoseSettings::default()
        .with_regions(vec![
            whole,
            VoxelBox {
                low: [0; 3],
                high: [17, size[1], size[2]],
            },
            VoxelBox {
                low: [17, 0, 0],
                high: size,
            },
        ])
        .with_voxels(Some(whole));
    let settings = AnalogSettings::default()
        .with_histories(60_000)
        .with_seed(2);
    let dose = dose(&phantom, &sixty_kvp(), &frontal(20, 5.0), settings, &doses);
    let all = dose.phantom.ev_per_history.value;
    let close = |value: f64| (value / all - 1.0).abs() < 1e-6;
    let of_materials = dose
        .materials
        .iter()
        .map(|(_, imparted)| imparted.ev_per_history.value);
    assert!(close(of_materials.sum()));
    assert_eq!(
        dose.regions[0].1.ev_per_history,
        dose.phantom.ev_per_history
    );
    assert!(close(
        dose.regions[1].1.ev_per_history.value + dose.regions[2].1.ev_per_history.value
    ));
    let voxels = dose.voxels.unwrap();
    assert!(close(
        voxels.ev_per_history.iter().map(|&ev| f64::from(ev)).sum()
    ));
    let mass_g: f64 = voxels.mass_g.iter().map(|&g| f64::from(g)).sum();
    assert!((mass_g / dose.phantom.mass_g - 1.0).abs() < 1e-6);
    let pin = &dose.materials[3];
    // 2 x 2 x 15 voxels of 2.0 x 2.5 x 1.7 mm at 4.5 g/cm³.
    assert!(pin.0 == "titanium" && (pin.1.mass_g / (60.0 * 0.0085 * 4.5) - 1.0).abs() < 1e-9);
    // 1 eV in 1 g is 1.602e-16 Gy.
    let gray = pin.1.gy_per_history().value / pin.1.ev_per_history.value;
    assert!((gray * pin.1.mass_g / 1.602_176_634e-16 - 1.0).abs() < 1e-9);
}

/// Over 40 seeds the results scatter according to their standard errors. Squaring each deposit instead of each history would
/// give far too small an error for the phantom.
#[test]
fn standard_errors_are_those_of_whole_histories() {
    let grid = Grid::axis_aligned(
        [40; 3],
        Vector3::repeat(5.0),
        Point3::new(-97.5, -97.5, -97.5),
    );
    let grid = grid.unwrap();
    let voxels = grid.len();
    let water = Material::named("water").unwrap();
    let phantom = VoxelPhantom::new(grid, vec![0; voxels], vec![1.0; voxels], vec![water]).unwrap();
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let projection = frontal(10, 3.0);
    let cube = VoxelBox {
        low: [16, 16, 2],
        high: [24, 24, 14],
    };
    let doses = DoseSettings::default()
        .with_regions(vec![cube])
        .with_voxels(Some(VoxelBox {
            low: [19, 19, 4],
            high: [21, 21, 6],
        }));
    let seeds = 40;
    let results: Vec<Dose> = (0..seeds)
        .map(|seed| {
            let settings = AnalogSettings::default()
                .with_histories(4_000)
                .with_seed(seed);
            dose(&phantom, &spectrum, &projection, settings, &doses)
        })
        .collect();
    let check = |what: &str, of: &dyn Fn(&Dose) -> (f64, f64)| {
        let n = seeds as f64;
        let mean = results.iter().map(|dose| of(dose).0).sum::<f64>() / n;
        let scatter = results
            .iter()
            .map(|dose| (of(dose).0 - mean).powi(2))
            .sum::<f64>();
        let stated = results.iter().map(|dose| of(dose).1.powi(2)).sum::<f64>() / n;
        let chi2 = scatter / stated;
        // 39 degrees of freedom: probability 1e-4 on either side.
        assert!((13.0..83.0).contains(&chi2), "{what}: χ² = {chi2:.1}");
    };
    let of = |estimate: ppa_xray::Estimate| (estimate.value, estimate.se);
    check("phantom", &|dose| of(dose.phantom.ev_per_history));
    check("region", &|dose| of(dose.regions[0].1.ev_per_history));
    check("detector kerma", &|dose| {
        of(dose.detector_air_kerma_gy_per_history)
    });
    for voxel in [0, 7] {
        check("voxel", &|dose| {
            let voxels = dose.voxels.as_ref().unwrap();
            (
                voxels.ev_per_history[voxel].into(),
                voxels.ev_per_history_se[voxel].into(),
            )
        });
    }
}

/// With an empty beam the kerma on the detector follows from the spectrum and the inverse-square law; the kerma at the skin
/// from its distance; per mAs both follow from the tube output.
#[test]
fn air_kerma_is_that_of_the_beam() {
    let (spectrum, projection) = (sixty_kvp(), frontal(20, 5.0));
    let settings = AnalogSettings::default()
        .with_histories(200_000)
        .with_seed(6);
    let none = DoseSettings::default();
    let bare = dose(&slab(100.0, 0.0), &spectrum, &projection, settings, &none);
    assert_eq!(bare.entrance_air_kerma_gy_per_history, None);
    let per_mas = bare.histories_per_mas.unwrap();
    // 50 mm off axis at 1.1 m: the mean of cos²θ over the detector is 1 − 1.38e-3, cosines cancel.
    let at_1m = 1e-6 * spectrum.kerma_ugy_per_mas_at_1m().unwrap();
    let expected = at_1m / 1.1_f64.powi(2) * (1.0 - 1.38e-3);
    let found = bare.detector_air_kerma_gy_per_history;
    let z = (found.value * per_mas - expected) / (found.se * per_mas);
    assert!(
        z.abs() < 4.5,
        "{:e} Gy/mAs, expected {expected:e}: z = {z:.1}",
        found.value * per_mas
    ); // 7e-6

    let entrance = |density| {
        let phantom = slab(100.0, density);
        let dose = dose(&phantom, &spectrum, &projection, settings, &none);
        let prepared = PreparedPhantom::new(&phantom, settings.compton_model);
        let without_photons = prepared.entrance_air_kerma_gy_per_history(&spectrum, &projection);
        assert_eq!(
            without_photons.unwrap(),
            dose.entrance_air_kerma_gy_per_history
        );
        dose.entrance_air_kerma_gy_per_history
            .map(|gray| gray * per_mas)
    };
    let skin = entrance(1.0).unwrap();
    assert!(
        (skin / (at_1m / 0.95_f64.powi(2)) - 1.0).abs() < 1e-6,
        "{skin:e}"
    );
    assert_eq!(entrance(0.2), None, "foam is not a patient");
}

#[test]
fn regions_outside_the_phantom_are_refused() {
    let (phantom, spectrum, projection) = (slab(100.0, 1.0), sixty_kvp(), frontal(20, 5.0));
    let settings = AnalogSettings::default().with_histories(1).with_seed(0);
    for (low, high) in [
        ([0, 0, 0], [31, 1, 1]),
        ([3, 3, 3], [3, 4, 4]),
        ([5, 5, 5], [4, 6, 6]),
    ] {
        let run = AnalogRun::new(&phantom, &spectrum, &projection, &settings).unwrap();
        let doses = DoseSettings::default()
            .with_regions(vec![VoxelBox { low, high }])
            .with_voxels(None);
        let error = run.with_dose(&doses).err().unwrap();
        assert!(
            matches!(error, DoseError::Box { .. })
                && error.to_string().contains("30 x 30 x 10 voxels")
        );
    }
}

/// With the labels of the materials, dose by label equals dose by material; label 0 is left out.
#[test]
fn dose_by_label_is_that_of_its_voxels() {
    let phantom = limb(&Isometry3::identity());
    let labels = VoxelLabels(phantom.material().iter().map(|&m| 40 * m).collect());
    let settings = AnalogSettings::default()
        .with_histories(20_000)
        .with_seed(3);
    let doses = DoseSettings::default().with_labels(labels.clone());
    let projection = frontal(10, 20.0);
    let found = dose(&phantom, &sixty_kvp(), &projection, settings, &doses);
    let names: Vec<u8> = found.labels.iter().map(|(label, _)| *label).collect();
    assert_eq!(names, [40, 80, 120]);
    for ((_, by_label), (_, by_material)) in found.labels.iter().zip(&found.materials[1..]) {
        assert_eq!(by_label, by_material);
        assert!(by_label.ev_per_history.value > 0.0);
    }
    let short = DoseSettings::default().with_labels(VoxelLabels(labels.0[1..].to_vec()));
    let run = AnalogRun::new(&phantom, &sixty_kvp(), &projection, &settings)
        .map(|run| run.with_dose(&short).err());
    let (expected, found) = (labels.0.len(), labels.0.len() - 1);
    assert_eq!(run.unwrap(), Some(DoseError::Labels { found, expected }));
}
