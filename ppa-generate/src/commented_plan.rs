//! A plan with every key and its meaning, as a template.

use std::path::Path;

use ppa_dataset::files::write_whole;

use crate::case::{Case, CaseError};
use crate::plan::{Plan, PlanCase, PlanError};
use crate::toml_file::{relative_to, to_toml};

const HEADER: &str = "\
# Plan of a dataset: `ppa plan` estimates its cost, `ppa generate` generates it.
# Every key is listed with its default; a line may be deleted. Lines that begin with # and no
# space are optional settings: remove the # to use them. Lengths in mm, angles in degrees.
# Relative paths start at this file.

";

/// What a table is for; the key is its name in the file.
const TABLES: &[(&str, &str)] = &[
    ("[[case]]", "The limbs. Cases come from `ppa prepare`."),
    (
        "[rotation]",
        "Medial rotations about the limb's axis, multiples of 0.5 between 0 and 180.",
    ),
    (
        "[shapes]",
        "Body shapes: the skin of the scan and changed ones.",
    ),
    (
        "[soft_tissue]",
        "How far heel and calf sink in where they rest; 0 is a rigid skin.",
    ),
    (
        "[room]",
        "The x-ray room. `ppa scene room --toml room.toml` writes a room file instead.",
    ),
    (
        "[room.parametric]",
        "The built-in room; source_detector_mm also holds for a recorded one.",
    ),
    ("[depth]", "Depth images of both cameras."),
    ("[xray]", "Radiographs."),
    ("[xray.source]", "Where photons leave from, and where to."),
    ("[xray.source.focal_spot]", ""),
    ("[xray.detector]", "Pixels of the radiograph."),
    ("[xray.receptor]", "What the detector makes of photons."),
    (
        "[xray.engine]",
        "How much is computed; the plan's seed decides, not this one.",
    ),
    (
        "[xray.analog]",
        "Analog Monte Carlo, which makes the radiographs in place of [xray.engine].",
    ),
    (
        "[xray.presentation]",
        "Window and contrast of the 16-bit radiograph.",
    ),
    ("[xray.calibration]", ""),
];

/// What a key means, by table and key.
const KEYS: &[(&str, &str, &str)] = &[
    ("", "version", "format of this file"),
    ("", "seed", "everything random follows from it"),
    ("case", "file", "what `ppa prepare` wrote"),
    (
        "case",
        "patient",
        "N of the folder patient_N; both limbs of a person share it",
    ),
    ("shapes", "variants", "orig is the skin of the scan"),
    (
        "shapes",
        "offset_mm",
        "big is the skin moved out by this, small in",
    ),
    ("shapes", "bumps", "bumps of bumps_a and of bumps_b"),
    (
        "room.parametric",
        "table_foot_mm",
        "table beyond the central beam on the feet's side",
    ),
    (
        "room.parametric",
        "source_detector_mm",
        "from the x-ray source to the detector",
    ),
    (
        "room.parametric",
        "table_detector_mm",
        "from the table top down to the detector",
    ),
    (
        "room.parametric",
        "column_distance_mm",
        "from the central beam towards -x, as back_wall_mm",
    ),
    (
        "room.parametric",
        "head_wall_mm",
        "from the central beam towards +y",
    ),
    (
        "room.parametric",
        "point_spacing_mm",
        "of the room's point cloud",
    ),
    (
        "depth",
        "roi_mm",
        "side of the square around the joint, at the joint",
    ),
    (
        "depth",
        "cut_faces",
        "pixels that see a cut face of the scan: \"invalid\" or \"flat\"",
    ),
    (
        "depth",
        "max_cut_share",
        "a limb is refused if more of a region of interest is cut",
    ),
    ("xray", "kvp", "tube voltage"),
    (
        "xray.tube_load",
        "mas",
        "replaces dose_histories; or exposure_index = 250",
    ),
    (
        "xray.source",
        "blades_mm",
        "from the focal spot to the collimator blades",
    ),
    ("xray", "anode_angle_deg", "of the tungsten anode"),
    ("xray", "filters", "MATERIAL:mm"),
    (
        "xray",
        "half_length_mm",
        "limb kept on either side of the joint",
    ),
    (
        "xray",
        "max_voxel_mm",
        "thicker slices are interpolated to this",
    ),
    (
        "xray",
        "interpolation",
        "between centres of voxels; or \"nearest\"",
    ),
    (
        "xray",
        "form_factors",
        "of coherent scattering; or \"molecular\"",
    ),
    (
        "xray.source",
        "collimation",
        "or { rectangle = { size_mm = [180, 240] } }",
    ),
    ("xray.source.focal_spot", "size_mm", "0 is a point"),
    ("xray.source.focal_spot", "shape", "or \"gaussian\""),
    (
        "xray.detector",
        "centre_mm",
        "from the central beam, device x and y",
    ),
    (
        "xray.receptor",
        "model",
        "or { csi = { thickness_um = 600 } }",
    ),
    (
        "xray.receptor",
        "electronic_noise_kev",
        "standard deviation per pixel",
    ),
    (
        "xray.engine",
        "dose_histories",
        "whose quantum noise the image carries; inf: no noise",
    ),
    ("xray.engine", "scatter_histories", "followed for scatter"),
    (
        "xray.engine",
        "scatter_pixel_mm",
        "distance of the points where scatter is computed",
    ),
    (
        "xray.engine",
        "samples_per_side",
        "rays per pixel side at edges, at most",
    ),
    (
        "xray.engine",
        "compton_model",
        "how photons scatter off electrons",
    ),
    ("xray.engine", "seed", "stays 0"),
    (
        "xray.analog",
        "histories",
        "photons followed per radiograph",
    ),
    (
        "xray.analog",
        "compton_model",
        "how photons scatter off electrons",
    ),
    ("xray.analog", "seed", "stays 0"),
    (
        "xray.presentation",
        "centre",
        "of the window in log exposure",
    ),
    (
        "xray.presentation",
        "width",
        "of the window in log exposure",
    ),
    (
        "xray.presentation",
        "latitude_reduction",
        "large areas lose contrast by 1 + this x log exposure",
    ),
    (
        "xray.presentation",
        "detail",
        "contrast of faint detail that is added",
    ),
];

