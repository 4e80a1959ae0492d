//! Reused blocks of memory: new ones would cost a page fault every 4 KiB, as much time as the arithmetic.

use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of a cache line; aligned vectors never straddle two lines.
const LINE: usize = 64;

/// Pool of returned blocks.
#[derive(Debug, Clone, Default)]
pub struct Pool(Arc<Mutex<Vec<Vec<f32>>>>);

/// A block of f32 that is aligned to a cache line and returns to its pool when dropped.
#[derive(Debug)]
pub struct Buffer {
    block: Vec<f32>,
    start: usize,
    len: usize,
    pool: Pool,
}

impl Pool {
    /// Returns a buffer of `len` values of unspecified content.
    pub fn take(&self, len: usize) -> Buffer {
        let slack = LINE / size_of::<f32>();
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // The smallest block that is large enough, unless more than half of it would be unused.
        let best = (0..free.len())
            .filter(|&i| (len + slack..=2 * len + slack).contains(&free[i].len()))
            .min_by_key(|&i| free[i].len());
        let block = match best {
            Some(index) => free.swap_remove(index),
            None => {
                drop(free);
                vec![0.0; len + slack]
            }
        };
        let start = block.as_ptr().align_offset(LINE).min(slack);
        Buffer {
            block,
            start,
            len,
            pool: self.clone(),
        }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let block = std::mem::take(&mut self.block);
        let mut free = self.pool.0.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(block);
    }
}

impl Deref for Buffer {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.block[self.start..self.start + self.len]
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.block[self.start..self.start + self.len]
    }
}
