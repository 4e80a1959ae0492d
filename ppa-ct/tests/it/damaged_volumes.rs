//! Damaged files give an error or the right volume, never a panic or wrong values.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ppa_ct::{Volume, read, write};
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use crate::real::data;
use crate::volumes::small;

const NAMES: [&str; 5] = ["v.nii", "v.nii.gz", "v.nrrd", "v.mha", "v.mhd"];

/// One way to damage a file.
#[derive(Debug, Clone)]
enum Damage {
    Set(Index, u8),
    Flip(Index, u8),
    Cut(Index),
    Remove(Index, Index),
    Repeat(Index, Index),
    /// A word of a text header, or of another file, inserted at a random position.
    Insert(Index, Vec<u8>),
}

impl Damage {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let range = |a: &Index, b: &Index, len: usize| {
            let (a, b) = (a.index(len), b.index(len));
            a.min(b)..a.max(b)
        };
        let len = bytes.len();
        match self {
            Self::Set(at, value) => bytes[at.index(len)] = *value,
            Self::Flip(at, bit) => bytes[at.index(len)] ^= 1 << bit,
            Self::Cut(at) => bytes.truncate(at.index(len)),
            Self::Remove(a, b) => drop(bytes.drain(range(a, b, len))),
            Self::Repeat(a, b) => {
                let range = range(a, b, len.min(4096));
                let copy = bytes[range.clone()].to_vec();
                bytes.splice(range.end..range.end, copy);
            }
            Self::Insert(at, word) => {
                let at = at.index(len);
                bytes.splice(at..at, word.iter().copied());
            }
        }
    }
}

fn damage() -> impl Strategy<Value = Damage> {
    // Most weak points of a format are in its first bytes.
    let place = || any::<Index>();
    let words: Vec<Vec<u8>> = [
        "-1",
        "0",
        "4294967296",
        "1e308",
        "nan",
        "\n",
        "\n\n",
        ": ",
        " = ",
        "gzip",
        "raw",
        "LOCAL",
        "LIST",
        "True",
        "(",
        ",",
        ")",
        "%",
        "double",
        "MET_DOUBLE",
        "\u{7f}",
        "1 1 1 1 1 1 1 1 1",
        "data file: v.raw\n",
        "byte skip: -1\n",
        "HeaderSize = -1\n",
        "space: RAS\n",
    ]
    .iter()
    .map(|w| w.as_bytes().to_vec())
    .collect();
    prop_oneof![
        (place(), any::<u8>()).prop_map(|(at, v)| Damage::Set(at, v)),
        (place(), 0..8_u8).prop_map(|(at, b)| Damage::Flip(at, b)),
        place().prop_map(Damage::Cut),
        (place(), place()).prop_map(|(a, b)| Damage::Remove(a, b)),
        (place(), place()).prop_map(|(a, b)| Damage::Repeat(a, b)),
        (place(), prop::sample::select(words)).prop_map(|(at, w)| Damage::Insert(at, w)),
    ]
}

/// The data file of the `.mhd` in a folder.
fn data_file(folder: &Path) -> PathBuf {
    let mut files = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let is_zraw = |path: &PathBuf| path.extension().is_some_and(|e| e == "zraw");
    files.find(is_zraw).unwrap()
}

/// Replaces a file's bytes by damaged ones and reads the scan; it must not have more voxels than fit
/// in a file.
fn read_damaged(
    header: &Path,
    file: &Path,
    right: &[u8],
    damage: &[Damage],
) -> Result<(), TestCaseError> {
    let mut bytes = right.to_vec();
    // Half of the damage goes to the header, where it has the most effect.
    let head = bytes.len().min(600);
    let tail = bytes.split_off(head);
    let (first, second) = damage.split_at(damage.len() / 2);
    first.iter().for_each(|d| d.apply(&mut bytes));
    bytes.extend(tail);
    second.iter().for_each(|d| d.apply(&mut bytes));
    fs::write(file, &bytes)?;
    if let Ok(scan) = read(header) {
        let beside = fs::read_dir(header.parent().unwrap())?;
        let longest = beside.map(|e| e.unwrap().metadata().unwrap().len()).max();
        prop_assert!(scan.volume.hu().len() as u64 <= 1032 * longest.unwrap());
        prop_assert!(scan.volume.hu().iter().all(|v| v.is_finite()));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn spoiled_files_do_no_harm(
        name in prop::sample::select(NAMES.to_vec()),
        spoil_data_file in any::<bool>(),
        damage in prop::collection::vec(damage(), 1..6),
    ) {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join(name);
        write(&path, &small())?;
        let spoiled = if name == "v.mhd" && spoil_data_file {
            data_file(folder.path())
        } else {
            path.clone()
        };
        let right = fs::read(&spoiled)?;
        read_damaged(&path, &spoiled, &right, &damage)?;
    }
}

#[test]
fn a_cut_file_is_an_error_at_every_length() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["v.nrrd", "v.mha", "v.mhd"] {
        let path = folder.path().join(name);
        write(&path, &small()).unwrap();
        let mut files = vec![path.clone()];
        files.extend((name == "v.mhd").then(|| data_file(folder.path())));
        for cut in files {
            let bytes = fs::read(&cut).unwrap();
            for length in 0..bytes.len() {
                fs::write(&cut, &bytes[..length]).unwrap();
                // The last line feed of a header with a separate data file is not needed.
                let complete = cut == path && name == "v.mhd" && length + 1 == bytes.len();
                assert_eq!(read(&path).is_ok(), complete, "{length} of {}", bytes.len());
            }
            fs::write(&cut, &bytes).unwrap();
        }
    }
}