/// Settings that are off by default, as they are written below the keys of their table.
const OFF: &[(&str, &[&str])] = &[
    (
        "",
        &["#room_file = \"room.toml\"    # room, device, detector and cameras from a file"],
    ),
    (
        "room",
        &[
            "#ply = \"recorded.ply\"    # a recorded room in place of the built-in furniture",
            "#room_from_device = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1040], [0, 0, 0, 1]]    # in it: row-major 4x4",
        ],
    ),
    (
        "depth",
        &[
            "#rig = \"rig.json\"    # other cameras; or both written out as [depth.cameras], as in a room file",
        ],
    ),
    (
        "xray",
        &[
            "#analog = { histories = 20000000 }    # analog Monte Carlo in place of [xray.engine]: photons followed per radiograph",
            "#tube_load = { exposure_index = 250 }    # automatic exposure control, or { mas = 4 }; replaces dose_histories below",
            "#max_cut_share = 0.01    # a limb is refused if more of the rays around the joint pass through a cut face",
            "#calibration_file = \"hu.toml\"    # HU to material and density from a file, instead of the table below",
        ],
    ),
    (
        "xray.source",
        &[
            "#blades_mm = 250    # from the focal spot to the collimator blades: the field gets a penumbra",
            "#heel_effect = { anode_towards_deg = -90 }    # from the device's x towards its y; -90 is the head's side",
        ],
    ),
    (
        "xray.receptor",
        &[
            "#collection_swank = 0.92    # noise of the collection of light in CsI; needs a converter",
            "#grid = { ratio = 8, lines_per_cm = 40, focus_mm = 1100 }    # anti-scatter grid",
            "#blur = { lorentzian = { h_mm2 = 0.45 } }    # of the converter",
        ],
    ),
    (
        "xray.presentation",
        &[
            "#protocol = \"limb\"    # a presentation by name; keys above that differ from it take precedence",
        ],
    ),
];

