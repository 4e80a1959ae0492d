//! Damaged DICOM files give an error or the right volume, never anything else.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ppa_ct::{ReadOptions, Scan, read_with};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

use crate::real::data;

/// One small file of every encoding.
fn corpus() -> Vec<PathBuf> {
    let mut files = vec![
        data("hand-reencoded/enhanced-ct-shuffled-frames.dcm"),
        data("enhanced-ct-2frames/eCT_Supplemental.dcm"),
    ];
    let hand = ["unsigned-shuffled", "rle", "jpegll", "jpegls", "j2k"];
    let hand = hand.map(|name| format!("hand-reencoded/dicom-{name}"));
    let first = hand.iter().map(|folder| {
        let entries = std::fs::read_dir(data(folder)).unwrap();
        let files = entries.map(|e| e.unwrap().path());
        files.min().unwrap()
    });
    files.extend(first);
    let slices = std::fs::read_dir(data("one-slice-all-syntaxes")).unwrap();
    let mut slices = slices.map(|e| e.unwrap().path()).collect::<Vec<_>>();
    slices.retain(|path| path.extension().is_some_and(|e| e == "dcm"));
    slices.sort();
    files.extend(slices);
    files
}

fn try_read(path: &Path) -> Option<Scan> {
    let force = ReadOptions {
        force: true,
        ..ReadOptions::default()
    };
    read_with(path, &force).ok()
}

fn name(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name().unwrap().to_string_lossy()
}

#[test]
#[ignore = "needs ../shared/data"]
fn a_file_cut_anywhere_is_an_error_or_whole() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.dcm");
    for path in corpus() {
        let bytes = std::fs::read(&path).unwrap();
        let whole = try_read(&path).map(|scan| scan.volume);
        for percent in 0..100 {
            std::fs::write(&cut, &bytes[..bytes.len() * percent / 100]).unwrap();
            let found = try_read(&cut).map(|scan| scan.volume);
            assert!(
                found.is_none() || found == whole,
                "{} at {percent} %",
                name(&path)
            );
        }
    }
}

/// The file with its first fragment of pixels truncated; all lengths and delimiters around it are correct.
fn with_cut_fragment(bytes: &[u8], percent: usize) -> Option<Vec<u8>> {
    const ITEM: [u8; 4] = [0xfe, 0xff, 0, 0xe0];
    let pixels = bytes.windows(4).rposition(|w| w == [0xe0, 0x7f, 0x10, 0])?;
    let items = pixels + 12;
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    (bytes[items..items + 4] == ITEM).then_some(())?;
    let fragment = items + 8 + number(items + 4);
    let kept = number(fragment + 4) * percent / 100 / 2 * 2;
    let mut cut = bytes[..fragment + 4].to_vec();
    cut.extend((kept as u32).to_le_bytes());
    cut.extend(&bytes[fragment + 8..fragment + 8 + kept]);
    cut.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    Some(cut)
}

/// The decoders must detect damage that the container does not show.
#[test]
#[ignore = "needs ../shared/data"]
fn a_compressed_frame_cut_anywhere_is_an_error_or_whole() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.dcm");
    let mut compressed = 0;
    for path in corpus() {
        let bytes = std::fs::read(&path).unwrap();
        let Some(whole) = try_read(&path).map(|scan| scan.volume) else {
            continue;
        };
        let mut tried = 0;
        for percent in (0..100).step_by(3).chain([99]) {
            let Some(bytes) = with_cut_fragment(&bytes, percent) else {
                continue;
            };
            tried += 1;
            std::fs::write(&cut, bytes).unwrap();
            if let Some(found) = try_read(&cut) {
                assert!(found.volume == whole, "{} at {percent} %", name(&path));
            }
        }
        compressed += usize::from(tried > 0);
    }
    assert_eq!(compressed, 13, "files with fragments");
}

/// Bytes changed, duplicated and removed at random: no panic, and no memory beyond what files of this size may need.
///
/// `PPA_FUZZ_SECONDS` makes it run longer, `PPA_FUZZ_SEED` selects other damage.
#[test]
#[ignore = "needs ../shared/data"]
fn damaged_files_do_not_panic() {
    let setting = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u64>().ok());
    let limit = Duration::from_secs(setting("PPA_FUZZ_SECONDS").unwrap_or(5));
    let seed = setting("PPA_FUZZ_SEED").unwrap_or(1);
    let mut rng = TestRng::from_seed(RngAlgorithm::ChaCha, &{
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        bytes
    });
    let files = corpus().into_iter().map(|path| {
        let bytes = std::fs::read(&path).unwrap();
        (path, bytes)
    });
    let files = files.collect::<Vec<_>>();
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("damaged.dcm");
    let (start, mut runs, mut survived) = (Instant::now(), 0, 0);
    while start.elapsed() < limit {
        let (_, bytes) = &files[rng.next_u32() as usize % files.len()];
        std::fs::write(&damaged, mutated(bytes, &mut rng)).unwrap();
        survived += usize::from(try_read(&damaged).is_some());
        runs += 1;
    }
    println!("{runs} damaged files, {survived} of them still readable");
    // The largest file of the corpus holds 3.3 million pixels of 16 bits.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let peak_kib = peak.and_then(|p| p.trim().trim_end_matches(" kB").parse::<u64>().ok());
    assert!(peak_kib.is_none_or(|kib| kib < 1 << 20), "{peak_kib:?} KiB");
}

fn mutated(bytes: &[u8], rng: &mut TestRng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    // Lengths and sizes are in headers; half of the damage goes there.
    let header = bytes.windows(4).rposition(|w| w == [0xe0, 0x7f, 0x10, 0]);
    let header = header.map_or(bytes.len(), |at| at + 1024).min(bytes.len());
    for _ in 0..1 + rng.next_u32() % 4 {
        let reach = if rng.next_u32().is_multiple_of(2) {
            header
        } else {
            bytes.len()
        };
        let at = rng.next_u32() as usize % reach.min(bytes.len()).max(1);
        let Some(byte) = bytes.get_mut(at) else {
            break;
        };
        match rng.next_u32() % 8 {
            0 => *byte = 0xff,
            1 => *byte = 0,
            2 => *byte ^= 1 << (rng.next_u32() % 8),
            3 => bytes.truncate(at),
            4 => {
                let end = (at + rng.next_u32() as usize % 64).min(bytes.len());
                bytes.drain(at..end);
            }
            5 => {
                let end = (at + rng.next_u32() as usize % 64).min(bytes.len());
                let doubled = bytes[at..end].to_vec();
                bytes.splice(at..at, doubled);
            }
            _ => *byte = rng.next_u32() as u8,
        }
    }
    bytes
}
