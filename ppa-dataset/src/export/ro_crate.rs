//! RO-Crate 1.1 with the Process Run profile 0.5: provenance of the dataset.

use serde_json::{Value, json};

use super::metadata::{DESCRIPTION, Metadata, PAPER, Provenance, TABLE};
use super::table::Table;

const RO_CRATE: &str = "https://w3id.org/ro/crate/1.1";
const PROCESS_RUN: &str = "https://w3id.org/ro/wfrun/process/0.5";

/// The metadata document of the crate.
pub(super) fn ro_crate(
    metadata: &Metadata,
    table: &Table,
    other_lists: &[(String, &str)],
    provenance: &Provenance,
) -> Value {
    let lists = [
        (TABLE, "text/csv", "One row per image."),
        (
            "manifest.jsonl",
            "application/jsonl",
            "Hash, pose and seed of every image.",
        ),
        (
            "dataset.json",
            "application/json",
            "Settings that all images share.",
        ),
    ];
    let id = |id: &str| json!({"@id": id});
    let images = table.texts("file").zip(table.texts("sha256"));
    let images: Vec<_> = images.filter_map(|(file, hash)| file.zip(hash)).collect();
    let scans = provenance.scans();
    let scan_id = |scan: &str| format!("#scan-{scan}");
    let parts: Vec<_> = lists
        .iter()
        .map(|(file, ..)| *file)
        .chain(other_lists.iter().map(|(file, _)| file.as_str()))
        .chain(images.iter().map(|(file, _)| *file))
        .map(id)
        .collect();
    let mut graph = vec![
        json!({
            "@id": "ro-crate-metadata.json", "@type": "CreativeWork",
            "conformsTo": {"@id": RO_CRATE}, "about": {"@id": "./"},
        }),
        json!({
            "@id": "./", "@type": "Dataset", "conformsTo": {"@id": PROCESS_RUN},
            "name": metadata.name, "description": DESCRIPTION, "datePublished": metadata.date,
            "license": {"@id": metadata.license}, "citation": {"@id": PAPER},
            "hasPart": parts, "mentions": {"@id": "#generation"},
        }),
        json!({"@id": PROCESS_RUN, "@type": "CreativeWork", "name": "Process Run Crate", "version": "0.5"}),
        json!({"@id": metadata.license, "@type": "CreativeWork", "name": "Licence of the dataset"}),
        json!({"@id": PAPER, "@type": "ScholarlyArticle", "name": "Patient Pose Assessment Using a CT-Based Framework for Synthetic Data Generation"}),
        json!({
            "@id": "#ppa", "@type": "SoftwareApplication", "name": "ppa",
            "version": provenance.settings.generator.trim_start_matches("ppa "),
            "identifier": provenance.settings.code,
        }),
        json!({
            "@id": "#generation", "@type": "CreateAction", "name": "ppa generate", "instrument": {"@id": "#ppa"},
            "object": scans.iter().map(|scan| id(&scan_id(scan))).collect::<Vec<_>>(), "result": {"@id": "./"},
        }),
    ];
    for scan in &scans {
        let of_scan = provenance
            .limbs
            .iter()
            .filter(|limb| limb.volume_sha256 == *scan);
        let limbs: Vec<_> = of_scan
            .map(|limb| format!("patient {} {}", limb.patient, limb.side))
            .collect();
        graph.push(json!({
            "@id": scan_id(scan), "@type": "CreativeWork", "identifier": scan,
            "name": format!("Computed tomography of {}", limbs.join(" and ")),
        }));
    }
    for (file, format, text) in lists {
        graph.push(
            json!({"@id": file, "@type": "File", "encodingFormat": format, "description": text}),
        );
    }
    for (file, format) in other_lists {
        graph.push(json!({"@id": file, "@type": "File", "encodingFormat": format}));
    }
    for (file, sha256) in images {
        let format = if file.ends_with(".png") {
            "image/png"
        } else {
            "image/x-exr"
        };
        graph.push(
            json!({"@id": file, "@type": "File", "encodingFormat": format, "sha256": sha256}),
        );
    }
    // RO-Crate's own context does not define this term, so readers would drop it.
    let context = json!([
        "https://w3id.org/ro/crate/1.1/context",
        {"sha256": "https://schema.org/sha256"},
    ]);
    json!({"@context": context, "@graph": graph})
}
