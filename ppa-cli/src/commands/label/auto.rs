//! `ppa label auto`: labels computed from the bones.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use ppa_core::text::{count, number};
use ppa_dataset::Manifest;
use ppa_dataset::labels::LabelName;
use ppa_dataset::layout::LimbId;
use ppa_generate::{Case, Plan, plan_of_dataset};
use ppa_label::{CaseBones, ComputedLabels, LabelScale, LabelledLimb, ScaleName, compute_labels};
use serde::Serialize;

use crate::findings::repeat_of_datasets;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, working};
use crate::output_files::{ReplaceArgs, require_writable};

#[derive(Debug, Args)]
#[command(after_long_help = "\
The gutters between talus, tibia and fibula are followed along the rays of every radiograph; the worst one decides. The \
cases of the plan name the bones (`ppa prepare --bones` or `--segment-bones`). The graded scale grades by how many mm a malleolus covers \
the talus and by the contrast of the superior gutter; it is as wide as readers' grades. The strict scale grades by the share of each \
gutter through which rays pass freely. Writes labels.json, with label_source surrogate-jso/2 (strict: surrogate-jso/1; with bones \
from --segment-bones, -segmented), labels.computed.json with the same labels, and next to them openness.csv: openness, cover and grade of each gutter, \
overlaps and clear spaces in mm, and how well the radiograph itself shows each gutter; and openness.json: thresholds, and hashes of \
the bones and of the code. Labels of readers stay in labels.json; computed ones are added there where no reader graded. With --name \
NAME, labels.NAME.json, openness.NAME.csv and openness.NAME.json are written instead and labels.json stays as it is; \
`labels = \"NAME\"` trains on them. Results that differ from those of an earlier run need --replace. No reader has confirmed these labels.

  ppa ct phantom --out p01.nii.gz --labels p01.bones.nii.gz
  ppa prepare p01.nii.gz --side r --bones p01.bones.nii.gz --out p01.case.toml
  ppa generate plan.toml && ppa label auto plan
  ppa label auto plan --scale strict --name strict

Thresholds are a TOML file, one number for each of the grades 1, 1.5, 2 and 2.5. These are the defaults of the graded scale:

  # Greatest cover of the talus by a malleolus: median over the gutter's height
  hidden_mm = [0.75, 2.25, 3.75, 5.25]
  # Greatest loss of the superior gutter's contrast, compared with its best
  lost_contrast = [0.1, 0.3, 0.5, 0.7]

and of the strict one:

  # Or \"each_gutter\": no credit for facets that are never open together
  relative_to = \"own_best\"
  # Least openness of the worst gutter
  at_least = [0.75, 0.5, 0.25, 0.03]")]
pub struct AutoArgs {
    /// Folder of a dataset
    dataset: PathBuf,
    /// Plan it was made from [default: the file next to the folder, named after it]
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Scale of the labels: graded or strict
    #[arg(long, default_value_t)]
    scale: ScaleName,
    /// Write a further set of labels, labels.NAME.json, and leave labels.json as it is
    #[arg(long)]
    name: Option<LabelName>,
    /// Thresholds of the scale, TOML
    #[arg(long, value_name = "FILE")]
    thresholds: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Labelled {
    limbs: Vec<LabelledLimb>,
    thresholds: LabelScale,
}

pub fn run(args: &AutoArgs, output: Output) -> anyhow::Result<()> {
    let thresholds = match &args.thresholds {
        Some(path) => LabelScale::read(args.scale, path)?,
        None => LabelScale::new(args.scale),
    };
    let manifest = Manifest::read(&args.dataset)?;
    let beside = || plan_of_dataset(&args.dataset);
    let plan = Plan::read(&args.plan.clone().unwrap_or_else(beside))?;
    require_writable("the dataset", &args.dataset)?;
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    repeat_of_datasets(std::iter::once(&*args.dataset))?;
    let working = working("following rays through the joint");
    let limbs = plan.cases.iter().map(|planned| {
        let case = Case::read(&planned.file)?;
        let limb = LimbId {
            patient: planned.patient,
            side: case.side,
        };
        let bones = CaseBones {
            limb_kind: case.choices.limb,
            file: case.bones.as_ref(),
            volume_sha256: &case.source.volume_sha256,
        };
        compute_labels(&manifest, limb, &bones, &thresholds, args.name.as_ref())
            .with_context(|| format!("cannot label by {}", planned.file.display()))
    });
    // All limbs or none: an error in a later limb leaves the files of earlier ones unchanged.
    let computed = limbs.collect::<anyhow::Result<Vec<_>>>()?;
    if !args.replace.is_given() {
        computed.iter().try_for_each(ComputedLabels::require_same)?;
    }
    drop(stoppable);
    let limbs = computed.iter().map(ComputedLabels::write);
    let limbs = limbs.collect::<Result<_, _>>()?;
    working.finish_and_clear();
    output.print(&Labelled { limbs, thresholds }, describe)
}

fn describe(labelled: &Labelled) -> String {
    let line = |limb: &LabelledLimb| {
        let kept = match (limb.unnamed_kept, limb.of_readers) {
            (true, _) => {
                "; labels.json does not name the source of its labels and was kept, see labels.computed.json"
                    .to_owned()
            }
            (false, 0) => String::new(),
            (false, kept) => format!("; labels of readers kept for {kept} of them"),
        };
        format!(
            "{}: {}, {} diagnostic, best at {:.1} degrees{kept}",
            limb.limb,
            count(limb.radiographs, "radiograph"),
            limb.diagnostic,
            number(limb.best_angle_deg)
        )
    };
    let mut lines: Vec<String> = labelled.limbs.iter().map(line).collect();
    lines.push("surrogate, not validated on readers".to_owned());
    lines.join("\n")
}
