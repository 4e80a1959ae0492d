//! Tests of plans: what is read, written and refused.

use ppa_xray::{Blur, Collimation, DetectorModel, Receptor, Source, SpotShape};

use super::*;

fn read(xray: &str) -> Result<Plan, PlanError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    let case = "version = 1\n[[case]]\nfile = \"a.toml\"\npatient = 0\n";
    std::fs::write(&path, format!("{case}{xray}")).unwrap();
    Plan::read(&path)
}

/// Source and receptor as a user writes them; what is written by a program reads back the same.
#[test]
fn source_and_receptor_are_read_from_the_plan() {
    let plan = read(
        r#"
        [xray.source]
        focal_spot = { size_mm = 0.6, shape = "gaussian" }
        heel_effect = { anode_towards_deg = 90 }
        collimation = { rectangle = { size_mm = [180, 240] } }
        [xray.receptor]
        model = { csi = { thickness_um = 500 } }
        grid = { ratio = 8, lines_per_cm = 40, focus_mm = 1100 }
        blur = { lorentzian = { h_mm2 = 0.45 } }
        electronic_noise_kev = 90
        "#,
    )
    .unwrap();
    let (source, receptor) = (&plan.xray.source, &plan.xray.receptor);
    assert_eq!(source.focal_spot.shape, SpotShape::Gaussian);
    assert!(matches!(
        source.collimation,
        Collimation::Rectangle {
            size_mm: [180.0, 240.0],
            centre_mm: [0.0, 0.0]
        }
    ));
    assert!(matches!(
        receptor.model,
        DetectorModel::Csi { packing: 0.8, .. }
    ));
    assert_eq!(receptor.blur, Some(Blur::lorentzian(0.45)));
    assert_eq!(receptor.grid.as_ref().unwrap().strip, "lead");
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.toml");
    plan.write(&copy).unwrap();
    let again = Plan::read(&copy).unwrap();
    assert_eq!(
        (&again.xray.source, &again.xray.receptor),
        (source, receptor)
    );
}

/// Keys that are left out are not written, so that plans of earlier programs keep their text and hash.
#[test]
fn noise_transfers_are_read_and_written_only_where_given() {
    let folder = tempfile::tempdir().unwrap();
    let written = |receptor: &str| {
        let plan = read(&format!("[xray.receptor]\n{receptor}\n")).unwrap();
        let copy = folder.path().join("copy.toml");
        plan.write(&copy).unwrap();
        assert_eq!(Plan::read(&copy).unwrap().xray.receptor, plan.xray.receptor);
        let text = std::fs::read_to_string(&copy).unwrap();
        std::fs::remove_file(copy).unwrap();
        (plan.xray.receptor.blur.unwrap(), text)
    };
    let keys = |text: &str| {
        let keys = text.lines().filter(|line| !line.starts_with('#'));
        keys.filter(|line| line.contains("noise_h") || line.starts_with("noise = "))
            .count()
    };
    let (blur, text) = written("blur = { lorentzian = { h_mm2 = 0.45 } }");
    assert_eq!((blur, keys(&text)), (Blur::lorentzian(0.45), 0));
    let (blur, text) = written("blur = { lorentzian = { h_mm2 = 0.45, noise_h_mm2 = 0.3 } }");
    let expected = Blur::Lorentzian {
        h_mm2: 0.45,
        noise_h_mm2: Some(0.3),
    };
    assert_eq!((blur, keys(&text)), (expected, 1));
    let table = "blur = { mtf = { per_mm = [1, 2], mtf = [0.7, 0.4], noise = [0.8, 0.6] } }";
    let (blur, text) = written(table);
    assert!(matches!(blur, Blur::Mtf { noise: Some(noise), .. } if noise == [0.8, 0.6]));
    assert_eq!(keys(&text), 1, "{text}");
}

#[test]
fn gains_of_a_panel_are_read_and_written_only_where_given() {
    let folder = tempfile::tempdir().unwrap();
    for (keys, expected) in [("", (0.0, 0)), ("gain_error = 0.01\npanel = 3", (0.01, 3))] {
        let plan = read(&format!("[xray.receptor]\n{keys}\n")).unwrap();
        let receptor = &plan.xray.receptor;
        assert_eq!((receptor.gain_error, receptor.panel), expected);
        let copy = folder.path().join(format!("copy{}.toml", keys.len()));
        plan.write(&copy).unwrap();
        assert_eq!(&Plan::read(&copy).unwrap().xray.receptor, receptor);
        let text = std::fs::read_to_string(&copy).unwrap();
        let mut lines = text.lines();
        let written = lines.any(|line| line.starts_with("gain_error") || line.starts_with("panel"));
        assert_eq!(written, !keys.is_empty(), "{text}");
    }
}

