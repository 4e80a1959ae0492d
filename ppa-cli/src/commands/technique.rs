//! Choice of a radiographic technique.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use ppa_generate::{Technique, XraySettings};

#[derive(Debug, Args)]
pub struct TechniqueArgs {
    /// Typical exposure of an examination: tube voltage and load, focal spot, collimation, CsI detector [default: the paper's point source
    /// and ideal detector]
    #[arg(long, value_name = "NAME", value_parser = parser())]
    technique: Option<Technique>,
}

fn parser() -> impl TypedValueParser<Value = Technique> {
    let names = Technique::ALL.map(|(name, _)| name);
    PossibleValuesParser::new(names).map(|found| {
        let mut all = Technique::ALL.into_iter();
        let named = all.find(|(name, _)| *name == found);
        named.expect("one of the possible values").1
    })
}

impl TechniqueArgs {
    /// Changes the settings to those of the technique, if there is one.
    pub fn apply(&self, settings: &mut XraySettings) {
        if let Some(technique) = self.technique {
            technique.apply(settings);
        }
    }

    /// Describes the technique.
    pub fn describe(&self) -> String {
        let named = |technique| Technique::ALL.into_iter().find(|(_, of)| *of == technique);
        match self.technique.and_then(named) {
            Some((name, _)) => format!("radiographs by the technique {name:?}"),
            None => "all settings at their defaults".to_owned(),
        }
    }
}