/// Tables that are off by default, at the end of the file.
const OFF_TABLES: &str = "
# How the table top is searched; left out, it is what the central beam hits first.
#[room.table]
#threshold_mm = 10.0    # from the plane up to which a point belongs to it
#iterations = 1000
#up = [0.0, 0.0, 1.0]
#max_tilt_deg = 20.0
#cell_mm = 60.0    # of the lattice that separates patches
#min_area_mm2 = 60000.0
#region = [[-500, -500, -100], [500, 1500, 100]]    # low and high corner of where it is looked for
#beam = [[0, 0, 1040], [0, 0, -1]]    # source and direction of the central beam
#min_beam_mm = 300.0    # from the source

# Errors of the cameras' sensors; left out, depth images are ideal. These are the limits of the
# Azure Kinect; `ppa depth fit-noise` finds those of a device.
#[depth.sensor]
#random = { floor_mm = 0, at_unit_signal_mm = 1.14 }
#systematic = { offset_mm = 5.5, per_metre_mm = 0.5, fixed_pattern_mm = 0 }
#mixed = { modulation_mhz = 200 }
#invalid = { min_signal = 0.067, max_angle_deg = 85, min_contrast = 0.9 }
#multipath = { albedo = 0.5, modulation_mhz = 200 }
";

/// What is written before the table of materials, which is long and rarely changed.
const CALIBRATION: &str =
    "# HU to material and density, the built-in table: remove all # below to change it.\n";

impl Plan {
    /// A plan with the defaults for cases in files. Cases of one scan are limbs of one patient; patients are numbered from 0.
    ///
    /// # Errors
    /// [`CaseError`] for a case that cannot be read.
    pub fn of_cases<'a>(files: impl IntoIterator<Item = &'a Path>) -> Result<Self, CaseError> {
        let mut scans: Vec<String> = Vec::new();
        let mut cases = Vec::new();
        for file in files {
            let scan = Case::read(file)?.source.volume_sha256;
            let known = scans.iter().position(|known| *known == scan);
            let patient = known.unwrap_or_else(|| {
                scans.push(scan);
                scans.len() - 1
            });
            cases.push(PlanCase {
                file: file.to_owned(),
                patient: patient as u32,
            });
        }
        Ok(Self::new(cases))
    }

    /// Writes the plan with what every key means and with the settings that are off, whole or not at all. Relative paths are
    /// rewritten to start at the plan file's folder.
    ///
    /// # Errors
    /// [`PlanError::File`], also for a path that is not UTF-8, which TOML cannot hold.
    pub fn write_commented(&self, path: &Path) -> Result<(), PlanError> {
        let mut plan = self.clone();
        let folder = path.parent().unwrap_or(Path::new(""));
        for file in plan.files_mut() {
            *file = relative_to(file, folder)?;
        }
        let text = commented(&to_toml(&plan, path)?);
        Ok(write_whole(path, text.as_bytes())?)
    }
}