#[test]
fn grids_move_unless_the_plan_says_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    for (key, moving) in [
        ("", true),
        (", moving = true", true),
        (", moving = false", false),
    ] {
        let keys = format!("grid = {{ ratio = 8, lines_per_cm = 40{key} }}");
        let plan = read(&format!("[xray.receptor]\n{keys}\n")).unwrap();
        assert_eq!(plan.xray.receptor.grid.as_ref().unwrap().moving, moving);
        let copy = folder.path().join(format!("copy{}.toml", key.len()));
        plan.write(&copy).unwrap();
        assert_eq!(Plan::read(&copy).unwrap().xray.receptor, plan.xray.receptor);
        let text = std::fs::read_to_string(&copy).unwrap();
        let mut keys = text.lines().filter(|line| !line.starts_with('#'));
        assert_eq!(keys.any(|line| line.contains("moving")), !moving);
    }
}

#[test]
fn left_out_they_are_a_point_and_an_ideal_detector() {
    let plan = read("").unwrap();
    assert_eq!(plan.xray.source, Source::default());
    assert_eq!(plan.xray.receptor, Receptor::default());
}

#[test]
fn what_cannot_work_is_named() {
    for (more, words) in [
        (
            "[shapes]\nbumps = [1000000000, 3]\n",
            "shapes.bumps holds 1000000000",
        ),
        ("[shapes]\nbumps = [2, 0]\n", "expected 1 to 100 bumps"),
        ("[shapes]\noffset_mm = 101\n", "at most 100 mm"),
        ("[xray.engine]\nseed = 5\n", "xray.engine.seed"),
        ("[xray.analog]\nseed = 5\n", "xray.analog.seed"),
        (
            "[xray.analog]\nhistories = 0\n",
            "xray.analog.histories is 0",
        ),
    ] {
        let error = read(more).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

/// A newer format may have unknown keys; its version is reported first.
#[test]
fn another_version_is_reported_before_its_keys() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    std::fs::write(&path, "version = 2\n[holograms]\ncount = 3\n").unwrap();
    let error = Plan::read(&path).unwrap_err();
    assert!(
        matches!(error, PlanError::Version { found: 2, .. }),
        "{error}"
    );
}

/// `plans/paper` is the published dataset's size.
#[test]
fn the_shipped_plan_has_the_papers_size() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../plans/paper/plan.toml");
    let plan = Plan::read(&path).unwrap();
    let poses = plan.cases.len() * plan.rotation.poses().unwrap().len();
    assert_eq!((plan.cases.len(), poses), (17, 3077));
    assert_eq!(poses * 2 * plan.shapes.variants.len(), 30_770);
    let mut patients: Vec<_> = plan.cases.iter().map(|case| case.patient).collect();
    patients.dedup();
    assert_eq!(patients, (0..17).collect::<Vec<_>>());
}

