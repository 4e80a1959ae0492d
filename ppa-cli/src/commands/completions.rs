//! `ppa completions`: completion scripts for shells.

use clap::Args;
use clap_complete::{Shell, generate};
use serde_json::json;

use crate::help;
use crate::output::Output;

#[derive(Debug, Args)]
#[command(after_long_help = "\
  ppa completions bash > ~/.local/share/bash-completion/completions/ppa
  ppa completions zsh  > \"${fpath[1]}/_ppa\"
  ppa completions fish > ~/.config/fish/completions/ppa.fish")]
pub struct CompletionsArgs {
    /// Shell to complete for
    #[arg(value_enum)]
    shell: Shell,
}

pub fn run(args: &CompletionsArgs, output: Output) -> anyhow::Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut help::command(), "ppa", &mut script);
    let script = String::from_utf8(script)?;
    let shell = args.shell.to_string();
    output.print(&json!({ "shell": shell, "script": script }), |_| {
        script.trim_end().to_owned()
    })
}
