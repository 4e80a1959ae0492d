//! Datasets and shards in tar archives and in folders.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::shards::write_quick_plan;
use crate::{contents, fail, succeed};

fn tar(folder: &Path, arguments: &[&str]) {
    let mut tar = Command::new("tar");
    let done = tar.current_dir(folder).args(arguments).output().unwrap();
    assert!(done.status.success(), "tar {arguments:?}: {done:?}");
}

/// The files of a dataset except its lock, which archives do not contain.
fn files(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files: BTreeMap<_, _> = contents(root).into_iter().collect();
    files.remove(Path::new(".ppa/lock"));
    files
}

#[test]
fn an_archive_extracts_to_the_dataset_in_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_quick_plan(here);
    succeed(here, "generate plan.toml --out whole");
    succeed(here, "generate plan.toml --out whole.tar");
    fs::create_dir(here.join("extracted")).unwrap();
    tar(here, &["-xf", "whole.tar", "-C", "extracted"]);
    assert!(files(&here.join("extracted")) == files(&here.join("whole")));
    let verified = succeed(here, "verify whole.tar --plan plan.toml");
    assert_eq!(
        verified,
        succeed(here, "verify whole --plan plan.toml").replace("whole:", "whole.tar:")
    );

    // An archive that tar made from a folder, in another order.
    tar(here, &["-cf", "made_by_tar.tar", "-C", "whole", "."]);
    let status = succeed(here, "status made_by_tar.tar");
    assert!(status.contains("complete"), "{status}");
    succeed(here, "verify made_by_tar.tar --plan plan.toml");

    // Shards in an archive of ppa, in a folder, and in an archive that tar made from a folder.
    succeed(here, "generate plan.toml --shard 1/3 --out 1.tar");
    succeed(here, "generate plan.toml --shard 2/3 --out 2");
    succeed(here, "generate plan.toml --shard 3/3 --out 3");
    tar(here, &["-cf", "3.tar", "-C", "3", "."]);
    for out in ["merged.tar", "merged"] {
        succeed(here, &format!("merge 1.tar 2 3.tar --out {out} --verify"));
    }
    let read = |file: &str| fs::read(here.join(file)).unwrap();
    assert!(read("merged.tar") == read("whole.tar"));
    assert!(files(&here.join("merged")) == files(&here.join("whole")));
}

#[test]
fn commands_that_need_a_folder_say_how_to_extract_it() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_quick_plan(here);
    succeed(here, "generate plan.toml --out whole.tar");
    let training = "preset = \"quick\"\n[[training]]\ndataset = \"whole.tar\"\n";
    fs::write(here.join("train.toml"), training).unwrap();
    for command in [
        "qa whole.tar --out qa.html",
        "dataset check whole.tar",
        "dataset split whole.tar",
        "export webdataset whole.tar --out shards",
        "label auto whole.tar --plan plan.toml",
        "train train.toml --out run",
    ] {
        let said = fail(here, command);
        assert!(
            said.contains("extract it to a folder first"),
            "{command}: {said}"
        );
    }
    let other = "generate plan.toml --shard 1/2 --out whole.tar";
    let said = fail(here, other);
    assert!(said.contains("whole.tar holds the whole plan"), "{said}");
}
