//! Configurations compared in the paper: the columns of its tables 1 to 4.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use ppa_core::text::count;
use ppa_dataset::BodyShape;
use ppa_dataset::layout::View;
use serde::{Deserialize, Serialize};

/// One of the paper's experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Experiment {
    /// Synthetic images alone: does a network learn from them, and which body shapes help (table 1)?
    #[serde(rename = "1")]
    One,
    /// Finetuning on preparations: does pretraining on synthetic images help (table 2)?
    #[serde(rename = "2a")]
    TwoA,
    /// Finetuning on clinical images with weak labels (table 3).
    #[serde(rename = "2b")]
    TwoB,
    /// Linear probing on preparations: what are the features worth (table 4)?
    #[serde(rename = "2c")]
    TwoC,
    /// Experiment 1 with fewer persons to train with. Not in the paper.
    #[serde(rename = "persons")]
    Persons,
    /// Experiment 1 with fewer poses of each limb to train with. Not in the paper.
    #[serde(rename = "poses")]
    Poses,
    /// The networks of experiment 1, tested with persons whose body shapes are altered. Not in the paper.
    #[serde(rename = "shapes")]
    Shapes,
    /// Experiment 1 without one of its parts. Not in the paper.
    #[serde(rename = "ablations")]
    Ablations,
}

/// How the networks of a column differ from those of experiment 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variation {
    /// No difference.
    None,
    /// Trained with this number of persons.
    Persons(u32),
    /// Trained with every n-th angle of each limb.
    EveryPose(NonZeroUsize),
    /// Prediction by the network of one camera only.
    OneCamera(View),
    /// Left limbs are shown as they are, not as right ones.
    Unmirrored,
}

/// Body shapes of the synthetic dataset that are used for training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shapes {
    /// The skin of the scan.
    Original,
    /// The skin, grown and shrunk.
    Size,
    /// The skin, with bumps.
    Bumps,
    /// All of them.
    All,
}

/// Camera views whose synthetic images are used to pretrain a pair of networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewChoice {
    /// Both networks start from the same weights, pretrained with the images of both views.
    Unified,
    /// Each network starts from weights pretrained with the images of its own view.
    Specific,
}

/// Initial weights of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// Random weights.
    Scratch,
    /// Weights trained on ImageNet, from a file.
    ImageNet,
    /// Weights pretrained on all of the synthetic dataset.
    Synthetic {
        /// Views used for pretraining.
        views: ViewChoice,
        /// Shapes used for pretraining.
        shapes: Shapes,
    },
}

/// One column of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Configuration {
    /// The table.
    pub experiment: Experiment,
    /// Initial weights.
    pub start: Start,
    /// Shapes used for the training after that: [`Shapes::Original`] if the images are not synthetic.
    pub shapes: Shapes,
    /// How the networks differ from those of experiment 1.
    pub variation: Variation,
}

/// Error for an unknown name of an experiment.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown experiment {0:?}; expected 1, 2a, 2b, 2c, persons, poses, shapes or ablations")]
pub struct UnknownExperiment(String);

impl FromStr for Experiment {
    type Err = UnknownExperiment;

    fn from_str(name: &str) -> Result<Self, UnknownExperiment> {
        let mut all = Self::OF_PAPER.into_iter().chain(Self::OTHERS);
        let found = all.find(|experiment| experiment.name() == name);
        found.ok_or_else(|| UnknownExperiment(name.to_owned()))
    }
}

impl Experiment {
    /// The experiments of the paper, in its order.
    pub const OF_PAPER: [Self; 4] = [Self::One, Self::TwoA, Self::TwoB, Self::TwoC];

    /// The experiments that are not in the paper.
    pub const OTHERS: [Self; 4] = [Self::Persons, Self::Poses, Self::Shapes, Self::Ablations];

