//! Adaptive statistics of a context (sections A.4 to A.6).

/// Statistics of one context of the regular mode.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context {
    /// Sum of magnitudes, `A`.
    magnitude: i64,
    /// Sum of errors, `B`.
    bias: i64,
    /// Correction of the prediction, `C`.
    pub correction: i32,
    /// Errors counted, `N`.
    count: i64,
    /// The Golomb parameter `k`, computed when the statistics are updated so that decoding need not wait for it.
    pub golomb: u32,
}

impl Context {
    pub fn new(range: i32) -> Self {
        let magnitude = first_magnitude(range);
        Self {
            magnitude,
            bias: 0,
            correction: 0,
            count: 1,
            golomb: golomb(1, magnitude),
        }
    }

    /// Whether codes represent errors mirrored about -1/2 (section A.5.2).
    #[inline]
    pub fn is_inverted(&self) -> bool {
        2 * self.bias <= -self.count
    }

    /// Updates the statistics with a quantised error.
    #[inline]
    pub fn learn(&mut self, error: i32, step: i32, reset: i64) {
        self.bias += i64::from(error * step);
        self.magnitude += i64::from(error.abs());
        if self.count == reset {
            self.magnitude >>= 1;
            self.bias >>= 1;
            self.count >>= 1;
        }
        self.count += 1;
        self.golomb = golomb(self.count, self.magnitude);
        // Branch-free, since noise would make branches unpredictable. Clamping does not change a bias within the bounds.
        let (low, high) = (self.bias <= -self.count, self.bias > 0);
        let step = i64::from(low) - i64::from(high);
        self.bias = (self.bias + step * self.count).clamp(1 - self.count, 0);
        self.correction = (self.correction - step as i32).clamp(-128, 127);
    }
}

/// Statistics of the samples that end runs; one context for equal neighbours, one for different ones.
#[derive(Debug, Clone, Copy)]
pub(super) struct RunContext {
    magnitude: i64,
    count: i64,
    /// Negative errors, `Nn`.
    negative: i64,
    /// 1 if the neighbours agree.
    kind: i32,
}

impl RunContext {
    pub fn new(range: i32, kind: i32) -> Self {
        Self {
            magnitude: first_magnitude(range),
            count: 1,
            negative: 0,
            kind,
        }
    }

    pub fn golomb(&self) -> u32 {
        golomb(
            self.count,
            self.magnitude + i64::from(self.kind) * (self.count >> 1),
        )
    }

    /// Returns the error of a code (section A.7.2.2).
    pub fn error(&self, code: i32, k: u32) -> i32 {
        let doubled = code + self.kind;
        let mapped = doubled & 1;
        let magnitude = (doubled + mapped) / 2;
        let negative_if_mapped = k != 0 || 2 * self.negative >= self.count;
        if negative_if_mapped == (mapped == 1) {
            -magnitude
        } else {
            magnitude
        }
    }

    pub fn learn(&mut self, error: i32, code: i32, reset: i64) {
        self.negative += i64::from(error < 0);
        self.magnitude += i64::from((code + 1 - self.kind) >> 1);
        if self.count == reset {
            self.magnitude >>= 1;
            self.count >>= 1;
            self.negative >>= 1;
        }
        self.count += 1;
    }
}

fn first_magnitude(range: i32) -> i64 {
    i64::from((range + 32) >> 6).max(2)
}

/// Smallest `k` with `count · 2^k ≥ magnitude`; `count` is at least 1.
#[inline]
fn golomb(count: i64, magnitude: i64) -> u32 {
    // The `k` at which both have the same number of bits, or the next one.
    let k = count
        .leading_zeros()
        .saturating_sub(magnitude.leading_zeros());
    k + u32::from((count << k) < magnitude)
}
