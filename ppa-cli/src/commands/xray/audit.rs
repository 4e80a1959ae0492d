//! `ppa xray audit`: materials and densities that a HU calibration assigns to a CT or a limb.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use ppa_core::text::{count, number};
use ppa_ct::ReadOptions;
use ppa_generate::Case;
use ppa_xray::{Audit, HuBin, HuCalibration};

use crate::findings::prepared;
use crate::output::{Output, working};
use crate::scan_args::ScanArgs;

#[derive(Debug, Args)]
pub struct AuditArgs {
    #[command(flatten)]
    scan: ScanArgs,
    /// HU calibration (TOML) in place of the built-in one
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
}

pub fn run(args: &AuditArgs, output: Output) -> anyhow::Result<()> {
    let calibration = match &args.calibration {
        Some(path) => HuCalibration::read(path)?,
        None => HuCalibration::default(),
    };
    let working = working("reading the scan");
    let path = &args.scan.path;
    let audit = if path.extension().is_some_and(|ending| ending == "toml") {
        anyhow::ensure!(
            args.scan.options() == ReadOptions::default(),
            "{} is a case, which states how its scan is read: --series, --fill-gaps and --force apply only to scans",
            path.display()
        );
        let case = Case::read(path)?;
        let prepared = prepared(&case, path)?;
        calibration.audit(&prepared.volume, Some(&prepared.limb.mask))?
    } else {
        calibration.audit(&args.scan.read()?.volume, None)?
    };
    working.finish_and_clear();
    output.print(&audit, describe)
}

/// Largest number of characters in a row of bars.
const WIDTH: usize = 40;

fn describe(audit: &Audit) -> String {
    let histogram = HistogramRows::of(audit);
    let mut text = format!(
        "{:<16}{:>10}{:>12}{:>10}{:>9}{:>8}  {}\n",
        "segment",
        "voxels",
        "volume cm³",
        "mass g",
        "from HU",
        "to HU",
        histogram.caption()
    );
    let mut line = |text_line: std::fmt::Arguments| {
        text.write_fmt(text_line)
            .expect("a String takes everything");
    };
    for segment in &audit.segments {
        let hu = |hu: Option<f32>| hu.map_or("-".to_owned(), |hu| format!("{:.0}", number(hu)));
        line(format_args!(
            "{:<16}{:>10}{:>12.2}{:>10.2}{:>9}{:>8}  {}\n",
            segment.name,
            segment.voxels,
            segment.volume_cm3,
            segment.mass_g,
            hu(segment.lowest_hu),
            hu(segment.highest_hu),
            histogram.row(&segment.bins)
        ));
        if segment.below_curve + segment.above_curve > 0 {
            line(format_args!(
                "  beyond its density curve: {} below, {} above\n",
                count(segment.below_curve, "voxel"),
                segment.above_curve
            ));
        }
    }
    line(format_args!(
        "{:.2} g, {:.2} cm³ of metal{}\n",
        audit.mass_g,
        audit.metal_cm3,
        match audit.outside_mask {
            0 => String::new(),
            outside => format!(", {} outside the limb", count(outside, "voxel")),
        }
    ));
    line(format_args!(
        "lowest {:.0} HU in {}{}, highest {:.0} HU in {}{}",
        number(audit.lowest_hu),
        count(audit.voxels_at_lowest, "voxel"),
        match audit.clipped_below {
            0 => "",
            _ => " (clipped, or filled in outside the field of view)",
        },
        number(audit.highest_hu),
        audit.voxels_at_highest,
        match audit.clipped_above {
            0 => "",
            _ => " (clipped, or filled in: values above cannot be distinguished)",
        },
    ));
    text
}

/// Histograms as rows of bars; each character covers the same number of bins in all rows, with logarithmic height.
struct HistogramRows {
    bin_hu: f32,
    hu_per_bar: f32,
    most: f64,
}

impl HistogramRows {
    fn of(audit: &Audit) -> Self {
        let bin_hu = f32::from(audit.bin_hu);
        let widths = audit
            .segments
            .iter()
            .map(|segment| match &segment.bins[..] {
                [] => 0.0,
                [first, .., last] => last.from_hu - first.from_hu + bin_hu,
                [_] => bin_hu,
            });
        // A row whose first bin is not at the start of a bar needs one bar more.
        let bins_per_bar = (widths.fold(0.0, f32::max) / bin_hu / (WIDTH - 1) as f32).ceil();
        let mut histogram = Self {
            bin_hu,
            hu_per_bar: bins_per_bar.max(1.0) * bin_hu,
            most: 1.0,
        };
        let rows = audit
            .segments
            .iter()
            .flat_map(|segment| histogram.sums(&segment.bins));
        histogram.most = rows.fold(1, usize::max) as f64;
        histogram
    }

    fn caption(&self) -> String {
        format!("voxels per {} HU, logarithmic", self.hu_per_bar)
    }

    /// Number of voxels in each bar from the first to the last non-empty one.
    fn sums(&self, bins: &[HuBin]) -> Vec<usize> {
        let bar = |bin: &HuBin| ((bin.from_hu + 0.5 * self.bin_hu) / self.hu_per_bar).floor();
        let Some(first) = bins.first().map(bar) else {
            return Vec::new();
        };
        let mut sums = Vec::new();
        for bin in bins {
            let at = (bar(bin) - first) as usize;
            sums.resize(at + 1, 0);
            sums[at] += bin.voxels;
        }
        sums
    }

    fn row(&self, bins: &[HuBin]) -> String {
        let glyph = |voxels: usize| match voxels {
            0 => ' ',
            _ => {
                let share = (voxels as f64).ln_1p() / self.most.ln_1p();
                ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'][(8.0 * share).ceil() as usize - 1]
            }
        };
        self.sums(bins).into_iter().map(glyph).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use ppa_ct::{Grid, Volume};

    use super::*;

    /// Messages mention a limb only if one was cut out, not for a bare scan.
    #[test]
    fn voxels_outside_a_limb_are_reported_only_of_a_limb() {
        let grid = Grid::axis_aligned([3, 1, 1], Vector3::repeat(1.0), Point3::origin()).unwrap();
        let scan = Volume::new(grid, vec![-1_000.0, 40.0, 900.0]).unwrap();
        let report =
            |mask: Option<&[bool]>| describe(&HuCalibration::default().audit(&scan, mask).unwrap());
        assert!(!report(None).contains("limb"), "{}", report(None));
        let limb = report(Some(&[false, true, true]));
        assert!(limb.contains(", 1 voxel outside the limb"), "{limb}");
    }

    /// Two neighbouring bins per bar, an empty bar between, the fullest bar the highest, every voxel counted.
    #[test]
    fn bars_stand_for_neighbouring_bins() {
        let bin = |from_hu, voxels| HuBin { from_hu, voxels };
        let bins = [bin(-50.0, 1), bin(0.0, 400), bin(50.0, 599), bin(200.0, 30)];
        let histogram = HistogramRows {
            bin_hu: 50.0,
            hu_per_bar: 100.0,
            most: 999.0,
        };
        assert_eq!(histogram.sums(&bins), [1, 999, 0, 30]);
        assert_eq!(histogram.row(&bins), "▁█ ▄");
        assert_eq!(histogram.row(&[]), "");
    }
}
