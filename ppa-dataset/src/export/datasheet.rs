//! `datasheet.md`: the questions of Gebru et al., Datasheets for Datasets (doi:10.1145/3458723), answered as far as a program can.

use std::collections::{BTreeMap, BTreeSet};

use ppa_core::text::count;

use super::metadata::{DESCRIPTION, Metadata, PAPER, Provenance};
use super::table::Table;

/// The datasheet in Markdown. Questions that only people can answer are left open.
pub(super) fn datasheet(
    metadata: &Metadata,
    table: &Table,
    split_files: &[String],
    provenance: &Provenance,
) -> String {
    let persons: BTreeSet<_> = table.limbs().iter().map(|limb| limb.patient).collect();
    let (name, generator) = (&metadata.name, &provenance.settings.generator);
    let poses: BTreeSet<_> = table.texts("unit").collect();
    format!(
        "# Datasheet of {name}\n\n\
         After Gebru et al., Datasheets for Datasets, doi:10.1145/3458723. Lines that begin with **To answer** are for those \
         who publish the dataset: no program knows them.\n\n\
         ## Motivation\n\n\
         Made to train and test programs that predict from depth images alone whether a limb is positioned adequately for a radiograph, by the \
         method of Laufer et al., {PAPER}.\n\n\
         **To answer:** Who made it, for whom, and who paid for it?\n\n\
         ## Composition\n\n\
         {DESCRIPTION}\n\n\
         {persons}, {limbs}, {poses}; files: {kinds}. Depth images by body shape: {shapes}. \
         {labels} {splits} The images of a pose belong together, those of a limb differ by pose, shape and noise only, and both \
         limbs of a person are alike: split by person.\n\n\
         Limbs keep the shape of skin and bones of the scan. No name, date, number or other text of a scan is in the dataset; scans \
         stand by the hash of their voxels.\n\n\
         ## Collection\n\n\
         No image was taken for this dataset. All were simulated by {generator} (sources {code}) from {scans} of computed \
         tomography, of persons or phantoms.\n\n\
         **To answer:** Where do the volumes come from? Did the persons consent to this use, and which board agreed?\n\n\
         ## Preprocessing and labels\n\n\
         Settings of all steps stand in `dataset.json`; poses, seeds and hashes of all files in `manifest.jsonl`. {validated}\n\n\
         ## Uses\n\n\
         Not for decisions about patients. What a program learns from simulated images has to be confirmed on recorded ones.\n\n\
         **To answer:** What has it been used for, and what should it not be used for?\n\n\
         ## Distribution\n\n\
         Licence: <{license}>. Published on {date}.\n\n\
         ## Maintenance\n\n\
         **To answer:** Who keeps it, how are they reached, and how are errors corrected?\n",
        persons = count(persons.len(), "person"),
        limbs = count(table.limbs().len(), "limb"),
        poses = count(poses.len(), "pose"),
        kinds = counted(table.texts("kind").flatten()),
        shapes = shapes(table),
        labels = labels(table),
        splits = splits(table, split_files),
        code = provenance.settings.code,
        scans = count(provenance.scans().len(), "volume"),
        validated = validated(table),
        license = metadata.license,
        date = metadata.date,
    )
}

/// Names with their counts, such as `12 depth, 3 radiograph`.
fn counted<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for name in names {
        *counts.entry(name).or_default() += 1;
    }
    let counted = counts.iter().map(|(name, count)| format!("{count} {name}"));
    counted.collect::<Vec<_>>().join(", ")
}

fn shapes(table: &Table) -> String {
    let rows = table.texts("kind").zip(table.texts("shape"));
    let of_depth = rows.filter(|(kind, _)| *kind == Some("depth"));
    counted(of_depth.filter_map(|(_, shape)| shape))
}

/// Sources of the labels of radiographs.
fn sources(table: &Table) -> Vec<&str> {
    let rows = table.texts("kind").zip(table.texts("label_source"));
    let of_radiographs = rows.zip(table.reals("label"));
    let labelled =
        of_radiographs.filter(|((kind, _), label)| *kind == Some("radiograph") && label.is_some());
    let source = labelled.map(|((_, source), _)| source.unwrap_or("an unnamed source"));
    source.collect()
}

fn labels(table: &Table) -> String {
    let sources = sources(table);
    if sources.is_empty() {
        return "No pose has a label.".to_owned();
    }
    format!(
        "Labels from 1 (ideal) to 3 (inadequate), by source: {}.",
        counted(sources.into_iter())
    )
}

fn splits(table: &Table, files: &[String]) -> String {
    let parts = counted(table.texts("split").flatten());
    let files = files.join(", ");
    match (parts.is_empty(), files.is_empty()) {
        (false, _) => format!("Files by part of the split in `manifest.csv`: {parts}."),
        (true, false) => format!("Recommended splits are in the folder `splits`: {files}."),
        (true, true) => "No split is recommended.".to_owned(),
    }
}

fn validated(table: &Table) -> String {
    let sources: BTreeSet<_> = sources(table).into_iter().collect();
    let sentences = sources.into_iter().filter_map(|source| {
        if source.starts_with("surrogate-") {
            Some(format!(
                "Labels of the source {source} are computed from how open the joint space lies to the beam; no reader has confirmed them."
            ))
        } else if source == "readers" {
            Some(
                "Labels of readers are the mean of their grades, with their standard deviation (ddof 0).\n\n\
                 **To answer:** Who were the readers, and how were they instructed?"
                    .to_owned(),
            )
        } else {
            None
        }
    });
    sentences.collect::<Vec<_>>().join("\n\n")
}
