//! Quoting for shell scripts.

use std::path::Path;

use crate::error::FolderError;

/// The path as UTF-8 text.
pub(crate) fn unicode(path: &Path) -> Result<&str, FolderError> {
    path.to_str()
        .ok_or_else(|| FolderError::NotUnicode(path.to_owned()))
}

/// Quotes a text as one word of a POSIX shell: unchanged if that is safe, otherwise in single quotes.
pub fn shell_quoted(text: &str) -> String {
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "_-./:=,@%+".contains(c);
    if !text.is_empty() && text.chars().all(is_safe) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_without_special_characters_stay_as_they_are() {
        assert_eq!(shell_quoted("--array=1-3%2"), "--array=1-3%2");
        assert_eq!(shell_quoted("a b"), "'a b'");
        assert_eq!(shell_quoted(""), "''");
        assert_eq!(shell_quoted("it's"), r"'it'\''s'");
    }

    #[cfg(unix)]
    #[test]
    fn a_shell_reads_back_what_was_quoted() {
        for text in [
            "a b",
            "it's",
            "$HOME `id` \\ \" ! * ~",
            "~",
            "two\nlines",
            "",
            "ü#;&|",
        ] {
            let script = format!("printf %s {}", shell_quoted(text));
            let output = std::process::Command::new("sh")
                .args(["-c", &script])
                .output()
                .unwrap();
            assert_eq!(String::from_utf8(output.stdout).unwrap(), text);
        }
    }
}
