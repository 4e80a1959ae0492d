//! The comments in a plan file: headings, meanings of keys, and settings that are off. A new key gets its line here.

/// Header of a plan file.
pub(crate) const HEADER: &str = "\
# Plan of a dataset: `ppa plan` estimates its cost, `ppa generate` generates it.
# Every key is listed with its default; a line may be deleted. Lines that begin with # and no
# space are optional settings: remove the # to use them. Lengths in mm, angles in degrees.
# Relative paths are resolved against the folder of this file.

";

/// Purpose of each table, by its name in the file.
pub(crate) const TABLES: &[(&str, &str)] = &[
    ("[[case]]", "The limbs. Cases come from `ppa prepare`."),
    (
        "[rotation]",
        "Medial rotations about the limb's axis, multiples of 0.5 between 0 and 180.",
    ),
    (
        "[shapes]",
        "Body shapes: the skin of the scan and variants of it.",
    ),
    (
        "[soft_tissue]",
        "Indentation of heel and calf where they rest; 0 is a rigid skin.",
    ),
    (
        "[positioning]",
        "Positioning errors; by default the joint is on the central beam.",
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
    ("[xray.source]", "Focal spot, heel effect and collimation."),
    ("[xray.source.focal_spot]", ""),
    ("[xray.detector]", "Pixels of the radiograph."),
    (
        "[xray.receptor]",
        "Anti-scatter grid and converter of the detector.",
    ),
    (
        "[xray.engine]",
        "The fast engine; the seed of the plan applies, not this one.",
    ),
    (
        "[xray.analog]",
        "Analog Monte Carlo, in place of [xray.engine].",
    ),
    (
        "[xray.presentation]",
        "Window and contrast of the 16-bit radiograph.",
    ),
    ("[xray.calibration]", ""),
];

/// Meaning of each key, by table and key.
pub(crate) const KEYS: &[(&str, &str, &str)] = &[
    ("", "version", "format of this file"),
    ("", "seed", "seed of all random numbers"),
    ("case", "file", "case file written by `ppa prepare`"),
    (
        "case",
        "patient",
        "N of the folder patient_N; both limbs of a person share it",
    ),
    ("shapes", "variants", "orig is the skin of the scan"),
    (
        "shapes",
        "offset_mm",
        "offset of big outwards and of small inwards",
    ),
    ("shapes", "bumps", "bumps of bumps_a and of bumps_b"),
    (
        "positioning",
        "tilt_deg",
        "above 0 lifts the proximal end, below 0 the distal end",
    ),
    (
        "positioning",
        "beam_shift_mm",
        "from the joint to the beam: towards the patient's left, towards the head",
    ),
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
        "xray.marker",
        "centre_mm",
        "of the letter R on the detector; the L of left limbs has the opposite x",
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
        "limb kept along its axis on either side of the joint, or of the shifted beam",
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
        "whose quantum noise the image has; inf: no noise",
    ),
    (
        "xray.engine",
        "scatter_histories",
        "histories followed for scatter",
    ),
    (
        "xray.engine",
        "scatter_pixel_mm",
        "spacing of the points where scatter is computed",
    ),
    (
        "xray.engine",
        "samples_per_side",
        "largest number of rays per pixel side, at edges",
    ),
    (
        "xray.engine",
        "compton_model",
        "model of Compton scattering",
    ),
    ("xray.engine", "seed", "must be 0"),
    (
        "xray.analog",
        "histories",
        "photons followed per radiograph",
    ),
    (
        "xray.analog",
        "compton_model",
        "model of Compton scattering",
    ),
    ("xray.analog", "seed", "must be 0"),
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
        "contrast of large areas is divided by 1 + this x log exposure",
    ),
    (
        "xray.presentation",
        "detail",
        "share by which the contrast of faint detail is increased",
    ),
];

/// Settings that are off by default, as they are written below the keys of their table.
pub(crate) const OFF: &[(&str, &[&str])] = &[
    (
        "",
        &["#room_file = \"room.toml\"    # room, device, detector and cameras from a file"],
    ),
    (
        "room",
        &[
            "#ply = \"recorded.ply\"    # a recorded room in place of the built-in furniture",
            "#room_from_device = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1040], [0, 0, 0, 1]]    # pose of the device in it: row-major 4x4",
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
            "#marker = { centre_mm = [-75, -95] }    # the letter L or R on the detector; x is that of right limbs",
            "#max_cut_share = 0.01    # a limb is refused if more of the rays around the joint pass through a cut face",
            "#calibration_file = \"hu.toml\"    # HU to material and density from a file, instead of the table below",
        ],
    ),
    (
        "xray.source",
        &[
            "#blades_mm = 250    # from the focal spot to the collimator blades: the field gets a penumbra",
            "#extrafocal = { ratio = 0.08, size_mm = 20 }    # extrafocal radiation over that of the focal spot; needs blades_mm",
            "#heel_effect = { anode_towards_deg = -90 }    # from the device's x towards its y; -90 is the head's side",
        ],
    ),
    (
        "xray.receptor",
        &[
            "#collection_swank = 0.92    # noise of the collection of light in CsI; needs a converter",
            "#grid = { ratio = 8, lines_per_cm = 40, focus_mm = 1100 }    # anti-scatter grid; with moving = false the image shows its lines",
            "#gain_error = 0.01    # relative standard deviation of the pixels' gains after calibration",
            "#panel = 1    # serial number of the panel; 0 by default; each has its own pattern of gains",
            "#blur = { lorentzian = { h_mm2 = 0.45 } }    # of the converter; add noise_h_mm2 = 0.3 for noise that is blurred less",
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
pub(crate) const OFF_TABLES: &str = "
# Search for the table top; without it, the table is the surface that the central beam hits first.
#[room.table]
#threshold_mm = 10.0    # from the plane up to which a point belongs to it
#iterations = 1000
#up = [0.0, 0.0, 1.0]
#max_tilt_deg = 20.0
#cell_mm = 60.0    # of the lattice that separates patches
#min_area_mm2 = 60000.0
#region = [[-500, -500, -100], [500, 1500, 100]]    # low and high corner of the box to search
#beam = [[0, 0, 1040], [0, 0, -1]]    # source and direction of the central beam
#min_beam_mm = 300.0    # from the source

# Errors of the cameras' sensors; without them, depth images are ideal. These are the limits of the
# Azure Kinect; `ppa depth fit-noise` finds those of a device.
#[depth.sensor]
#random = { floor_mm = 0, at_unit_signal_mm = 1.14 }
#systematic = { offset_mm = 5.5, per_metre_mm = 0.5, fixed_pattern_mm = 0 }
#mixed = { modulation_mhz = 200 }
#invalid = { min_signal = 0.067, max_angle_deg = 85, min_contrast = 0.9 }
#multipath = { albedo = 0.5, modulation_mhz = 200 }
";

/// Comment before the table of materials, which is long and rarely changed.
pub(crate) const CALIBRATION: &str =
    "# HU to material and density, the built-in table: remove all # below to change it.\n";
