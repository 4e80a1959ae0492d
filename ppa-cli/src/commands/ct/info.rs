//! `ppa ct info`: properties of a CT, and the import audit.

use std::path::PathBuf;

use clap::Args;
use ppa_ct::audit::{Audit, Severity};
use ppa_ct::{Acquisition, Info};
use ppa_dataset::write_whole;
use ppa_report::audit_page;
use serde::Serialize;

use crate::output::Output;
use crate::output_files::ReplaceArgs;
use crate::scan_args::ScanArgs;

#[derive(Debug, Args)]
pub struct InfoArgs {
    #[command(flatten)]
    scan: ScanArgs,
    /// Write the audit as an HTML page with slices and a histogram
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

/// Output of the command.
#[derive(Serialize)]
struct Audited {
    #[serde(flatten)]
    info: Info,
    acquisition: Acquisition,
    #[serde(flatten)]
    audit: Audit,
}

pub fn run(args: &InfoArgs, output: Output) -> anyhow::Result<()> {
    if let Some(report) = &args.report {
        let mut outputs = args.replace.outputs();
        outputs.file_in_new_folder("--report", report, &[".html", ".htm"])?;
    }
    let scan = args.scan.read()?;
    // Blocks of voxels as floats, and a mask of tissue.
    scan.volume.expect_room(8)?;
    let audited = Audited {
        info: Info::of(&scan),
        acquisition: scan.acquisition.clone(),
        audit: Audit::of(&scan),
    };
    if let Some(path) = &args.report {
        write_whole(path, audit_page(&scan, &audited.audit).as_bytes())?;
    }
    output.print(&audited, describe)
}

fn describe(audited: &Audited) -> String {
    // The findings repeat the reader's warnings.
    let facts = Info {
        warnings: Vec::new(),
        ..audited.info.clone()
    };
    let mut lines = vec![super::describe(&facts)];
    for finding in &audited.audit.findings {
        lines.push(format!("{:<10} {}", finding.severity, finding.text));
        if finding.severity > Severity::Note {
            lines.push(format!("           depth images: {}", finding.depth_images));
            lines.push(format!("           radiographs: {}", finding.radiographs));
        }
    }
    lines.join("\n")
}
