//! Reads a scan, sums its voxels, and prints both times: `cargo run --release -p ppa-ct --example read_and_sum -- PATH`.
//!
//! `benches/peers/dicom_reading.py` compares it with SimpleITK and pydicom.

use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("expected a path")?;
    let start = Instant::now();
    let scan = ppa_ct::read(Path::new(&path))?;
    let read_s = start.elapsed().as_secs_f64();
    let sum = ppa_ct::Info::of_volume(&scan.volume).hu_sum;
    let all_s = start.elapsed().as_secs_f64();
    println!("sum {sum}, read in {read_s:.3} s, summed after {all_s:.3} s");
    Ok(())
}
