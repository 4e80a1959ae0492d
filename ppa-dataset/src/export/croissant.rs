//! Croissant 1.1, <https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html>.

use serde_json::{Value, json};

use super::metadata::{DESCRIPTION, Metadata, PAPER, Provenance, TABLE};
use super::table::{Column, Table, Values};

/// The dataset's metadata with one record per row of its table.
pub(super) fn croissant(
    metadata: &Metadata,
    table: &Table,
    table_sha256: &str,
    provenance: &Provenance,
) -> Value {
    let images = |id: &str, kind: &str, format: &str, pattern: &str| {
        json!({
            "@type": "cr:FileSet", "@id": id, "name": id, "description": kind,
            "encodingFormat": format, "includes": pattern,
        })
    };
    let fields: Vec<_> = table.columns.iter().map(field).collect();
    json!({
        "@context": context(),
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": metadata.name,
        "description": DESCRIPTION,
        "license": metadata.license,
        "datePublished": metadata.date,
        "version": "1.0.0",
        "url": PAPER,
        "citeAs": format!("Laufer et al., Patient Pose Assessment Using a CT-Based Framework for Synthetic Data Generation, MELBA 2026:027, {PAPER}"),
        "rai:dataCollection": format!(
            "Simulated by {} (sources {}) from {} of computed tomography, of persons or phantoms; no image was taken for this dataset.",
            provenance.settings.generator, provenance.settings.code, ppa_core::text::count(provenance.scans().len(), "volume")
        ),
        "rai:personalSensitiveInformation": "Shape of the limb's skin and bones; no name, date, number or other text of a scan.",
        "rai:dataLimitations": "Body shapes are variants of the same skin, and the bones are those of few persons: split by person.",
        "distribution": [
            json!({
                "@type": "cr:FileObject", "@id": TABLE, "name": TABLE, "description": "One row per image.",
                "contentUrl": TABLE, "encodingFormat": "text/csv", "sha256": table_sha256,
            }),
            images("depth-images", "Depth images, mm, 0 invalid.", "image/png", "patient_*/depth/*/*/*.png"),
            images("radiographs", "Radiographs for viewing.", "image/png", "patient_*/xray/*/*.png"),
            images("tallies", "Radiographs as energy per area, by history of the photons.", "image/x-exr", "patient_*/xray/*/*.exr"),
        ],
        "recordSet": [{
            "@type": "cr:RecordSet", "@id": "files", "name": "files", "description": "One record per image.",
            "key": {"@id": "files/file"}, "field": fields,
        }],
    })
}

fn field(column: &Column) -> Value {
    // Croissant has no missing numbers.
    let of_type = match &column.values {
        Values::Count(values) if values.iter().all(Option::is_some) => "sc:Integer",
        Values::Real(values) if values.iter().all(Option::is_some) => "sc:Float",
        _ => "sc:Text",
    };
    let name = column.name;
    json!({
        "@type": "cr:Field", "@id": format!("files/{name}"), "name": name, "dataType": of_type,
        "source": {"fileObject": {"@id": TABLE}, "extract": {"column": name}},
    })
}

/// Terms of the specification and their definitions.
fn context() -> Value {
    let mut context = json!({
        "@language": "en",
        "@vocab": "https://schema.org/",
        "cr": "http://mlcommons.org/croissant/",
        "data": {"@id": "cr:data", "@type": "@json"},
        "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
        "dct": "http://purl.org/dc/terms/",
        "conformsTo": "dct:conformsTo",
        "description": {"@container": "@language"},
        "examples": {"@id": "cr:examples", "@type": "@json"},
        "name": {"@container": "@language"},
        "rai": "http://mlcommons.org/croissant/RAI/",
        "sc": "https://schema.org/",
    });
    for term in [
        "arrayShape",
        "citeAs",
        "column",
        "containedIn",
        "equivalentProperty",
        "extract",
        "field",
        "fileObject",
        "fileProperty",
        "fileSet",
        "format",
        "includes",
        "isArray",
        "isLiveDataset",
        "jsonPath",
        "key",
        "md5",
        "parentField",
        "path",
        "recordSet",
        "references",
        "regex",
        "repeated",
        "replace",
        "samplingRate",
        "separator",
        "source",
        "subField",
        "transform",
    ] {
        context[term] = format!("cr:{term}").into();
    }
    context
}
