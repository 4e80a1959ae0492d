//! Locks on a dataset's folder: one writing run or any number of readers.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_core::Part;
use ppa_dataset::archive::is_archive;
use ppa_dataset::checksums::Checksums;
use ppa_dataset::files::FileError;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_dataset::manifest::Manifest;

use crate::pose_id::FOLDER;
use crate::survey::DatasetDiffers;

/// Why a folder cannot take the images of a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// The folder holds poses that are not in the run.
    #[error(
        "{} holds a dataset of another plan or shard (its {record} is not in this one); choose another folder",
        root.display()
    )]
    OtherPlan {
        /// The dataset's folder.
        root: PathBuf,
        /// The record of a pose that is not in the run.
        record: String,
    },
    /// The folder holds files that the run would replace.
    #[error("{0}")]
    Differs(Box<DatasetDiffers>),
    /// The folder holds another part of the plan.
    #[error(
        "{} holds {}, but this run is to make {}; {} resumes it; choose another folder for this run",
        root.display(), part_name(*held), part_name(*asked), how_to_ask(*held)
    )]
    OtherPart {
        /// The dataset's folder.
        root: PathBuf,
        /// The part that it holds.
        held: Part,
        /// The part that was asked for.
        asked: Part,
    },
    /// The folder holds something else.
    #[error("{} holds no dataset started by ppa generate", .0.display())]
    NotADataset(PathBuf),
    /// The folder holds files of a dataset, but not the records that describe them.
    #[error(
        "{} holds {found}, but not the folder .ppa with the records of its poses; if the dataset was copied, copy .ppa as \
         well, or choose another folder",
        root.display()
    )]
    WithoutRecords {
        /// The dataset's folder.
        root: PathBuf,
        /// Name of a file or folder of the dataset.
        found: String,
    },
    /// Another process is using its files.
    #[error("{} is in use by another process that writes or checks it", .0.display())]
    Busy(PathBuf),
    /// A file of the dataset cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
}

fn part_name(part: Part) -> String {
    match part {
        Part::WHOLE => "the whole plan".to_owned(),
        part => format!("shard {part} of its plan"),
    }
}

fn how_to_ask(part: Part) -> String {
    match part {
        Part::WHOLE => "a run without --shard".to_owned(),
        part => format!("--shard {part}"),
    }
}

/// Lock held while a process uses a dataset's files; released on drop or when the process dies.
pub(crate) struct DatasetLock(#[expect(dead_code, reason = "holds the lock")] Option<fs::File>);

/// Locks a folder or archive that holds a dataset, finished or not, for reading. Writes nothing; several readers may hold the lock.
pub(crate) fn lock_existing(root: &Path) -> Result<DatasetLock, FolderError> {
    let path = match is_archive(root) {
        true => root.to_owned(),
        false if root.join(FOLDER).is_dir() => lock_file(root),
        false => return Err(not_a_dataset(root)?),
    };
    match fs::File::open(&path) {
        Ok(lock) => {
            require_lock(root, &path, lock.try_lock_shared())?;
            Ok(DatasetLock(Some(lock)))
        }
        // Nobody has written here since the folder was copied.
        Err(error) if error.kind() == io::ErrorKind::NotFound && path != root => {
            Ok(DatasetLock(None))
        }
        Err(error) => Err(FileError::at("read", &path)(error).into()),
    }
}

/// Locks the folder `root` for a run that writes. Refuses a folder that is in use or holds something else.
pub(crate) fn lock(root: &Path) -> Result<DatasetLock, FolderError> {
    let folder = root.join(FOLDER);
    let occupied = root.exists() && {
        let mut entries = fs::read_dir(root).map_err(FileError::at("read", root))?;
        entries.next().is_some()
    };
    if occupied && !folder.is_dir() {
        return Err(not_a_dataset(root)?);
    }
    fs::create_dir_all(&folder).map_err(FileError::at("create folder", &folder))?;
    let path = lock_file(root);
    let mut options = fs::OpenOptions::new();
    let options = options.write(true).create(true).truncate(false);
    let lock = options
        .open(&path)
        .map_err(FileError::at("create", &path))?;
    require_lock(root, &path, lock.try_lock())?;
    Ok(DatasetLock(Some(lock)))
}

fn lock_file(root: &Path) -> PathBuf {
    root.join(FOLDER).join("lock")
}

/// Opens an archive, creating it if it does not exist, and locks it for a run that writes.
pub(crate) fn lock_archive(path: &Path) -> Result<fs::File, FolderError> {
    let folder = path.parent().filter(|above| !above.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
    loop {
        let mut options = fs::OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(false);
        let file = options.open(path).map_err(FileError::at("create", path))?;
        require_lock(path, path, file.try_lock())?;
        // Another run may have replaced it by a finished archive between opening and locking.
        if is_of_path(&file, path).map_err(FileError::at("read", path))? {
            return Ok(file);
        }
    }
}

#[cfg(unix)]
fn is_of_path(file: &fs::File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let identity = |found: fs::Metadata| (found.dev(), found.ino());
    match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        found => Ok(identity(found?) == identity(file.metadata()?)),
    }
}

/// Other systems do not let a file be replaced while it is open.
#[cfg(not(unix))]
fn is_of_path(_: &fs::File, _: &Path) -> io::Result<bool> {
    Ok(true)
}

/// Refuses a dataset whose lock file `file` is held by another process.
fn require_lock(
    root: &Path,
    file: &Path,
    tried: Result<(), fs::TryLockError>,
) -> Result<(), FolderError> {
    tried.map_err(|error| match error {
        fs::TryLockError::WouldBlock => FolderError::Busy(root.to_owned()),
        fs::TryLockError::Error(e) => FileError::at("lock", file)(e).into(),
    })
}

/// The error for a folder without records.
fn not_a_dataset(root: &Path) -> Result<FolderError, FileError> {
    let mut names = Vec::new();
    for entry in fs::read_dir(root).map_err(FileError::at("read", root))? {
        let entry = entry.map_err(FileError::at("read", root))?;
        names.push(entry.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    let lists = [DESCRIPTION_FILE, Manifest::FILE, Checksums::FILE];
    let of_dataset =
        |name: &&String| lists.contains(&name.as_str()) || name.starts_with("patient_");
    let root = root.to_owned();
    Ok(match names.iter().find(of_dataset) {
        None => FolderError::NotADataset(root),
        Some(found) => FolderError::WithoutRecords {
            root,
            found: found.clone(),
        },
    })
}
