//! Lists of lanes.

use crate::transport::lanes::flights::LANES;

/// A list of lanes.
pub(super) struct Picked {
    pub lanes: [u8; LANES],
    pub count: usize,
}

impl Picked {
    pub fn new() -> Self {
        Self {
            lanes: [0; LANES],
            count: 0,
        }
    }

    /// Appends `lane` if `wanted`, without a branch.
    #[inline(always)]
    pub fn push_if(&mut self, lane: usize, wanted: bool) {
        self.lanes[self.count % LANES] = lane as u8;
        self.count += usize::from(wanted);
    }

    #[inline(always)]
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = usize> + ExactSizeIterator + '_ {
        self.lanes[..self.count]
            .iter()
            .map(|&lane| usize::from(lane) % LANES)
    }
}