#[test]
fn unknown_keys_are_named() {
    for (xray, word) in [
        ("[xray.source]\nfocal_spot_mm = 0.6\n", "focal_spot_mm"),
        ("[xray.receptor]\nmodel = \"film\"\n", "film"),
        ("[xray.receptor]\ngrid = { ratio = 8 }\n", "lines_per_cm"),
    ] {
        let error = read(xray).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

/// Written to another folder, a plan still names the same files.
#[test]
fn a_plan_that_is_written_elsewhere_names_the_same_files() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::create_dir_all(root.join("plans")).unwrap();
    let path = root.join("plans/plan.toml");
    let text = "version = 1\n[[case]]\nfile = \"../a.case.toml\"\npatient = 0\n[room]\nply = \"room.ply\"\n[depth]\nrig = \"rig.json\"\n";
    std::fs::write(&path, text).unwrap();
    let plan = Plan::read(&path).unwrap();
    assert_eq!(plan.cases[0].file, root.join("plans/../a.case.toml"));
    for elsewhere in ["copy.toml", "plans/copy.toml", "other/copy.toml"] {
        let copy = root.join(elsewhere);
        plan.write(&copy).unwrap();
        assert_eq!(Plan::read(&copy).unwrap(), plan, "{elsewhere}");
    }

    // As a program in the current folder names its files.
    let mut plan = Plan::new(vec![PlanCase {
        file: "a.case.toml".into(),
        patient: 0,
    }]);
    plan.room.ply = Some("rooms/room.ply".into());
    plan.depth.rig = Some("rig.json".into());
    let here = std::env::current_dir().unwrap();
    let copy = root.join("copy.toml");
    plan.write(&copy).unwrap();
    let again = Plan::read(&copy).unwrap();
    let canonical = |path: &Path| {
        let folder = path.parent().unwrap().canonicalize().unwrap();
        folder.join(path.file_name().unwrap())
    };
    assert_eq!(canonical(&again.cases[0].file), here.join("a.case.toml"));
    assert_eq!(canonical(&again.depth.rig.unwrap()), here.join("rig.json"));
}

/// 448 pixels of 0.5 mm reach 112 mm to either side.
#[test]
fn a_marker_off_the_detector_is_refused() {
    let marker = |x: f64| read(&format!("[xray]\nmarker = {{ centre_mm = [{x}, -95] }}\n"));
    assert!(marker(-75.0).unwrap().xray.marker.is_some());
    let error = marker(-120.0).unwrap_err().to_string();
    assert!(error.contains("xray.marker"), "{error}");
}

#[test]
fn cameras_that_make_no_sense_are_refused_by_name() {
    let rig = toml::to_string(&ppa_depth::RigSpec::default()).unwrap();
    let with_focal_length = |fx: &str| {
        let table = |line: &str| match line.strip_prefix('[') {
            Some(rest) => format!("[depth.cameras.{rest}"),
            None => line.to_owned(),
        };
        let line = |line: &str| match line.starts_with("fx = ") {
            true => format!("fx = {fx}"),
            false => table(line),
        };
        let lines: Vec<String> = rig.lines().map(line).collect();
        read(&lines.join("\n"))
    };
    assert!(with_focal_length("500").unwrap().depth.cameras.is_some());
    let error = ppa_core::text::error_chain(&with_focal_length("-3").unwrap_err());
    assert!(
        error.contains("depth.cameras: left camera of the rig: camera focal length fx is -3"),
        "{error}"
    );
}

#[test]
fn room_beam_and_image_out_of_range_are_refused() {
    let refused = [
        (
            "[room.parametric]\ntable_length_mm = -5",
            "room.parametric: table_length_mm",
        ),
        (
            "[room.parametric]\nsource_detector_mm = 300",
            "room.parametric: source_detector_mm",
        ),
        ("[xray]\nkvp = 1000", "xray: tube voltage 1000 kV"),
        ("[xray]\nfilters = [\"Al\"]", "xray: "),
        (
            "[xray]\ndetector = { columns = 8, rows = 8, pixel_mm = -0.5 }",
            "xray: the pixel side is -0.5 mm",
        ),
        (
            "[xray]\ndetector = { columns = 0, rows = 8, pixel_mm = 1 }",
            "xray: the detector has 0 x",
        ),
        ("[xray.source]\nfocal_spot = { size_mm = 400 }", "xray: "),
        ("[xray.presentation]\nwidth = 0", "xray.presentation: "),
        (
            "[xray.receptor]\nelectronic_noise_kev = -1",
            "xray.receptor: the electronic noise per pixel in keV is -1",
        ),
        (
            "[xray.receptor]\ngrid = { ratio = 8, lines_per_cm = 40, strip_mm = 0.3 }",
            "xray.receptor: grid strips of 0.3 mm",
        ),
        (
            "[xray.engine]\nscatter_histories = 0",
            "xray.engine: the number of histories for the scatter is 0",
        ),
        (
            "[xray.engine]\nsamples_per_side = 0",
            "xray.engine: the number of rays per pixel side is 0",
        ),
    ];
    for (keys, expected) in refused {
        let error = ppa_core::text::error_chain(&read(keys).unwrap_err());
        assert!(error.contains(expected), "{keys}: {error}");
    }
    // A recorded room has no built-in table.
    let recorded = "[room]\nply = \"room.ply\"\n[room.parametric]\ntable_length_mm = -5";
    read(recorded).unwrap();
}
