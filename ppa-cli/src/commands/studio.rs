//! `ppa studio`: the browser interface.

use std::io::Write;
use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;

use anyhow::{Context, bail};
use clap::Args;
use ppa_core::Roi;
use ppa_studio::{Endpoint, Networks, Opening, Studio, Watch, serve};
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::allocator::return_freed_memory;
use crate::number_lists::square;
use crate::output::{Output, working};
use crate::side_name::SideName;
use crate::stderr::warning;

#[derive(Debug, Args)]
pub struct StudioArgs {
    /// Scan, case, plan, dataset, training run or folder of training runs to open [default: the built-in phantom, in the folder ppa-studio; nothing with --watch]
    path: Option<PathBuf>,
    /// Side of the limb; needed for a scan without a case, and with --watch by networks that were trained with `mirror = true`
    #[arg(long, value_enum)]
    side: Option<SideName>,
    /// After PATH: folders of finished training runs whose networks judge the poses in step 5, for the left and the right camera, or one
    /// for both
    #[arg(long, value_name = "DIR", num_args = 1..=2)]
    run: Vec<PathBuf>,
    /// File that `ppa calibrate` wrote for these networks
    #[arg(long, value_name = "FILE", requires = "run")]
    confidence: Option<PathBuf>,
    /// Show in step 8 the predictions for the newest frames in this folder, which are named as for `ppa predict --watch`
    #[arg(long, value_name = "DIR", requires_all = ["run", "roi_left", "roi_right"])]
    watch: Option<PathBuf>,
    /// Square around the joint in the left camera's frames, in pixels, as in `roi_depth.json`
    #[arg(long, value_name = "X,Y,SIZE", value_parser = square, requires = "watch")]
    roi_left: Option<Roi>,
    /// The same in the right camera's frames
    #[arg(long, value_name = "X,Y,SIZE", value_parser = square, requires = "watch")]
    roi_right: Option<Roi>,
    /// Port to listen on [default: that of the last studio on PATH, or a free one]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Address to listen on; any other than this machine's own needs --i-know
    #[arg(long, value_name = "IP", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// Listen on an address that other machines reach
    #[arg(long)]
    i_know: bool,
    /// Do not open a browser
    #[arg(long)]
    no_open: bool,
}

#[derive(Debug, Serialize)]
struct Served {
    address: String,
}

impl StudioArgs {
    fn networks(&self) -> anyhow::Result<Option<Networks>> {
        let (left, right) = match &*self.run {
            [] => return Ok(None),
            [left] => (left, None),
            [left, right] => (left, Some(right)),
            more => bail!(
                "--run specifies {} folders, expected one or two",
                more.len()
            ),
        };
        Ok(Some(Networks {
            left: left.clone(),
            right: right.cloned(),
            confidence: self.confidence.clone(),
        }))
    }

    /// The folder or file shown by the page; the built-in phantom is in the working folder.
    fn shown(&self) -> &Path {
        let shown = self.path.as_ref().or(self.watch.as_ref());
        shown.map_or(Path::new("."), PathBuf::as_path)
    }

    fn watched(&self) -> Option<Watch> {
        Some(Watch {
            folder: self.watch.clone()?,
            regions: [self.roi_left?, self.roi_right?],
            side: self.side.map(Into::into),
        })
    }
}

pub fn run(args: &StudioArgs, output: Output) -> anyhow::Result<()> {
    if !args.bind.is_loopback() {
        const MEANING: &str = "anyone who can reach this address and learns the token, which is sent unencrypted, can see the scan, change the case and the plan, and make datasets next to the plan";
        if !args.i_know {
            bail!(
                "--bind {} is reachable from other machines: {MEANING}; forward a port over ssh instead, or give --i-know",
                args.bind
            );
        }
        warning(MEANING);
    }
    return_freed_memory();
    let last = Endpoint::file_of(args.shown());
    let Endpoint { listener, token } =
        Endpoint::open((args.bind, args.port).into(), last.as_deref())?;
    let working = working("finding the limb");
    let opening = Opening {
        path: args.path.clone(),
        side: args.side.map(Into::into),
        networks: args.networks()?,
        watch: args.watched(),
    };
    let studio = Studio::open_with(&opening, token)?;
    working.finish_and_clear();
    let mut signals = Signals::new([SIGINT, SIGTERM]).context("cannot listen for Ctrl-C")?;
    let served = Served {
        address: studio.address(listener.local_addr()?),
    };
    output.print(&served, |served| {
        format!("{}\nCtrl-C ends the program", served.address)
    })?;
    std::io::stdout().flush()?;
    if !args.no_open {
        open_browser(&served.address);
    }
    let (stop, stopped) = channel();
    std::thread::spawn(move || {
        signals.forever().next();
        // Dropping it ends the service.
        drop(stop);
    });
    serve(studio, listener, stopped)?;
    Ok(())
}

/// Opens the page in the user's browser, if there is one; the address is printed in any case.
fn open_browser(address: &str) {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let silent = Stdio::null;
    let _ = Command::new(opener)
        .arg(address)
        .stdin(silent())
        .stdout(silent())
        .stderr(silent())
        .spawn();
}
