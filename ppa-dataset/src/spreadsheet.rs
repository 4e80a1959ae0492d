//! Cells of a CSV file that spreadsheet programs would run as formulas.

/// Whether spreadsheet programs run a text as a formula when they open a CSV file; quoting does not prevent this.
///
/// Names from outside that go into a table that is read back are rejected if this is true; in a table that is only for people,
/// a leading apostrophe keeps the cell a text.
pub fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@', '\t', '\r'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_are_told_from_names() {
        for formula in ["=cmd|calc!A1", "+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1"] {
            assert!(is_formula(formula), "{formula:?}");
        }
        for name in ["", "Anna", "A=1", "1-2", "'=1", "ß"] {
            assert!(!is_formula(name), "{name:?}");
        }
    }
}
