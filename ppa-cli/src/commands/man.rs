//! `ppa man`: manual pages of all commands.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;
use ppa_core::text::count;
use ppa_dataset::write_whole;
use serde_json::json;

use crate::Cli;
use crate::output::Output;

#[derive(Debug, Args)]
#[command(after_long_help = "\
  ppa man --out ~/.local/share/man/man1
  man ppa-ct-info")]
pub struct ManArgs {
    /// Folder for the pages, created if it is missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Overwrite pages that differ, such as those of another version
    #[arg(long)]
    replace: bool,
}

pub fn run(args: &ManArgs, output: Output) -> anyhow::Result<()> {
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let mut pages = Vec::new();
    collect(&command, &mut pages)?;
    if !args.replace {
        for (name, page) in &pages {
            let path = args.out.join(name);
            anyhow::ensure!(
                !path.exists() || std::fs::read(&path).is_ok_and(|there| there == *page),
                "{} exists and differs; --replace overwrites it",
                path.display()
            );
        }
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    for (name, page) in &pages {
        write_whole(&args.out.join(name), page)?;
    }
    let names: Vec<_> = pages.iter().map(|(name, _)| name).collect();
    output.print(&json!({ "out": args.out, "pages": names }), |_| {
        let pages = count(names.len(), "manual page");
        format!("{}: {pages}", args.out.display())
    })
}

/// File name and text of the pages of a command and all commands below it.
fn collect(command: &Command, pages: &mut Vec<(String, Vec<u8>)>) -> anyhow::Result<()> {
    let man = Man::new(command.clone());
    let mut page = Vec::new();
    man.render(&mut page)?;
    pages.push((man.get_filename(), page));
    for subcommand in command.get_subcommands().filter(|one| !one.is_hide_set()) {
        collect(subcommand, pages)?;
    }
    Ok(())
}