/// A plan as TOML with comments.
fn commented(toml: &str) -> String {
    let given: toml::Table = toml.parse().expect("what was just written");
    let mut text = HEADER.to_owned();
    let mut table = String::new();
    let mut is_calibration = false;
    for line in toml.lines() {
        if line.starts_with('[') {
            text.truncate(text.trim_end().len());
            text.push('\n');
            off(&mut text, &table, &given);
            text.push('\n');
            let began = is_calibration;
            table = line.trim_matches(['[', ']']).to_owned();
            is_calibration = table.starts_with("xray.calibration");
            if is_calibration && !began {
                text.push_str(CALIBRATION);
            }
            let meaning = TABLES.iter().find(|(name, _)| *name == line);
            if let Some((_, meaning)) = meaning.filter(|(_, meaning)| !meaning.is_empty()) {
                text.push_str(&format!("# {meaning}\n"));
            }
        }
        let key = line.split(" = ").next().unwrap_or_default();
        let means = KEYS
            .iter()
            .find(|(of, name, _)| *of == table && *name == key);
        let comment = means.map_or(String::new(), |(.., meaning)| format!("    # {meaning}"));
        let switched_off = if is_calibration && !line.is_empty() {
            "#"
        } else {
            ""
        };
        text.push_str(&format!("{switched_off}{line}{comment}\n"));
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    off(&mut text, &table, &given);
    text + OFF_TABLES
}

/// Adds the settings of a table that are off; `given` holds those that are not.
fn off(text: &mut String, table: &str, given: &toml::Table) {
    let mut keys = Some(given);
    for name in table.split('.').filter(|name| !name.is_empty()) {
        keys = keys.and_then(|keys| keys.get(name)?.as_table());
    }
    let is_given = |line: &str| {
        let key = line.trim_start_matches('#').split(" = ").next();
        keys.is_some_and(|keys| key.is_some_and(|key| keys.contains_key(key)))
    };
    let lines = OFF.iter().filter(|(of, _)| *of == table);
    for line in lines
        .flat_map(|(_, lines)| *lines)
        .filter(|line| !is_given(line))
    {
        text.push_str(line);
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::technique::Technique;

    fn plan() -> Plan {
        Plan::new(vec![PlanCase {
            file: "leg.case.toml".into(),
            patient: 0,
        }])
    }

    fn text() -> String {
        commented(&to_toml(&plan(), Path::new("plan.toml")).unwrap())
    }

    /// The settings that are off, switched on.
    fn switched_on(text: &str) -> String {
        let on = |line: &str| match line.strip_prefix('#') {
            Some(setting) if !setting.starts_with(' ') => format!("{setting}\n"),
            _ => format!("{line}\n"),
        };
        text.lines().map(on).collect()
    }

    #[test]
    fn a_commented_plan_reads_as_the_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        let expected = Plan::new(vec![PlanCase {
            file: folder.path().join("leg.case.toml"),
            patient: 0,
        }]);
        expected.write_commented(&path).unwrap();
        assert_eq!(Plan::read(&path).unwrap(), expected);
    }

    #[test]
    fn settings_that_are_off_are_valid_once_switched_on() {
        let text = switched_on(&text());
        let read: Plan = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert!(read.room_file.is_some() && read.room.table.is_some());
        assert!(read.depth.sensor.is_some() && read.xray.receptor.grid.is_some());
        assert_eq!(read.xray.calibration, plan().xray.calibration);
    }

    /// Switched on, a setting would stand there twice.
    #[test]
    fn settings_of_a_technique_are_not_among_those_off() {
        for (_, technique) in Technique::ALL {
            let mut plan = plan();
            technique.apply(&mut plan.xray);
            let text = commented(&to_toml(&plan, Path::new("plan.toml")).unwrap());
            let read: Plan = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(read.xray, plan.xray);
            for key in ["#tube_load", "#heel_effect", "#blades_mm", "#blur"] {
                assert!(!text.contains(key), "{key}\n{text}");
            }
            assert!(text.contains("#grid"));
        }
    }

    /// Serde names the keys that it expects when it meets another one.
    #[test]
    fn every_key_of_a_plan_stands_in_it() {
        let text = switched_on(&text());
        let mut tables: Vec<&str> = text
            .lines()
            .filter(|line| line.starts_with('[') && !line.starts_with("[["))
            .map(|line| line.trim_matches(['[', ']']))
            .filter(|table| !table.starts_with("xray.calibration"))
            .collect();
        assert!(tables.len() >= 13, "{tables:?}");
        tables.push("");
        // Written out in a room file.
        let elsewhere = ["depth.cameras"];
        for table in tables {
            let header = format!("[{table}]\n");
            let odd = if table.is_empty() {
                format!("no_such_key = 1\n{text}")
            } else {
                text.replacen(&header, &format!("{header}no_such_key = 1\n"), 1)
            };
            let error = toml::from_str::<Plan>(&odd).unwrap_err().to_string();
            let (_, expected) = error
                .split_once("expected")
                .unwrap_or_else(|| panic!("{error}"));
            let keys: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
            assert!(!keys.is_empty(), "{error}");
            for key in keys {
                let path = if table.is_empty() {
                    key.to_owned()
                } else {
                    format!("{table}.{key}")
                };
                let begin = if table.is_empty() {
                    0
                } else {
                    text.find(&header).unwrap() + header.len()
                };
                let end = text[begin..]
                    .find("\n[")
                    .map_or(text.len(), |at| begin + at);
                let here = text[begin..end]
                    .lines()
                    .any(|line| line.starts_with(&format!("{key} = ")));
                let as_table =
                    text.contains(&format!("[{path}]")) || text.contains(&format!("[{path}."));
                assert!(
                    here || as_table || elsewhere.contains(&&*path),
                    "{path} is missing"
                );
            }
        }
    }
}
