//! A small plan of the phantom.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use ppa_dataset::layout::{LimbId, Side, View};
use ppa_dataset::{FileRow, Manifest, Split};
use ppa_generate::{Case, GenerateSettings, Plan, generate};
use ppa_label::{CaseBones, LabelScale, ScaleName, compute_labels};
use tempfile::TempDir;

use crate::browser::{copy, fine_phantom, phantom};

/// Commented plan of six poses with one body shape and small radiographs.
const PLAN: &str = "\
# Of the house.
version = 1
seed = 7    # drawn

[[case]]
file = \"p01.case.toml\"
patient = 4

[rotation]
to_deg = 25.0
step_deg = 5.0    # coarse

[shapes]
variants = [\"orig\"]

[xray.detector]
columns = 32
rows = 32
pixel_mm = 7.0

[xray.engine]
scatter_histories = 2000
";

/// Its limb.
pub const LIMB: LimbId = LimbId {
    patient: 4,
    side: Side::Right,
};

/// Poses of the plan.
pub const POSES: usize = 6;

/// Writes the phantom and its plan into a folder.
pub fn plan(folder: &Path) -> PathBuf {
    phantom(folder);
    write_plan(folder)
}

fn write_plan(folder: &Path) -> PathBuf {
    let file = folder.join("ankles.toml");
    std::fs::write(&file, PLAN).unwrap();
    file
}

/// Writes the dataset of the plan with poses every 2.5 degrees, labels and a split. The left camera's image at 15 degrees is an
/// outlier: its list entry has the limb 4 mm higher.
pub fn dataset(folder: &Path) -> PathBuf {
    static MADE: LazyLock<TempDir> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        make_dataset(folder.path());
        folder
    });
    copy(MADE.path(), folder);
    folder.join("ankles")
}

fn make_dataset(folder: &Path) {
    fine_phantom(folder);
    let file = write_plan(folder);
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("step_deg = 5.0 ", "step_deg = 2.5 ")).unwrap();
    let (plan, root) = (Plan::read(&file).unwrap(), folder.join("ankles"));
    generate(&plan, &root, &GenerateSettings::default(), &|_| {}).unwrap();
    let mut manifest = Manifest::read(&root).unwrap();
    let case = Case::read(&plan.cases[0].file).unwrap();
    let bones = CaseBones {
        limb_kind: case.choices.limb,
        file: case.bones.as_ref(),
        volume_sha256: &case.source.volume_sha256,
    };
    let scale = LabelScale::new(ScaleName::Graded);
    let labels = compute_labels(&manifest, LIMB, &bones, &scale, None).unwrap();
    labels.write().unwrap();
    let split = Split::draw(&[LIMB.patient], &[("test".to_owned(), 1.0)], 1).unwrap();
    split.write(&root, "default").unwrap();
    let odd = |row: &&mut FileRow| row.step == 30 && row.camera == Some(View::Left);
    for row in manifest.files.iter_mut().filter(odd) {
        row.room_from_patient[2][3] += 4.0;
    }
    std::fs::write(root.join(Manifest::FILE), manifest.to_text()).unwrap();
}
