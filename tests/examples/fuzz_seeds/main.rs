//! Writes the initial fuzzing corpus: `fuzz_seeds FOLDER` makes a folder for each target, with a few valid files each.
//!
//! Not part of `fuzz/`, where everything is compiled for the fuzzer.

mod streams;
mod texts;

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use ppa_ct::{Grid, Volume};
use ppa_depth::{CameraSpec, DepthMode};

/// Input of the codec targets: columns, rows, 1 for 8 bits, and the frame.
fn frame(size: [u8; 2], bits: u8, frame: &[u8]) -> Vec<u8> {
    [&[size[0], size[1], u8::from(bits == 8)], frame].concat()
}

/// Input of targets that take the kind of file from the first byte.
fn tagged(kind: u8, bytes: impl AsRef<[u8]>) -> Vec<u8> {
    [&[kind], bytes.as_ref()].concat()
}

struct Corpus(PathBuf);

impl Corpus {
    fn put(&self, target: &str, name: &str, bytes: impl AsRef<[u8]>) -> std::io::Result<()> {
        let folder = self.0.join(target);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(name), bytes)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = std::env::args_os().nth(1).ok_or("expected a folder")?;
    let corpus = Corpus(root.into());
    let work = tempfile::tempdir()?;
    volumes(&corpus, work.path())?;
    frames(&corpus)?;
    meshes(&corpus)?;
    let camera = serde_text(&CameraSpec::azure_kinect(DepthMode::NfovUnbinned));
    corpus.put("camera", "camera.json", tagged(0, camera))?;
    for (target, name, kind, text) in texts::TEXTS {
        match kind {
            Some(kind) => corpus.put(target, name, tagged(*kind, text))?,
            None => corpus.put(target, name, text)?,
        }
    }
    Ok(())
}

/// The camera as JSON.
fn serde_text(camera: &CameraSpec) -> String {
    serde_json::to_string(camera).expect("a camera is JSON")
}

/// A small volume in every format.
fn volumes(corpus: &Corpus, work: &Path) -> Result<(), Box<dyn Error>> {
    let grid = Grid::axis_aligned([4, 3, 2], Vector3::new(1.0, 2.0, 3.0), Point3::origin())?;
    let volume = Volume::from_i16(grid, (0..24).map(|n| 40 * n - 1000).collect())?;
    for (target, name) in [
        ("nifti", "scan.nii"),
        ("nifti", "scan.nii.gz"),
        ("nrrd", "scan.nrrd"),
        ("meta_image", "scan.mha"),
    ] {
        let path = work.join(name);
        ppa_ct::write(&path, &volume)?;
        corpus.put(target, name, fs::read(&path)?)?;
    }
    let folder = work.join("slices");
    ppa_ct::write_dicom(&folder, &volume)?;
    for slice in fs::read_dir(folder)? {
        let slice = slice?.path();
        let name = slice.file_name().expect("a file has a name");
        corpus.put("dicom", &name.to_string_lossy(), fs::read(&slice)?)?;
    }
    Ok(())
}

/// A frame of 8 x 8 pixels compressed by every codec.
fn frames(corpus: &Corpus) -> Result<(), Box<dyn Error>> {
    let pixels: Vec<u8> = (0..64).map(|n| 4 * n).collect();
    let grey = libjpeg_turbo_rs::PixelFormat::Grayscale;
    let sampling = libjpeg_turbo_rs::Subsampling::S444;
    let baseline = libjpeg_turbo_rs::compress(&pixels, 8, 8, grey, 90, sampling)?;
    let lossless = libjpeg_turbo_rs::compress_lossless(&pixels, 8, 8, grey)?;
    for (target, name, bits, stream) in [
        ("jpeg", "baseline", 8, baseline),
        ("jpeg", "lossless", 8, lossless),
        ("rle", "runs", 16, streams::rle()),
        ("jpeg_2000", "empty", 8, streams::jpeg_2000(8)),
    ] {
        corpus.put(target, name, frame([8, 8], bits, &stream))?;
    }
    Ok(corpus.put("jpeg_ls", "standard", frame([4, 4], 8, &streams::jpeg_ls()))?)
}

/// A triangle in every format.
fn meshes(corpus: &Corpus) -> Result<(), Box<dyn Error>> {
    let triangle = "0 0 0\n1 0 0\n0 1 0\n";
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n{triangle}3 0 1 2\n"
    );
    let obj: String = triangle.lines().map(|line| format!("v {line}\n")).collect();
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let mut binary = vec![0; 80];
    binary.extend(1_u32.to_le_bytes());
    binary.extend([0; 50]);
    corpus.put("mesh", "text.ply", tagged(0, ply))?;
    corpus.put("mesh", "text.obj", tagged(1, obj + "f 1 2 3\n"))?;
    corpus.put("mesh", "text.stl", tagged(2, stl))?;
    Ok(corpus.put("mesh", "binary.stl", tagged(2, binary))?)
}
