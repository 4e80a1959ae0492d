//! Job arrays of shards: chunks within the cluster's limit, and lists of indices.

/// Shards of one job array. Task `index` of the array makes shard `offset + index`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArrayChunk {
    /// Number added to an index.
    pub offset: u64,
    /// Indices in ascending order, counted from 1.
    pub indices: Vec<u64>,
}

/// Divides shards, given in ascending order and counted from 1, into arrays whose indices are below `max_array_size`.
///
/// `max_array_size` is Slurm's MaxArraySize and at least 2, see [`max_array_size`](crate::max_array_size). The chunk of a shard does not
/// depend on the other shards.
pub fn split(shards: &[u64], max_array_size: u64) -> Vec<ArrayChunk> {
    let most = max_array_size.saturating_sub(1).max(1);
    let mut chunks: Vec<ArrayChunk> = Vec::new();
    for shard in shards {
        let offset = (shard - 1) / most * most;
        match chunks.last_mut() {
            Some(chunk) if chunk.offset == offset => chunk.indices.push(shard - offset),
            _ => chunks.push(ArrayChunk {
                offset,
                indices: vec![shard - offset],
            }),
        }
    }
    chunks
}

/// Formats ascending numbers as Slurm does: `1-3,7,9-12`.
pub fn index_list(indices: &[u64]) -> String {
    let mut runs: Vec<(u64, u64)> = Vec::new();
    for &index in indices {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == index => *last = index,
            _ => runs.push((index, index)),
        }
    }
    let text = runs.iter().map(|&(first, last)| match last - first {
        0 => first.to_string(),
        _ => format!("{first}-{last}"),
    });
    text.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn chunks_hold_each_shard_once_below_the_limit(
            shards in prop::collection::btree_set(1_u64..5000, 1..200), limit in 2_u64..1500
        ) {
            let shards: Vec<_> = shards.into_iter().collect();
            let chunks = split(&shards, limit);
            let of = |chunk: &ArrayChunk| {
                chunk.indices.iter().map(|index| chunk.offset + index).collect::<Vec<_>>()
            };
            prop_assert_eq!(chunks.iter().flat_map(of).collect::<Vec<_>>(), shards);
            for chunk in &chunks {
                prop_assert!(chunk.indices.iter().all(|index| (1..limit).contains(index)));
            }
        }
    }

    #[test]
    fn more_shards_than_slurms_default_make_four_arrays() {
        let shards: Vec<_> = (1..=3077).collect();
        let chunks = split(&shards, 1001);
        let sizes: Vec<_> = chunks.iter().map(|chunk| chunk.indices.len()).collect();
        assert_eq!(sizes, [1000, 1000, 1000, 77]);
        assert_eq!(chunks[3].offset, 3000);
        assert_eq!(index_list(&chunks[3].indices), "1-77");
    }

    #[test]
    fn runs_of_indices_are_shortened() {
        assert_eq!(index_list(&[1, 2, 3, 7, 9, 10]), "1-3,7,9-10");
        assert_eq!(index_list(&[]), "");
    }
}
