//! `--json`: one object on stdout, with the keys that scripts rely on.

use std::fs;

use serde_json::Value;

use crate::{phantom, succeed};

/// Runs with `--json` and checks the keys; returns the object.
fn object(arguments: &str, keys: &[&str]) -> Value {
    let said = succeed(phantom(), &format!("{arguments} --json"));
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    let object: Value = serde_json::from_str(&said).unwrap();
    for key in keys {
        assert!(
            object.get(key).is_some(),
            "ppa {arguments}: {key} is missing in {object}"
        );
    }
    object
}

#[test]
fn every_command_keeps_its_keys() {
    let folder = phantom();
    fs::write(folder.join("points.csv"), "x,y,z\n0,0,1000\n0,0,-1\n").unwrap();
    fs::write(folder.join("pairs.csv"), "a,b\n3,1\n4,2\n5,1\n").unwrap();
    let folds = "seed,fold,a,b\n1,0,3,1\n1,1,4,2\n2,0,2,1\n2,1,3,2\n";
    fs::write(folder.join("folds.csv"), folds).unwrap();
    let predictions = "id,label,prediction\na,1,1.2\nb,2,2.1\nc,3,2.9\nd,2.5,2.4\n";
    fs::write(folder.join("predictions.csv"), predictions).unwrap();
    // The camera a metre above the phantom, looking down (towards posterior).
    let pose = "[[1, 0, 0, 90], [0, 0, -1, -250], [0, 1, 0, 1000], [0, 0, 0, 1]]";
    fs::write(folder.join("pose.json"), pose).unwrap();

    let info = [
        "size",
        "spacing_mm",
        "origin_mm",
        "direction",
        "hu_min",
        "hu_max",
        "hu_sum",
        "modality",
        "series",
        "warnings",
    ];
    let original = object("ct info p01.nii", &info);
    // NIfTI stores positions as f32, from which the chain continues.
    for copy in ["copy.nii.gz", "copy.nrrd", "copy.mha", "copy.mhd"] {
        let copied = object(&format!("ct convert p01.nii {copy}"), &info);
        assert_eq!(copied["modality"], Value::Null);
        for key in info.iter().filter(|key| **key != "series") {
            assert_eq!(copied[key], original[key], "{key} of {copy}");
        }
    }
    let dicom = object("ct convert copy.mhd copy", &info);
    assert_eq!(dicom["modality"], "CT");
    assert_eq!(dicom["size"], original["size"]);
    // The phantom's values are not integers: 2.8e3 HU in 65535 levels.
    for key in ["hu_min", "hu_max"] {
        let [a, b] = [&dicom, &original].map(|info| info[key].as_f64().unwrap());
        assert!((a - b).abs() < 0.05, "{key} of DICOM: {a}, {b}");
    }
    let audited = object("ct info p01.nii --report p01.html", &info);
    for key in ["findings", "measures", "acquisition"] {
        assert!(audited.get(key).is_some(), "{key} is missing in {audited}");
    }
    for key in ["code", "severity", "text", "depth_images", "radiographs"] {
        assert!(audited["findings"][0][key].is_string(), "{key}");
    }
    let page = fs::read_to_string(folder.join("p01.html")).unwrap();
    assert_eq!(page.matches("data:image/png;base64,").count(), 3);
    assert!(!page.contains("http") && !page.contains("p01"));
    object(
        "mesh extract p01.nii --iso -500 --out iso.ply --close",
        &[
            "vertices",
            "triangles",
            "area_mm2",
            "volume_mm3",
            "components",
            "boundary_edges",
            "euler",
            "wall_s",
            "cpu_s",
        ],
    );
    for format in ["obj", "stl"] {
        let other = object(
            &format!("mesh extract p01.nii --out iso.{format} --close"),
            &[],
        );
        let points = object(
            &format!("mesh cluster iso.{format} --eps-mm 6 --min-points 1"),
            &[],
        );
        let count: f64 = points["sizes"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|n| n.as_f64())
            .sum();
        assert_eq!(other["vertices"].as_f64(), Some(count), "{format}");
    }
    object(
        "mesh cluster p01.ply --eps-mm 6 --min-points 5",
        &["clusters", "noise", "core_points", "sizes"],
    );
    let augmented = [
        "vertices",
        "triangles",
        "area_mm2",
        "volume_mm3",
        "components",
        "boundary_edges",
        "euler",
        "volume_change_mm3",
        "least_shift_mm",
        "mean_shift_mm",
        "most_shift_mm",
        "wall_s",
        "cpu_s",
    ];
    let same = object("mesh augment p01.toml --out orig.ply", &augmented);
    assert_eq!(same["volume_change_mm3"], 0.0);
    let bigger = object(
        "mesh augment p01.toml --shape big --offset-mm 2 --out big.ply",
        &augmented,
    );
    assert!((bigger["most_shift_mm"].as_f64().unwrap() - 2.0).abs() < 1e-3);
    // A dent of 3 mm where the joint centre is nearest to the skin.
    let joint = fs::read_to_string(folder.join("p01.toml")).unwrap();
    let joint = joint
        .lines()
        .find_map(|line| line.strip_prefix("joint_centre = "))
        .unwrap();
    let joint: String = joint.chars().filter(|c| !"[] ".contains(*c)).collect();
    let dent = format!("mesh augment p01.toml --bump {joint},-3,9 --out dent.ply");
    let dented = object(&dent, &augmented);
    let change = dented["volume_change_mm3"].as_f64().unwrap();
    // 2 pi sigma² h for a plane.
    assert!((-1.5..-0.5).contains(&(change / 1527.0)), "{change}");
    assert!((dented["most_shift_mm"].as_f64().unwrap() - 3.0).abs() < 0.3);
    object(
        "scene place p01.toml --angle 18",
        &["gap_mm", "penetration_mm", "room_from_patient"],
    );
    object(
        "scene room --out room.ply",
        &["points", "table", "room_from_device"],
    );
    object(
        "scene plane room.ply --seed 3",
        &["normal", "offset_mm", "inliers"],
    );
    let render = "depth render p01.ply --camera-from-mesh pose.json --out depth.png";
    object(
        render,
        &[
            "width",
            "height",
            "valid_pixels",
            "min_mm",
            "max_mm",
            "wall_s",
            "cpu_s",
        ],
    );
    let projected = object("depth project points.csv", &["pixels"]);
    assert!(projected["pixels"][0].is_array() && projected["pixels"][1].is_null());
    object(
        "xray spectrum --kvp 60 --filter Al:2.5 --filter Cu:0.1",
        &[
            "mean_energy_kev",
            "hvl1_mm_al",
            "hvl2_mm_al",
            "fluence_per_mas_cm2_at_1m",
            "kerma_ugy_per_mas_at_1m",
        ],
    );
    let attenuation = [
        "photoelectric_cm2_g",
        "rayleigh_cm2_g",
        "compton_cm2_g",
        "total_cm2_g",
    ];
    object(
        "xray materials --material water --energy-kev 60",
        &attenuation,
    );
    object(
        "xray materials --composition H:0.112,O:0.888 --density 1 --energy-kev 60",
        &attenuation,
    );
    let audit = [
        "voxels",
        "outside_mask",
        "voxel_mm3",
        "metal_cm3",
        "mass_g",
        "segments",
        "bin_hu",
        "clipped_below",
        "clipped_above",
    ];
    let whole = object("xray audit p01.nii", &audit);
    let limb = object("xray audit p01.toml", &audit);
    assert!(limb["outside_mask"].as_u64() > whole["outside_mask"].as_u64());
    for segment in whole["segments"].as_array().unwrap() {
        let bins = segment["bins"].as_array().unwrap().iter();
        let binned: u64 = bins.map(|bin| bin["voxels"].as_u64().unwrap()).sum();
        assert_eq!(Some(binned), segment["voxels"].as_u64(), "{segment}");
    }
    let simulated = object(
        "xray simulate p01.toml --angle 18 --engine analog --histories 20000 --out x.png --exr x.exr --dicom x.dcm --protocol ankle_mortise",
        &["projections", "histories", "engine", "wall_s", "cpu_s"],
    );
    let indices = ["exposure_index", "target_exposure_index", "deviation_index"];
    let exposed = object(
        "xray simulate p01.toml --out y.png --target-exposure-index 400",
        &indices,
    );
    let [index, target, deviation] = indices.map(|key| exposed[key].as_f64().unwrap());
    assert_eq!(target, 400.0);
    assert!((deviation - 10.0 * (index / 400.0).log10()).abs() < 1e-9);
    // With automatic exposure control the exposure index is the target; half the tube load gives half of it.
    let controlled = object("xray simulate p01.toml --out z.png --aec 300", &indices);
    let deviation = controlled["deviation_index"].as_f64().unwrap();
    assert!(deviation.abs() < 0.1, "{controlled}");
    let mas = controlled["projections"][0]["mas"].as_f64().unwrap();
    let half = format!("xray simulate p01.toml --out half.png --mas {}", 0.5 * mas);
    let half = object(&half, &indices);
    let [whole, half] = [controlled, half].map(|found| found["exposure_index"].as_f64().unwrap());
    assert!((half / whole - 0.5).abs() < 0.01, "{half} of {whole}");
    for category in ["primary", "compton", "rayleigh", "multiple"] {
        for suffix in ["", "_se"] {
            let key = format!("{category}_ev_per_history{suffix}");
            assert!(simulated["projections"][0][&key].is_f64(), "{key}");
        }
    }
    object(
        "metrics predictions.csv",
        &[
            "n",
            "mse",
            "mae",
            "spearman",
            "accuracy",
            "diagnostic_accuracy",
            "sensitivity",
            "specificity",
        ],
    );
    let test = object(
        "stats permutation pairs.csv",
        &["mean_difference", "p_one_sided", "p_two_sided", "patterns"],
    );
    assert_eq!(test["patterns"], 8);
    let folds = object("stats permutation folds.csv", &["mean_difference"]);
    assert_eq!(
        (&folds["patterns"], &folds["mean_difference"]),
        (&4.into(), &1.5.into())
    );
}
