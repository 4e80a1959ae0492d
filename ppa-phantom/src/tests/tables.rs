//! The files of `data/`.

use serde::de::DeserializeOwned;

use crate::family_table::{self, FAMILY, Family};
use crate::forefoot_table::{self, Forefoot};
use crate::lower_leg_skin_table::{self, Skin};
use crate::tibia_fibula_table::{self, TibiaFibula};
use crate::{LowerLeg, Side};

fn assert_complete<T: DeserializeOwned>(text: &str) {
    let fault = |text: &str| toml::from_str::<T>(text).err().map(|e| e.to_string());
    assert_eq!(fault(text), None);
    let (without_last_entry, last_entry) = text.rsplit_once("\n[[").unwrap();
    for other in [without_last_entry, &format!("{text}\n[[{last_entry}")] {
        let found = fault(other).expect(last_entry);
        assert!(found.contains("invalid length"), "{found}");
    }
    let found = fault(&format!("{text}\nwidth_in = 1.0\n")).expect("an unknown key");
    assert!(found.contains("unknown field"), "{found}");
}

#[test]
fn files_with_an_entry_too_few_or_too_many_are_refused() {
    assert_complete::<Family>(family_table::TEXT);
    assert_complete::<Forefoot>(forefoot_table::TEXT);
    assert_complete::<Skin>(lower_leg_skin_table::TEXT);
    assert_complete::<TibiaFibula>(tibia_fibula_table::TEXT);
}

/// Each phantom takes its dimensions from the table by their names.
#[test]
fn phantoms_are_numbered_and_have_every_dimension() {
    for (n, phantom) in (1..).zip(&FAMILY.phantoms) {
        assert_eq!(phantom.name, format!("P{n:02}"));
        let leg = LowerLeg::family(&phantom.name.to_lowercase(), Side::Left).unwrap();
        assert_eq!(leg.sex(), phantom.sex);
    }
}
