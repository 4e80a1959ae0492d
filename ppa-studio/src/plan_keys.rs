//! The keys of a plan, as declared by its types.

/// Key, type, meaning, and names with their meanings, separated by tabs. A test of the workspace (`tests/tests/reference`)
/// compares it with the types.
const TABLE: &str = include_str!("plan_keys.tsv");

/// One key of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PlanKey {
    /// Tables and key, separated by dots; `[]` marks a list.
    pub key: &'static str,
    /// Its type, as named in the reference of keys.
    pub kind: &'static str,
    pub meaning: &'static str,
    /// The allowed names with their meanings.
    pub names: Vec<(&'static str, &'static str)>,
}

/// Returns all keys, each table before its keys.
pub(crate) fn plan_keys() -> impl Iterator<Item = PlanKey> {
    TABLE.lines().map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        let column = |at: usize| columns.get(at).copied().unwrap_or_default();
        let names = columns.get(3..).unwrap_or_default().chunks_exact(2);
        PlanKey {
            key: column(0),
            kind: column(1),
            meaning: column(2),
            names: names.map(|pair| (pair[0], pair[1])).collect(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_types_meanings_and_names() {
        let keys: Vec<PlanKey> = plan_keys().collect();
        assert!(
            keys.iter()
                .all(|key| !key.kind.is_empty() && !key.meaning.is_empty())
        );
        let find = |name: &str| keys.iter().find(|key| key.key == name).unwrap();
        assert_eq!(find("rotation.step_deg").kind, "number");
        let names: Vec<&str> = find("depth.cut_faces").names.iter().map(|n| n.0).collect();
        assert_eq!(names, ["invalid", "flat"]);
    }
}