    /// Returns the name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "1",
            Self::TwoA => "2a",
            Self::TwoB => "2b",
            Self::TwoC => "2c",
            Self::Persons => "persons",
            Self::Poses => "poses",
            Self::Shapes => "shapes",
            Self::Ablations => "ablations",
        }
    }

    /// Returns the columns of the experiment's table, in the paper's order.
    ///
    /// The four tables have 22 columns. The paper's text counts 21 configurations and 980 runs, which are the numbers
    /// without ImageNet in experiment 2b: (4 x 3 + 10 x 2 + 3 x 3 + 4 x 2) folds x 2 views x 10 seeds.
    pub fn configurations(self) -> Vec<Configuration> {
        use Shapes::{All, Bumps, Original, Size};
        use ViewChoice::{Specific, Unified};
        let synthetic = |views, shapes| Start::Synthetic { views, shapes };
        let starts = match self {
            Self::One | Self::Shapes => {
                let column = |shapes| Configuration {
                    experiment: self,
                    start: Start::Scratch,
                    shapes,
                    variation: Variation::None,
                };
                return [Original, Size, Bumps, All].map(column).to_vec();
            }
            Self::TwoA => {
                let pretrained = [Unified, Specific].into_iter().flat_map(|views| {
                    [Original, Size, Bumps, All].map(|shapes| synthetic(views, shapes))
                });
                [Start::Scratch, Start::ImageNet]
                    .into_iter()
                    .chain(pretrained)
                    .collect()
            }
            Self::TwoB => vec![
                Start::Scratch,
                Start::ImageNet,
                synthetic(Specific, Size),
                synthetic(Specific, All),
            ],
            Self::TwoC => vec![
                Start::Scratch,
                Start::ImageNet,
                synthetic(Unified, All),
                synthetic(Specific, All),
            ],
            Self::Ablations => {
                let cameras = View::ALL.map(Variation::OneCamera);
                let variations = [Variation::None, Variation::Unmirrored]
                    .into_iter()
                    .chain(cameras);
                return variations
                    .map(|variation| self.with_variation(variation))
                    .collect();
            }
            Self::Persons | Self::Poses => Vec::new(),
        };
        let column = |start| Configuration {
            experiment: self,
            start,
            shapes: Original,
            variation: Variation::None,
        };
        starts.into_iter().map(column).collect()
    }

    /// Returns the two columns whose MAE the paper compares by a permutation test: from scratch and pretrained.
    pub fn tested_pair(self) -> Option<[Configuration; 2]> {
        let shapes = match self {
            Self::TwoA => Shapes::Size,
            Self::TwoB => Shapes::All,
            _ => return None,
        };
        let pretrained = Start::Synthetic {
            views: ViewChoice::Specific,
            shapes,
        };
        Some([Start::Scratch, pretrained].map(|start| Configuration {
            experiment: self,
            start,
            shapes: Shapes::Original,
            variation: Variation::None,
        }))
    }

    /// Returns the column of a variation of experiment 1, trained from scratch without variants of the skin.
    pub fn with_variation(self, variation: Variation) -> Configuration {
        Configuration {
            experiment: self,
            start: Start::Scratch,
            shapes: Shapes::Original,
            variation,
        }
    }
}

impl fmt::Display for Variation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("experiment 1"),
            Self::Persons(n) => f.write_str(&count(*n as usize, "person")),
            Self::EveryPose(n) if n.get() == 1 => f.write_str("every pose"),
            Self::EveryPose(n) => write!(f, "every pose of {n}"),
            Self::OneCamera(View::Left) => f.write_str("left camera only"),
            Self::OneCamera(View::Right) => f.write_str("right camera only"),
            Self::Unmirrored => f.write_str("sides not mirrored"),
        }
    }
}

impl Shapes {
    /// Returns the body shapes included.
    pub fn variants(self) -> &'static [BodyShape] {
        use BodyShape::{Big, BumpsA, BumpsB, Orig, Small};
        match self {
            Self::Original => &[Orig],
            Self::Size => &[Orig, Big, Small],
            Self::Bumps => &[Orig, BumpsA, BumpsB],
            Self::All => &BodyShape::ALL,
        }
    }

    fn heading(self) -> &'static str {
        match self {
            Self::Original => "without aug.",
            Self::Size => "size aug.",
            Self::Bumps => "bump aug.",
            Self::All => "all aug.",
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Original => "original",
            Self::Size => "size",
            Self::Bumps => "bumps",
            Self::All => "all",
        }
    }
}

