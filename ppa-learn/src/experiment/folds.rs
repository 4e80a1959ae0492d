//! Cross-validation folds by person, never by image.

use std::collections::{BTreeMap, BTreeSet};

use rand::seq::SliceRandom;

use crate::random::{Purpose, stream};

/// Error in dividing persons into folds.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FoldError {
    /// Fewer persons than folds, or no person left for training.
    #[error(
        "{persons} persons cannot be tested in {folds} folds: each fold needs at least one person to test and one to train with"
    )]
    TooFewPersons {
        /// Number of persons.
        persons: usize,
        /// Number of folds requested.
        folds: usize,
    },
    /// No choice of persons gives every fold the requested number of limbs.
    #[error(
        "no choice of {folds} sets of persons gives each set {limbs} limbs and leaves a person to train with; limbs per person: {}",
        ppa_core::text::numbers(counts.iter().map(|&n| n as f64))
    )]
    NoSuchLimbs {
        /// Number of folds requested.
        folds: usize,
        /// Number of limbs requested for each test set.
        limbs: usize,
        /// Number of limbs of each person.
        counts: Vec<usize>,
    },
}

/// Returns the persons of each fold's test set, such that each person is tested once and the sizes of the sets differ by at most one.
///
/// With as many folds as persons, each fold tests one person, as for the paper's preparations, where one is used for
/// training and the other for testing.
///
/// # Errors
/// [`FoldError::TooFewPersons`].
pub fn cross_validation(
    persons: &BTreeSet<u32>,
    folds: usize,
    seed: u64,
) -> Result<Vec<BTreeSet<u32>>, FoldError> {
    if folds < 2 {
        let persons = persons.len();
        return Err(FoldError::TooFewPersons { persons, folds });
    }
    let order = shuffled(persons.iter().copied(), folds, seed)?;
    let mut sets = vec![BTreeSet::new(); folds];
    for (n, person) in order.into_iter().enumerate() {
        sets[n % folds].insert(person);
    }
    Ok(sets)
}

/// Returns the persons of each fold's test set, such that each set has `limbs` limbs and nobody is tested twice: the paper's
/// folds of the synthetic dataset, where three random ankles are tested.
///
/// `limbs_of` counts the limbs of each person.
///
/// # Errors
/// [`FoldError`] if there are too few persons, or if no choice of them gives the number of limbs in every fold.
pub fn folds_of_limbs(
    limbs_of: &BTreeMap<u32, usize>,
    limbs: usize,
    folds: usize,
    seed: u64,
) -> Result<Vec<BTreeSet<u32>>, FoldError> {
    let order = shuffled(limbs_of.keys().copied(), folds, seed)?;
    let mut search = Search {
        limbs,
        counts: order.iter().map(|person| limbs_of[person]).collect(),
        fold_of: vec![None; order.len()],
        hopeless: BTreeSet::new(),
    };
    if limbs == 0 || search.counts.contains(&0) || !search.fill(folds, 0, limbs) {
        return Err(FoldError::NoSuchLimbs {
            folds,
            limbs,
            counts: limbs_of.values().copied().collect(),
        });
    }
    let mut sets = vec![BTreeSet::new(); folds];
    for (person, fold) in order.into_iter().zip(search.fold_of) {
        if let Some(fold) = fold {
            sets[fold - 1].insert(person);
        }
    }
    Ok(sets)
}

/// Search for test sets, trying persons in their random order.
struct Search {
    limbs: usize,
    counts: Vec<usize>,
    fold_of: Vec<Option<usize>>,
    /// States without a solution: number of folds to fill, and sorted limb counts of the remaining persons.
    hopeless: BTreeSet<(usize, Vec<usize>)>,
}

