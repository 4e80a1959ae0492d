//! The samples of one scan (annex A).

use super::bits::Bits;
use super::context::{Context, RunContext};

/// Coding parameters as stored in a stream; zeros select the defaults.
#[derive(Debug, Clone, Copy)]
pub(super) struct Thresholds {
    /// Largest sample, `MAXVAL`.
    pub largest: i32,
    /// `T1`, `T2`, `T3`.
    pub t: [i32; 3],
    /// `RESET`.
    pub reset: i32,
}

/// Fixed parameters of a scan.
#[derive(Debug)]
pub(super) struct Coding {
    near: i32,
    largest: i32,
    t: [i32; 3],
    reset: i64,
    /// Number of quantised errors, `RANGE`, and the bits of one, `qbpp`.
    range: i32,
    error_bits: u32,
    /// Longest code, `LIMIT`.
    limit: u32,
}

/// Lengths of run codes, as powers of two (`J`, section A.2.1).
#[rustfmt::skip]
const RUN_BITS: [u32; 32] = [
    0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13, 14, 15,
];

impl Coding {
    /// `None` for parameters that the standard does not allow.
    pub fn new(bits: u32, near: i32, given: Option<Thresholds>) -> Option<Self> {
        let given = given.unwrap_or(Thresholds {
            largest: 0,
            t: [0; 3],
            reset: 0,
        });
        let or = |given: i32, default: i32| if given == 0 { default } else { given };
        let largest = or(given.largest, (1 << bits) - 1);
        if largest >= 1 << bits || near > (largest / 2).min(255) {
            return None;
        }
        let defaults = default_thresholds(largest, near);
        let t = [0, 1, 2].map(|n| or(given.t[n], defaults[n]));
        let reset = or(given.reset, 64);
        let ordered = near < t[0] && t[0] <= t[1] && t[1] <= t[2] && t[2] <= largest;
        if !ordered || !(3..=largest.max(255)).contains(&reset) {
            return None;
        }
        let range = (largest + 2 * near) / (2 * near + 1) + 1;
        let error_bits = (range - 1).ilog2() + 1;
        let sample_bits = (largest.ilog2() + 1).max(2);
        Some(Self {
            near,
            largest,
            t,
            reset: reset.into(),
            range,
            error_bits,
            limit: 2 * (sample_bits + sample_bits.max(8)),
        })
    }

    /// Decodes a scan of `columns` by `rows` samples into `samples`, which has room for them; `None` if it ends early or
    /// is invalid.
    pub fn decode(
        &self,
        scan: &[u8],
        columns: usize,
        rows: usize,
        mut samples: Vec<u16>,
    ) -> Option<Vec<u16>> {
        let mut state = State {
            coding: self,
            bits: Bits::new(scan),
            contexts: vec![Context::new(self.range); 365],
            run_contexts: [0, 1].map(|kind| RunContext::new(self.range, kind)),
            run_index: 0,
        };
        // One more sample on each side: the neighbours of the first and the last (section A.2.1).
        let mut above = vec![0; columns + 2];
        let mut line = above.clone();
        for _ in 0..rows {
            above[columns + 1] = above[columns];
            line[0] = above[1];
            state.line(&above, &mut line)?;
            if state.bits.overdrawn() {
                return None;
            }
            samples.extend(line[1..=columns].iter().map(|&v| v as u16));
            std::mem::swap(&mut above, &mut line);
        }
        Some(samples)
    }

    /// Region of a gradient, -4 to 4.
    #[inline]
    fn region(&self, gradient: i32) -> i32 {
        let size = gradient.abs();
        let steps = i32::from(size > self.near)
            + i32::from(size >= self.t[0])
            + i32::from(size >= self.t[1])
            + i32::from(size >= self.t[2]);
        if gradient < 0 { -steps } else { steps }
    }

    /// A Golomb code of at most `limit` bits (section A.5.3).
    #[inline]
    fn code(&self, bits: &mut Bits, k: u32, limit: u32) -> Option<i32> {
        let escape = limit.checked_sub(self.error_bits + 1)?;
        let zeros = bits.zeros(escape)?;
        let code = if zeros < escape {
            i64::from(zeros) << k | i64::from(bits.take(k))
        } else {
            i64::from(bits.take(self.error_bits)) + 1
        };
        // Codes are at most twice an error, and errors at most half the range.
        (code <= 2 * i64::from(self.range)).then_some(code as i32)
    }

