//! The findings about the limbs of a dataset, as a table of the page.

use maud::{Markup, html};
use ppa_core::text::numbers;
use ppa_dataset::findings::{Findings, LimbFinding, Severity};

/// One table, with severe unacknowledged findings first; nothing if there are no findings.
pub(super) fn table(findings: &Findings) -> Markup {
    let mut rows: Vec<&LimbFinding> = findings.0.iter().collect();
    rows.sort_by_key(|row| {
        (
            !row.is_open(),
            std::cmp::Reverse(row.finding.severity),
            row.limb,
        )
    });
    html! {
        @if !rows.is_empty() {
            h2 { "Findings" }
            table class="findings" {
                tr {
                    th { "limb" } th { "severity" } th { "code" } th { "finding" }
                    th { "place in the scan, mm (LPS)" } th { "acknowledged" }
                }
                @for finding in rows { (row(finding)) }
            }
        }
    }
}

fn row(row: &LimbFinding) -> Markup {
    let finding = &row.finding;
    let class = match (row.is_open(), finding.severity) {
        (true, _) => Some("bad"),
        (false, Severity::Severe | Severity::Caution) => Some("caution"),
        (false, Severity::Note) => None,
    };
    // The code as used by scripts and by `acknowledged` in a case.
    let code = serde_json::to_value(finding.code).ok();
    let code = code.as_ref().and_then(|code| code.as_str()).unwrap_or("");
    let place = finding
        .place_mm
        .map_or(String::new(), |place| format!("{:.1}", numbers(place)));
    html! {
        tr class=[class] {
            td { "patient " (row.limb.patient) " " (row.limb.side) }
            td { (finding.severity) }
            td { code { (code) } }
            td { (finding.text) }
            td { (place) }
            td {
                @match (finding.severity, row.acknowledged) {
                    (_, true) => "yes",
                    (Severity::Severe, false) => b { "no" },
                    (_, false) => "",
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn findings() -> Findings {
        let finding = |code: &str, severity: &str, acknowledged: bool| {
            json!({
                "patient": 2, "side": "r", "acknowledged": acknowledged, "code": code, "severity": severity,
                "text": "3 < 5 mm", "value": 3.0, "place_mm": [1.0, -0.01, 25.125],
            })
        };
        let list = [
            finding("several-limbs", "caution", false),
            finding("contacts-too-near", "severe", true),
            finding("plane-on-cut", "severe", false),
        ];
        serde_json::from_value(json!(list)).unwrap()
    }

    #[test]
    fn open_severe_findings_come_first_with_code_and_place() {
        let html = table(&findings()).into_string();
        let at = |text: &str| {
            html.find(text)
                .unwrap_or_else(|| panic!("{text} in {html}"))
        };
        assert!(at("plane-on-cut") < at("contacts-too-near"));
        assert!(at("contacts-too-near") < at("several-limbs"));
        assert!(html.contains(
            "<tr class=\"bad\"><td>patient 2 right</td><td>severe</td><td><code>plane-on-cut"
        ));
        assert!(
            html.contains("3 &lt; 5 mm</td><td>1.0, 0.0, 25.1</td><td><b>no</b>"),
            "{html}"
        );
        assert_eq!(html.matches("<td>yes</td>").count(), 1);
        assert_eq!(table(&Findings::default()).into_string(), "");
    }
}