impl Search {
    /// Fills fold number `fold`, which still needs `open` limbs from persons at or after `from`, and then the folds below it.
    fn fill(&mut self, fold: usize, from: usize, open: usize) -> bool {
        if open == 0 {
            if fold == 1 {
                // At least one person outside this fold is left for training.
                return self.fold_of.iter().any(|&of| of != Some(fold));
            }
            let state = (fold - 1, self.left());
            if self.hopeless.contains(&state) {
                return false;
            }
            let found = self.fill(fold - 1, 0, self.limbs);
            if !found {
                self.hopeless.insert(state);
            }
            return found;
        }
        // If a person did not lead to a solution, no later one with the same number of limbs does.
        let mut tried = BTreeSet::new();
        for n in from..self.counts.len() {
            let count = self.counts[n];
            if self.fold_of[n].is_none() && count <= open && tried.insert(count) {
                self.fold_of[n] = Some(fold);
                if self.fill(fold, n + 1, open - count) {
                    return true;
                }
                self.fold_of[n] = None;
            }
        }
        false
    }

    fn left(&self) -> Vec<usize> {
        let persons = self.counts.iter().zip(&self.fold_of);
        let free = persons.filter(|(_, fold)| fold.is_none());
        let mut left: Vec<_> = free.map(|(&count, _)| count).collect();
        left.sort_unstable();
        left
    }
}

fn shuffled(
    persons: impl Iterator<Item = u32>,
    folds: usize,
    seed: u64,
) -> Result<Vec<u32>, FoldError> {
    let mut order: Vec<_> = persons.collect();
    if folds == 0 || order.len() < folds.max(2) {
        return Err(FoldError::TooFewPersons {
            persons: order.len(),
            folds,
        });
    }
    order.shuffle(&mut stream(seed, Purpose::Folds, 0));
    Ok(order)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn persons(count: usize) -> BTreeSet<u32> {
        (0..count as u32).collect()
    }

    #[test]
    fn two_preparations_are_tested_in_turn() {
        let sets = cross_validation(&persons(2), 2, 1).unwrap();
        assert_eq!(sets.iter().map(BTreeSet::len).collect::<Vec<_>>(), [1, 1]);
        assert_ne!(sets[0], sets[1]);
        let found = cross_validation(&persons(1), 1, 1);
        assert!(matches!(
            found,
            Err(FoldError::TooFewPersons { persons: 1, .. })
        ));
    }

    #[test]
    fn three_of_the_papers_seventeen_ankles_are_tested() {
        // 10 persons with 17 ankles: seven with both.
        let limbs: BTreeMap<_, _> = persons(10)
            .into_iter()
            .map(|person| (person, if person < 7 { 2 } else { 1 }))
            .collect();
        for seed in 0..100 {
            let sets = folds_of_limbs(&limbs, 3, 3, seed).unwrap();
            let tested: Vec<_> = sets.iter().flatten().collect();
            assert_eq!(tested.iter().collect::<BTreeSet<_>>().len(), tested.len());
            for set in &sets {
                assert_eq!(set.iter().map(|person| limbs[person]).sum::<usize>(), 3);
            }
        }
        assert!(folds_of_limbs(&limbs, 3, 0, 1).is_err());
        // An odd number of limbs from persons with two each: must fail quickly for any number of persons.
        let pairs: BTreeMap<_, _> = persons(200).into_iter().map(|p| (p, 2)).collect();
        assert!(folds_of_limbs(&pairs, 21, 3, 1).is_err());
        assert_eq!(
            folds_of_limbs(&persons(4).into_iter().map(|p| (p, 2)).collect(), 3, 1, 0),
            Err(FoldError::NoSuchLimbs {
                folds: 1,
                limbs: 3,
                counts: vec![2; 4]
            })
        );
    }

    proptest! {
        #[test]
        fn everybody_is_tested_once(count in 2usize..40, folds in 1usize..8, seed: u64) {
            let everybody = persons(count);
            let found = cross_validation(&everybody, folds, seed);
            if folds < 2 || count < folds {
                prop_assert!(found.is_err());
                return Ok(());
            }
            let sets = found.unwrap();
            let sizes: Vec<_> = sets.iter().map(BTreeSet::len).collect();
            prop_assert_eq!(sizes.iter().sum::<usize>(), count);
            prop_assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1);
            prop_assert_eq!(sets.into_iter().flatten().collect::<BTreeSet<_>>(), everybody);
        }
    }
}