    /// Reconstructs a sample from a prediction and a quantised error (section A.4.5).
    #[inline]
    fn sample(&self, prediction: i32, error: i32) -> i32 {
        let step = 2 * self.near + 1;
        let mut sample = prediction + error * step;
        if sample < -self.near {
            sample += self.range * step;
        } else if sample > self.largest + self.near {
            sample -= self.range * step;
        }
        sample.clamp(0, self.largest)
    }
}

struct State<'a> {
    coding: &'a Coding,
    bits: Bits<'a>,
    contexts: Vec<Context>,
    run_contexts: [RunContext; 2],
    run_index: usize,
}

impl State<'_> {
    /// Decodes `line[1..]` up to the last sample but one; `above` is the previous line.
    fn line(&mut self, above: &[i32], line: &mut [i32]) -> Option<()> {
        let columns = line.len() - 2;
        let coding = self.coding;
        let mut x = 1;
        while x <= columns {
            let [a, b, c, d] = [line[x - 1], above[x], above[x - 1], above[x + 1]];
            let [q1, q2, q3] = [d - b, b - c, c - a].map(|gradient| coding.region(gradient));
            let context = 81 * q1 + 9 * q2 + q3;
            if context == 0 {
                x = self.run(above, line, x)?;
            } else {
                line[x] = self.regular(context, a, b, c)?;
                x += 1;
            }
        }
        Some(())
    }

    #[inline]
    fn regular(&mut self, context: i32, a: i32, b: i32, c: i32) -> Option<i32> {
        let coding = self.coding;
        let sign = context.signum();
        let context = &mut self.contexts[context.unsigned_abs() as usize];
        // The median of these three, which is equivalent to the edge detector of section A.4.2.
        let edge = (a + b - c).clamp(a.min(b), a.max(b));
        let prediction = (edge + sign * context.correction).clamp(0, coding.largest);
        let k = context.golomb;
        let code = coding.code(&mut self.bits, k, coding.limit)?;
        // Odd codes represent negative errors.
        let mut error = (code >> 1) ^ -(code & 1);
        if k == 0 && coding.near == 0 && context.is_inverted() {
            error = -(error + 1);
        }
        context.learn(error, 2 * coding.near + 1, coding.reset);
        Some(coding.sample(prediction, sign * error))
    }

    /// Decodes a run from `x` on and the sample that ends it; returns the position after it (section A.7).
    fn run(&mut self, above: &[i32], line: &mut [i32], mut x: usize) -> Option<usize> {
        let (columns, value) = (line.len() - 2, line[x - 1]);
        while self.bits.take(1) == 1 {
            let whole = 1 << RUN_BITS[self.run_index];
            let run = whole.min(columns + 1 - x);
            line[x..x + run].fill(value);
            x += run;
            if run == whole {
                self.run_index = (self.run_index + 1).min(31);
            }
            if x > columns {
                return Some(x);
            }
        }
        let bits = RUN_BITS[self.run_index];
        let run = self.bits.take(bits) as usize;
        // A run that ends with the line has no sample that ends it.
        if run > columns - x {
            return None;
        }
        line[x..x + run].fill(value);
        x += run;

        let coding = self.coding;
        let (a, b) = (value, above[x]);
        let alike = (a - b).abs() <= coding.near;
        let context = &mut self.run_contexts[usize::from(alike)];
        let k = context.golomb();
        let code = coding.code(&mut self.bits, k, coding.limit - bits - 1)?;
        let error = context.error(code, k);
        context.learn(error, code, coding.reset);
        let (prediction, sign) = match (alike, a > b) {
            (true, _) => (a, 1),
            (false, true) => (b, -1),
            (false, false) => (b, 1),
        };
        line[x] = coding.sample(prediction, sign * error);
        self.run_index = self.run_index.saturating_sub(1);
        Some(x + 1)
    }
}

/// Section C.2.4.1.1.1.
fn default_thresholds(largest: i32, near: i32) -> [i32; 3] {
    let inside = |value: i32, lower: i32| {
        if value > largest || value < lower {
            lower
        } else {
            value
        }
    };
    let raw = if largest >= 128 {
        let factor = (largest.min(4095) + 128) >> 8;
        [
            factor + 2 + 3 * near,
            4 * factor + 3 + 5 * near,
            17 * factor + 4 + 7 * near,
        ]
    } else {
        let factor = 256 / (largest + 1);
        [
            (3 / factor + 3 * near).max(2),
            (7 / factor + 5 * near).max(3),
            (21 / factor + 7 * near).max(4),
        ]
    };
    let t1 = inside(raw[0], near + 1);
    let t2 = inside(raw[1], t1);
    [t1, t2, inside(raw[2], t2)]
}
