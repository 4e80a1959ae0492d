//! Outputs of a divided command: the last job writes them in the job folder, then copies them to the paths that the command names. A job
//! that was stopped in between can run again, and a file created at such a path since the submission is kept.

use std::fmt::Write;
use std::path::Path;

use crate::histories::{DividedCommand, HistoryCommand};
use crate::quote::shell_quoted;

/// Shell functions of the last job.
const PUBLISH: &str = r#"# Puts a result in its place. What is there with the same bytes was put there before this job was stopped.
publish() {
    if [ -d "$1" ]; then
        mkdir -p -- "$2" || exit 1
        local file
        for file in "$1"/*; do publish "$file" "$2/${file##*/}"; done
        return
    fi
    local part=$2.$task.part
    if ! cmp -s -- "$1" "$2"; then
        if [ -z "$replace" ] && { [ -e "$2" ] || [ -L "$2" ]; }; then
            echo "$2 was created since the submission and is kept; the result is $1"
            exit 1
        fi
        # Without replace, -n keeps what was created in this moment: the part is then still there.
        if ! cp -- "$1" "$part" || ! mv "${replace:--n}" -T -- "$part" "$2" || [ -e "$part" ]; then
            rm -f -- "$part"
            echo "cannot write $2; the result is $1"
            exit 1
        fi
    fi
    echo "wrote $2"
}
shopt -s nullglob dotglob
# What this job made before it was stopped is made again.
results=$jobs/slurm/results
rm -rf "$results"
"#;

/// The outputs of a command, for its script.
pub(crate) struct Results {
    /// Arguments that name outputs, with paths in the job folder.
    pub words: String,
    /// Shell code before the command.
    pub before: String,
    /// Shell code that copies the outputs to their paths.
    pub after: String,
}

impl Results {
    pub fn of(divided: &DividedCommand) -> Self {
        let options: &[&str] = match divided.command {
            HistoryCommand::Simulate => &["--out", "--exr", "--dicom", "--dose-map"],
            HistoryCommand::Mcgpu => &["--out"],
        };
        let replaces = divided.outputs.iter().any(|word| word == "--replace");
        let mut before = PUBLISH.to_owned();
        let _ = writeln!(before, "replace={}", if replaces { "-f" } else { "" });
        let mut words = Vec::new();
        let mut after = String::new();
        let mut outputs = divided.outputs.iter();
        while let Some(word) = outputs.next() {
            let (option, value) = match word.split_once('=') {
                Some((option, value)) => (option, Some(value)),
                None => (word.as_str(), None),
            };
            if !options.contains(&option) {
                words.push(shell_quoted(word));
                continue;
            }
            let place = value.or_else(|| outputs.next().map(String::as_str));
            let place = place.unwrap_or_default();
            let folder = format!("\"$results\"/{}", option.trim_start_matches('-'));
            let name = Path::new(place).file_name().unwrap_or_default();
            let made = format!("{folder}/{}", shell_quoted(&name.to_string_lossy()));
            let _ = writeln!(before, "mkdir -p {folder} || exit 1");
            words.push(format!("{option} {made}"));
            let _ = writeln!(after, "publish {made} {}", shell_quoted(place));
        }
        after += "rm -r \"$results\"\n";
        Self {
            words: words.join(" "),
            before,
            after,
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;
    use std::process::Command;

    use super::*;

    /// Runs `publish` in a folder, as the script of the last job does.
    fn publish(folder: &Path, replace: &str, place: &str) -> (bool, String) {
        let script =
            format!("jobs=jobs\ntask=7\n{PUBLISH}\nreplace={replace}\npublish made {place}\n");
        let mut bash = Command::new("bash");
        let output = bash.current_dir(folder).arg("-c").arg(script).output();
        let output = output.unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        (output.status.success(), said)
    }

    #[test]
    fn results_never_replace_what_is_there_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("made/in it")).unwrap();
        fs::write(at("made/in it/a b"), "new").unwrap();
        fs::write(at("made/.hidden"), "new").unwrap();
        let place = "'its place'";
        assert!(publish(folder.path(), "", place).0);
        // Once more, as after a kill.
        let (succeeded, said) = publish(folder.path(), "", place);
        assert!(
            succeeded && said.contains("wrote its place/in it/a b"),
            "{said}"
        );
        for name in ["its place/in it/a b", "its place/.hidden"] {
            assert_eq!(fs::read(at(name)).unwrap(), b"new");
        }
        fs::write(at("its place/in it/a b"), "of somebody").unwrap();
        let (succeeded, said) = publish(folder.path(), "", place);
        assert!(
            !succeeded && said.contains("a b was created since"),
            "{said}"
        );
        assert_eq!(fs::read(at("its place/in it/a b")).unwrap(), b"of somebody");
        assert!(publish(folder.path(), "-f", place).0);
        assert_eq!(fs::read(at("its place/in it/a b")).unwrap(), b"new");
        // A folder where a file belongs.
        fs::remove_file(at("its place/in it/a b")).unwrap();
        fs::create_dir(at("its place/in it/a b")).unwrap();
        assert!(!publish(folder.path(), "-f", place).0);
        let inside = fs::read_dir(at("its place/in it")).unwrap();
        assert_eq!(inside.count(), 1);
    }
}