#[test]
fn a_flipped_bit_in_packed_voxels_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["v.nrrd", "v.mha", "v.mhd"] {
        let path = folder.path().join(name);
        write(&path, &small()).unwrap();
        let file = match name {
            "v.mhd" => data_file(folder.path()),
            _ => path.clone(),
        };
        let bytes = fs::read(&file).unwrap();
        let magic: &[u8] = if name == "v.nrrd" {
            &[0x1f, 0x8b]
        } else {
            &[0x78, 0x01]
        };
        let start = bytes.windows(2).position(|w| w == magic).unwrap();
        // Ten bytes of the gzip header are not checked, such as the time; zlib's flags are.
        let first = start + if name == "v.nrrd" { 10 } else { 0 };
        for at in first..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            fs::write(&file, damaged).unwrap();
            // A copy from another position may still decode to the same bytes.
            let harmless = |scan: ppa_ct::Scan| scan.volume == small();
            assert!(read(&path).map_or(true, harmless), "{name}: byte {at}");
        }
    }
}

/// A header file of the shared data, its data file, and the volume they give.
struct Sample {
    header: PathBuf,
    voxels: PathBuf,
    volume: Volume,
}

/// The shared files of one reader, copied to a folder where they can be damaged.
fn samples(folder: &Path, names: &[&str]) -> Vec<Sample> {
    let copy = |name: &str| {
        let to = folder.join(Path::new(name).file_name().unwrap());
        // Not `fs::copy`: the copy must be writable.
        fs::write(&to, fs::read(data(name)).unwrap()).unwrap();
        to
    };
    let sample = |name: &&str| {
        let header = copy(name);
        let voxels = match *name {
            "hand-reencoded/hand.mhd" => copy("hand-reencoded/hand.raw"),
            "hand-reencoded/hand_z.mhd" => copy("hand-reencoded/hand_z.zraw"),
            "hand-reencoded/hand_raw_detached.nhdr" => copy("hand-reencoded/hand_raw_detached.raw"),
            _ => header.clone(),
        };
        let volume = read(&header).unwrap().volume;
        Sample {
            header,
            voxels,
            volume,
        }
    };
    names.iter().map(sample).collect()
}

const NIFTI: &[&str] = &[
    "hand-reencoded/hand_int16.nii.gz",
    "hand-reencoded/hand_bigendian.nii.gz",
    "head-phantom-oblique-nifti/CT_pitch.nii.gz",
];
const NRRD: &[&str] = &[
    "hand-reencoded/hand_gzip_lps.nrrd",
    "hand-reencoded/hand_ras_f32.nrrd",
    "hand-reencoded/hand_raw_detached.nhdr",
];
const META_IMAGE: &[&str] = &[
    "hand-reencoded/hand.mha",
    "hand-reencoded/hand.mhd",
    "hand-reencoded/hand_z.mhd",
    "lung-mha/3DCT_lung_baseline_small.mha",
];

/// Header and data file truncated at each percent of their length.
#[test]
#[ignore = "needs ../shared/data"]
fn real_files_cut_at_each_percent_are_errors_or_right() {
    let folder = tempfile::tempdir().unwrap();
    let names = [NIFTI, NRRD, META_IMAGE].concat();
    for sample in samples(folder.path(), &names) {
        let files = [&sample.header, &sample.voxels];
        let different = 1 + usize::from(sample.header != sample.voxels);
        for file in &files[..different] {
            let bytes = fs::read(file).unwrap();
            for percent in 0..100 {
                fs::write(file, &bytes[..bytes.len() * percent / 100]).unwrap();
                if let Ok(scan) = read(&sample.header) {
                    let name = sample.header.display();
                    assert_eq!(scan.volume, sample.volume, "{name} at {percent} %");
                }
            }
            fs::write(file, &bytes).unwrap();
        }
    }
}

/// Damages shared files for a second; `PPA_FUZZ_SECONDS` makes it run longer, `PPA_FUZZ_SEED` selects other damage.
fn spoil_for_a_while(names: &[&str]) {
    let setting = |name: &str| std::env::var(name).map_or(1, |v| v.parse::<u64>().unwrap());
    let end = Instant::now() + Duration::from_secs(setting("PPA_FUZZ_SECONDS"));
    let folder = tempfile::tempdir().unwrap();
    let samples = samples(folder.path(), names);
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&setting("PPA_FUZZ_SEED").to_le_bytes());
    let random = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut random = TestRunner::new_with_rng(ProptestConfig::default(), random);
    let spoil = prop::collection::vec(damage(), 1..6);
    let mut rounds = 0;
    while Instant::now() < end {
        for sample in &samples {
            for file in [&sample.header, &sample.voxels] {
                let right = fs::read(file).unwrap();
                let damage = spoil.new_tree(&mut random).unwrap().current();
                let harmless = read_damaged(&sample.header, file, &right, &damage);
                fs::write(file, &right).unwrap();
                harmless.unwrap_or_else(|e| panic!("{}: {damage:?}: {e}", file.display()));
                rounds += 1;
            }
        }
    }
    println!("{rounds} spoiled files");
}

#[test]
#[ignore = "needs ../shared/data"]
fn real_nifti_spoiled_at_length() {
    spoil_for_a_while(NIFTI);
}

#[test]
#[ignore = "needs ../shared/data"]
fn real_nrrd_spoiled_at_length() {
    spoil_for_a_while(NRRD);
}

#[test]
#[ignore = "needs ../shared/data"]
fn real_meta_image_spoiled_at_length() {
    spoil_for_a_while(META_IMAGE);
}
