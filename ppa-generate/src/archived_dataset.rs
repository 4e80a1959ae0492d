//! A dataset, or a shard, in one tar archive, which holds the files of its folder under the same paths.
//!
//! A run adds each pose when it is made: its images, then its record. If it makes a pose again, the later members count.
//! When all poses are made, the archive is written once more in a fixed order (see `write_archive`).

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Component, Path};

use ppa_dataset::archive::{Archive, Member};
use ppa_dataset::checksums::Checksums;
use ppa_dataset::files::FileError;
use ppa_dataset::findings::Findings;
use ppa_dataset::manifest::{DESCRIPTION_FILE, Manifest};

use crate::dataset_lock::FolderError;
use crate::pose_id::{FOLDER, PoseId};

/// The members of an archive that make up the dataset.
pub(crate) struct ArchivedDataset {
    archive: Archive,
    current: BTreeMap<String, Member>,
}

impl ArchivedDataset {
    /// Lists the files of an archive, written by a run or by another program from a folder.
    ///
    /// # Errors
    /// [`FolderError`] when it cannot be read or holds something else.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let archive = Archive::scan(path)?;
        let current = current(&archive.members, archive.is_closed());
        if archive.length > 0 && !current.contains_key(DESCRIPTION_FILE) {
            return Err(FolderError::NotADataset(path.to_owned()));
        }
        Ok(Self { archive, current })
    }

    /// Whether the archive has no files yet.
    pub fn is_empty(&self) -> bool {
        self.current.is_empty()
    }

    /// Whether bytes before the end of the last current member belong to no member. Bytes after it are remains of a killed run.
    pub fn is_damaged(&self) -> bool {
        self.archive.damage.is_some_and(|at| at < self.end())
    }

    /// Whether the archive is complete: it ends as archives do, after the lists of all poses and without other members.
    pub fn is_finished(&self) -> bool {
        let has_damage = self.archive.damage.is_some();
        let is_whole = self.current.len() == self.archive.members.len() && !has_damage;
        is_whole && self.archive.ends_after(self.end()) && self.has(Manifest::FILE)
    }

    /// Whether its files are exactly those of the given names below a folder.
    pub fn holds_exactly(&self, names: &[String], folder: &Path) -> Result<bool, FileError> {
        let is_same = |name: &String| {
            let path = folder.join(name);
            let bytes = fs::read(&path).map_err(FileError::at("read", &path))?;
            Ok(self.read(name)? == Some(bytes))
        };
        if names.len() != self.current.len() {
            return Ok(false);
        }
        for name in names {
            if !is_same(name)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Offset at which the next member is written; later bytes belong to no finished pose.
    pub fn end(&self) -> u64 {
        self.current.values().map(Member::end).max().unwrap_or(0)
    }

    /// Whether it has a file.
    pub fn has(&self, file: &str) -> bool {
        self.current.contains_key(file)
    }

    /// Size of a file in bytes; `None` if there is none of this name.
    pub fn size(&self, file: &str) -> Option<u64> {
        self.current.get(file).map(|member| member.size)
    }

    /// Reads a file; `None` if there is none of this name.
    pub fn read(&self, file: &str) -> Result<Option<Vec<u8>>, FileError> {
        let member = self.current.get(file);
        member.map(|member| self.archive.read(member)).transpose()
    }

    /// The poses whose records it holds, in order.
    pub fn poses(&self) -> Vec<PoseId> {
        let mut poses: Vec<_> = self
            .current
            .keys()
            .filter_map(|name| recorded(name))
            .collect();
        poses.sort_unstable();
        poses
    }

    /// Writes all files into a temporary folder, without waiting for the disk.
    pub fn extracted(&self) -> Result<tempfile::TempDir, FileError> {
        let temporary = std::env::temp_dir();
        let folder = tempfile::tempdir();
        let folder = folder.map_err(FileError::at("create a folder in", &temporary))?;
        self.extract(folder.path())?;
        Ok(folder)
    }

    /// Writes all files below a folder.
    pub fn extract(&self, to: &Path) -> Result<(), FileError> {
        let records = to.join(FOLDER);
        fs::create_dir_all(&records).map_err(FileError::at("create folder", &records))?;
        for (name, member) in &self.current {
            let path = to.join(name);
            let folder = path.parent().unwrap_or(to);
            fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
            let bytes = self.archive.read(member)?;
            fs::write(&path, bytes).map_err(FileError::at("write", &path))?;
        }
        Ok(())
    }
}

/// The pose whose record a path names.
fn recorded(file: &str) -> Option<PoseId> {
    let name = file.strip_prefix(FOLDER)?.strip_prefix('/')?;
    PoseId::of_record(name)
}

/// The current member of each name. A closed archive was completed by a run or made by another program, in any order.
fn current(members: &[Member], is_closed: bool) -> BTreeMap<String, Member> {
    let last_record = members
        .iter()
        .rposition(|one| recorded(&one.name).is_some());
    let mut current = BTreeMap::new();
    // Images count once the record of their pose follows.
    let mut images: HashMap<PoseId, Vec<&Member>> = HashMap::new();
    let add = |current: &mut BTreeMap<_, _>, member: &Member| {
        current.insert(member.name.clone(), member.clone());
    };
    for (i, member) in members.iter().enumerate() {
        if !is_below(&member.name) {
            continue;
        }
        if let Some(pose) = PoseId::of_image(&member.name) {
            images.entry(pose).or_default().push(member);
        } else if let Some(pose) = recorded(&member.name) {
            if let Some(images) = images.remove(&pose) {
                for earlier in pose.images() {
                    current.remove(&earlier);
                }
                images
                    .into_iter()
                    .for_each(|image| add(&mut current, image));
            }
            add(&mut current, member);
        } else if is_closed || !is_list(&member.name) || last_record.is_none_or(|last| i > last) {
            // While a run is in progress, lists before a record do not list its pose.
            add(&mut current, member);
        }
    }
    // Other programs may add the records of a folder before its images.
    for (pose, images) in images {
        let is_recorded = current.contains_key(&pose.record_file());
        if is_recorded
            && !pose
                .images()
                .iter()
                .any(|image| current.contains_key(image))
        {
            images
                .into_iter()
                .for_each(|image| add(&mut current, image));
        }
    }
    current
}

/// Whether a path stays below the folder that it starts from.
fn is_below(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.is_empty() && parts.all(|part| matches!(part, Component::Normal(_)))
}

/// Whether a path is that of a list over all poses, which a run writes after the last of them.
fn is_list(name: &str) -> bool {
    [Manifest::FILE, Checksums::FILE, Findings::FILE].contains(&name)
        || name.starts_with("patient_") && name.ends_with("/roi_depth.json")
}
