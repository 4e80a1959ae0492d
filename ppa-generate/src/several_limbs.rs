//! Work on several limbs at once.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

/// Number of threads that preparing a limb and its poses keeps busy; more would be idle most of the time.
const THREADS_PER_LIMB: usize = 4;

/// Limbs in progress at a time. Each needs the memory of a prepared limb, so only as many as keep the threads busy.
pub(crate) fn limbs_at_once() -> usize {
    rayon::current_num_threads().div_ceil(THREADS_PER_LIMB)
}

/// Returns the results of `work` for each limb and its index, in the order of the limbs, with up to [`limbs_at_once`] in progress. Limbs
/// begin in order, and none begins after one has failed.
///
/// # Errors
/// One of the errors of `work`.
pub(crate) fn for_each_limb<T: Sync, R: Send, E: Send>(
    limbs: &[T],
    work: impl Fn(usize, &T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let next = AtomicUsize::new(0);
    let one_after_another = |_| {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(limb) = limbs.get(index) else {
                return Ok(done);
            };
            let result =
                work(index, limb).inspect_err(|_| next.store(limbs.len(), Ordering::Relaxed))?;
            done.push((index, result));
        }
    };
    let workers = (0..limbs_at_once()).into_par_iter().with_max_len(1);
    let done: Vec<Vec<_>> = workers.map(one_after_another).collect::<Result<_, E>>()?;
    let mut done: Vec<_> = done.into_iter().flatten().collect();
    done.sort_unstable_by_key(|(index, _)| *index);
    Ok(done.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs `test` in a pool of its own: four threads keep one limb in progress, eight keep two.
    fn in_pool(threads: usize, test: impl FnOnce() + Send) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(test);
    }

    #[test]
    fn results_have_the_order_of_the_limbs() {
        in_pool(8, || {
            let limbs: Vec<u64> = (0..50).collect();
            let (running, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let squares = for_each_limb(&limbs, |index, limb| {
                assert_eq!(index as u64, *limb);
                let now = running.fetch_add(1, Ordering::Relaxed) + 1;
                most.fetch_max(now, Ordering::Relaxed);
                // Poses of the limb, which idle threads take over.
                let sum: u64 = (0..1000_u64).into_par_iter().map(|pose| pose % 2).sum();
                running.fetch_sub(1, Ordering::Relaxed);
                Ok::<_, ()>(sum * limb)
            });
            let expected: Vec<u64> = (0..50).map(|limb| 500 * limb).collect();
            assert_eq!(squares.unwrap(), expected);
            assert!(most.into_inner() <= 2);
        });
    }

    #[test]
    fn no_limb_begins_after_a_failure() {
        in_pool(4, || {
            let begun = AtomicUsize::new(0);
            let failed = for_each_limb(&[(); 1000], |index, ()| {
                begun.fetch_add(1, Ordering::Relaxed);
                if index == 3 { Err(index) } else { Ok(()) }
            });
            assert_eq!(failed.unwrap_err(), 3);
            assert_eq!(begun.into_inner(), 4);
        });
    }
}
