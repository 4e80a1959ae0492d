//! Counts with singular or plural nouns.

use std::fmt::Display;

/// Formats a count with its noun: `1 person`, `2 persons`, `0 persons`. The plural is the singular with an s.
pub fn count<N: Display + PartialEq + From<u8>>(n: N, singular: &str) -> String {
    match n == N::from(1) {
        true => format!("{n} {singular}"),
        false => format!("{n} {singular}s"),
    }
}

/// The same as [`count`] with an irregular plural: `2 vertices`.
pub fn count_as<N: Display + PartialEq + From<u8>>(n: N, singular: &str, plural: &str) -> String {
    let noun = if n == N::from(1) { singular } else { plural };
    format!("{n} {noun}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_takes_the_singular() {
        assert_eq!(count(0_usize, "person"), "0 persons");
        assert_eq!(count(1_u64, "person"), "1 person");
        assert_eq!(count(2_u32, "person"), "2 persons");
        assert_eq!(count_as(1_u8, "vertex", "vertices"), "1 vertex");
        assert_eq!(count_as(21_usize, "vertex", "vertices"), "21 vertices");
    }
}
