//! Tests of splits by person.

use super::*;

fn shares(shares: &[(&str, f64)]) -> Vec<(String, f64)> {
    shares
        .iter()
        .map(|(name, share)| ((*name).to_owned(), *share))
        .collect()
}

#[test]
fn shares_are_rounded_to_whole_persons() {
    let parts = shares(&[("train", 0.7), ("val", 0.15), ("test", 0.15)]);
    assert_eq!(counts(10, &parts).unwrap(), [7, 2, 1]);
    assert_eq!(counts(17, &parts).unwrap(), [12, 3, 2]);
    assert_eq!(
        counts(3, &shares(&[("a", 1.0), ("b", 1.0), ("c", 1.0)])).unwrap(),
        [1, 1, 1]
    );
    for (patients, wrong, part) in [
        (2, shares(&[("train", 0.9), ("test", 0.1)]), "test is empty"),
        (
            9,
            shares(&[("train", 0.9), ("test", 0.0)]),
            "share of test is 0",
        ),
        (9, shares(&[("train", f64::NAN)]), "share of train is NaN"),
        (9, shares(&[("train", 1.0), ("train", 1.0)]), "given twice"),
        (9, shares(&[]), "no part"),
    ] {
        let said = counts(patients, &wrong).unwrap_err().to_string();
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn every_person_stands_in_one_part_whatever_the_seed() {
    let patients: Vec<_> = (0..17).collect();
    let parts = shares(&[("train", 0.7), ("val", 0.15), ("test", 0.15)]);
    let mut drawn = Vec::new();
    for seed in 0..20 {
        let split = Split::draw(&patients, &parts, seed).unwrap();
        split.check(&patients).unwrap();
        assert_eq!(split, Split::draw(&patients, &parts, seed).unwrap());
        drawn.push(split.parts["test"].clone());
    }
    drawn.sort();
    drawn.dedup();
    // Two of 17 persons: 136 pairs. Fewer than ten different ones from 20 seeds would be unlikely.
    assert!(drawn.len() >= 10, "{drawn:?}");
}

#[test]
fn a_person_in_two_parts_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = Split::path(folder.path(), "mine");
    let put = |text: &str| {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        Split::read(&path)
    };
    let split = put(r#"{"version": 1, "parts": {"train": [0, 3], "test": [7]}}"#).unwrap();
    assert_eq!((split.part_of(7), split.part_of(8)), (Some("test"), None));
    assert_eq!(Split::names(folder.path()).unwrap(), ["mine"]);
    split.check(&[0, 3, 7]).unwrap();
    let said = |patients: &[u32]| split.check(patients).unwrap_err().to_string();
    assert_eq!(
        said(&[0, 3, 5, 7]),
        "patient 5 is not in any part of the split"
    );
    assert_eq!(
        said(&[0, 3]),
        "patient 7 of part test is not in the dataset"
    );
    let leak = put(r#"{"version": 1, "parts": {"train": [0, 3], "test": [3]}}"#).unwrap_err();
    assert!(
        matches!(leak, SplitError::Leak { patient: 3, .. }),
        "{leak}"
    );
    assert!(matches!(
        put(r#"{"version": 2, "parts": {}}"#),
        Err(SplitError::Version(2))
    ));
    assert!(put(r#"{"version": 1, "part": {}}"#).is_err());
    let way_out = put(r#"{"version": 1, "parts": {"../../train": [0]}}"#).unwrap_err();
    assert!(matches!(way_out, SplitError::Name(_)), "{way_out}");
    assert!(Split::draw(&[0, 1], &shares(&[("/tmp/x", 1.0)]), 0).is_err());
}
