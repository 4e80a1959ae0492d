//! Help, colours, completions, manual pages, and errors as JSON.

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;

use crate::{fail, names, phantom, ppa, succeed};

fn output(arguments: &str, environment: &[(&str, &str)]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let mut command = ppa(folder.path(), arguments);
    for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
        command.env_remove(name);
    }
    command.envs(environment.iter().copied()).output().unwrap()
}

#[test]
fn help_lists_commands_under_headings() {
    let help = succeed(phantom(), "--help");
    let at = |text: &str| {
        help.find(text)
            .unwrap_or_else(|| panic!("{text} in {help}"))
    };
    let order = [
        "Scan and case:",
        "  prepare ",
        "Dataset:",
        "  generate ",
        "Networks:",
        "  train ",
        "Options:",
        "--json",
    ];
    assert!(
        order.windows(2).all(|pair| at(pair[0]) < at(pair[1])),
        "{help}"
    );
    assert!(succeed(phantom(), "ct --help").contains("Commands:"));
}

#[test]
fn colours_follow_the_option_then_the_environment() {
    let escape = |bytes: &[u8]| bytes.contains(&0x1b);
    let always = ("CLICOLOR_FORCE", "1");
    for (arguments, environment, expected) in [
        ("--help", &[][..], false),
        ("--help --color always", &[], true),
        ("--help --color=always", &[("NO_COLOR", "1")], true),
        ("--help", &[always], true),
        ("--help --color never", &[always], false),
    ] {
        let said = output(arguments, environment);
        assert_eq!(
            escape(&said.stdout),
            expected,
            "{arguments} {environment:?}"
        );
    }
    let said =
        |arguments: &str, environment: &[(&str, &str)]| output(arguments, environment).stderr;
    assert!(escape(&said("ct info nowhere --color always", &[])));
    assert!(escape(&said("ct info nowhere", &[always])));
    assert!(!escape(&said("ct info nowhere --color never", &[always])));
    assert!(
        escape(&said("ct info --color always", &[])),
        "errors of usage"
    );
    let text = said("ct info nowhere", &[]);
    assert!(text.starts_with(b"ppa: ") && !escape(&text));
}

/// The object on stderr, which contains nothing else; stdout is empty.
fn failure(arguments: &str) -> Value {
    let said = output(arguments, &[]);
    let stderr = String::from_utf8(said.stderr).unwrap();
    assert!(said.stdout.is_empty(), "ppa {arguments} printed a result");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    let object: Value = serde_json::from_str(&stderr).unwrap();
    assert_eq!(object["exit_code"], said.status.code().unwrap());
    assert!(object["causes"].is_array(), "{object}");
    object
}

#[test]
fn errors_of_json_runs_are_objects() {
    let missing = failure("metrics nowhere.csv --json");
    assert_eq!(missing["exit_code"], 1);
    let text = missing["error"].as_str().unwrap();
    assert!(text.contains("nowhere.csv"), "{missing}");
    assert_eq!(missing["causes"].as_array().unwrap().len(), 1, "{missing}");

    for (arguments, part) in [
        ("metrics --json", "<CSV>"),
        ("--json metrics a.csv b.csv", "unexpected argument 'b.csv'"),
        (
            "generat plan --json",
            "tip: a similar subcommand exists: 'generate'",
        ),
        ("--json", "a command is missing"),
        ("ct --json", "a command is missing"),
        ("depth coverage x --json --color sideways", "'sideways'"),
    ] {
        let usage = failure(arguments);
        assert_eq!(usage["exit_code"], 2, "{usage}");
        let text = usage["error"].as_str().unwrap();
        assert!(text.contains(part), "{usage}");
        assert!(!text.contains("Usage") && !text.contains('\n'), "{usage}");
    }
    // Help is not a failure.
    assert!(output("metrics --help --json", &[]).status.success());
}

#[test]
fn completions_name_commands_and_options() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = succeed(phantom(), &format!("completions {shell}"));
        for word in ["generate", "coverage", "segment-bones"] {
            assert!(script.contains(word), "{word} for {shell}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let script = succeed(folder.path(), "completions bash");
    fs::write(folder.path().join("ppa.bash"), script).unwrap();
    let list = "source ppa.bash; COMP_WORDS=(ppa xray si); COMP_CWORD=2; _ppa ppa si xray; echo ${COMPREPLY[@]}";
    let bash = Command::new("bash")
        .args(["-c", list])
        .current_dir(folder.path())
        .output();
    if let Ok(completed) = bash {
        assert_eq!(String::from_utf8(completed.stdout).unwrap(), "simulate\n");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), "man --out pages");
    let pages = names(&folder.path().join("pages"));
    for page in ["ppa.1", "ppa-generate.1", "ppa-ct-info.1", "ppa-man.1"] {
        assert!(pages.iter().any(|name| name == page), "{page} in {pages:?}");
    }
    let read = |name: &str| fs::read_to_string(folder.path().join("pages").join(name)).unwrap();
    let page = read("ppa-ct-info.1");
    assert!(
        page.contains(".TH ppa-ct-info 1") && page.contains("fill\\-gaps"),
        "{page}"
    );
    assert!(read("ppa.1").contains("ppa\\-generate(1)"));

    // The same pages may be written again; changed ones are kept.
    succeed(folder.path(), "man --out pages");
    fs::write(folder.path().join("pages/ppa.1"), "mine").unwrap();
    assert!(fail(folder.path(), "man --out pages").contains("--replace"));
    assert_eq!(read("ppa.1"), "mine");
    succeed(folder.path(), "man --out pages --replace");
    assert!(read("ppa.1").contains(".TH"));
}