impl ViewChoice {
    fn heading(self) -> &'static str {
        match self {
            Self::Unified => "unified camera view",
            Self::Specific => "camera view specific",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Unified => "unified",
            Self::Specific => "specific",
        }
    }
}

impl Configuration {
    /// Returns the headings of the column as printed in the paper, the most general first.
    pub fn headings(self) -> Vec<String> {
        if self.is_named_by_variation() {
            return vec![self.variation.to_string()];
        }
        let headings = self.headings_of_paper();
        headings.into_iter().map(str::to_owned).collect()
    }

    fn is_named_by_variation(self) -> bool {
        self.variation != Variation::None || self.experiment == Experiment::Ablations
    }

    /// Returns the cameras whose networks' predictions are averaged.
    pub fn views(self) -> &'static [View] {
        match self.variation {
            Variation::OneCamera(View::Left) => &[View::Left],
            Variation::OneCamera(View::Right) => &[View::Right],
            _ => &View::ALL,
        }
    }

    fn headings_of_paper(self) -> Vec<&'static str> {
        let Start::Synthetic { views, shapes } = self.start else {
            return vec![match self {
                Self {
                    experiment: Experiment::One | Experiment::Shapes,
                    ..
                } => self.shapes.heading(),
                Self {
                    start: Start::Scratch,
                    ..
                } => "from scratch",
                _ => "pretrained on ImageNet",
            }];
        };
        let below = match self.experiment {
            Experiment::TwoB => vec![shapes.heading()],
            Experiment::TwoC => vec![views.heading()],
            _ => vec![views.heading(), shapes.heading()],
        };
        [vec!["pretrained on synthetic dataset"], below].concat()
    }

    /// Returns the name for folders and rows, unique within the experiment, of lower-case letters and `-`.
    pub fn name(self) -> String {
        match self.start {
            _ if self.is_named_by_variation() => self.variation.to_string().replace(' ', "-"),
            Start::Scratch if matches!(self.experiment, Experiment::One | Experiment::Shapes) => {
                self.shapes.name().to_owned()
            }
            Start::Scratch => "scratch".to_owned(),
            Start::ImageNet => "imagenet".to_owned(),
            Start::Synthetic { views, shapes } => format!("{}-{}", views.name(), shapes.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_tables_have_the_papers_columns() {
        let columns = Experiment::OF_PAPER.map(|e| e.configurations().len());
        assert_eq!(columns, [4, 10, 4, 4]);
        // The paper's counts: 21 configurations, 980 downstream runs, 1100 networks (section 4.3).
        let folds = [3, 2, 3, 2];
        let imagenet_2b = 1;
        assert_eq!(columns.iter().sum::<usize>() - imagenet_2b, 21);
        let runs = columns.iter().zip(folds).map(|(c, f)| c * f * 2 * 10);
        let runs = runs.sum::<usize>() - imagenet_2b * 3 * 2 * 10;
        assert_eq!(runs, 980);
    }

    #[test]
    fn names_are_unique_within_an_experiment() {
        let others = [Experiment::Shapes, Experiment::Ablations];
        for experiment in Experiment::OF_PAPER.into_iter().chain(others) {
            assert_eq!(experiment.name().parse(), Ok(experiment));
            let columns = experiment.configurations();
            let names: BTreeSet<_> = columns.iter().map(|c| c.name()).collect();
            assert_eq!(names.len(), columns.len());
            let headings: BTreeSet<_> = columns.iter().map(|c| c.headings()).collect();
            assert_eq!(headings.len(), columns.len());
            if let Some(pair) = experiment.tested_pair() {
                assert!(pair.iter().all(|column| columns.contains(column)));
            }
        }
    }
}
