//! Intraclass correlation coefficients.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::ratings::{Ratings, at_least_two};
use crate::error::MetricError;

/// A coefficient with its two-sided 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Icc {
    /// The coefficient; 1 is perfect agreement, values below 0 are possible.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// The six forms of McGraw and Wong. 1: each subject has other readers; A: absolute agreement, readers random;
/// C: consistency, a reader's constant offset does not count. `single`: one reader's grade, `mean`: the mean of all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IccForms {
    /// Subjects used: those that every reader graded.
    pub subjects: usize,
    /// Readers.
    pub readers: usize,
    /// ICC(1,1).
    pub one_way_single: Icc,
    /// ICC(A,1).
    pub agreement_single: Icc,
    /// ICC(C,1).
    pub consistency_single: Icc,
    /// ICC(1,k).
    pub one_way_mean: Icc,
    /// ICC(A,k).
    pub agreement_mean: Icc,
    /// ICC(C,k).
    pub consistency_mean: Icc,
}

/// Probability below the upper end of a two-sided 95 % interval.
const UPPER: f64 = 0.975;

/// Intraclass correlations of the subjects that every reader graded, from the two-way analysis of variance
/// (Shrout and Fleiss, Psychol. Bull. 86, 1979; McGraw and Wong, Psychol. Methods 1, 1996, tables 4 and 7).
///
/// # Errors
/// [`MetricError::TooFew`] if fewer than two subjects were graded by all, [`MetricError::Constant`] if the mean grades
/// of the subjects are the same, so that the correlation is undefined.
pub fn icc(ratings: &Ratings) -> Result<IccForms, MetricError> {
    let rows = ratings.complete_rows();
    at_least_two("subjects graded by every reader", rows.len())?;
    let squares = MeanSquares::of(&rows);
    // Equal means can differ by rounding.
    if squares.subjects <= 1e-12 * squares.within {
        return Err(MetricError::Constant {
            what: "mean grades of subjects",
            count: rows.len(),
            value: squares.mean,
        });
    }
    let one_way = squares.one_way();
    let agreement = squares.agreement();
    let consistency = squares.consistency();
    let mean = |single: Icc| single.of_mean(squares.k);
    Ok(IccForms {
        subjects: rows.len(),
        readers: ratings.readers(),
        one_way_single: one_way,
        agreement_single: agreement,
        consistency_single: consistency,
        one_way_mean: mean(one_way),
        agreement_mean: mean(agreement),
        consistency_mean: mean(consistency),
    })
}

impl Icc {
    /// Spearman-Brown formula for the mean of k readers; it also converts the interval of every form.
    fn of_mean(self, k: f64) -> Self {
        let stepped_up = |single: f64| k * single / (1.0 + (k - 1.0) * single);
        Self {
            value: stepped_up(self.value),
            low: stepped_up(self.low),
            high: stepped_up(self.high),
        }
    }
}

/// Mean squares of n subjects × k readers.
struct MeanSquares {
    n: f64,
    k: f64,
    mean: f64,
    /// Between subjects, n − 1 degrees of freedom.
    subjects: f64,
    /// Between readers, k − 1.
    readers: f64,
    /// Residual, (n − 1)(k − 1).
    residual: f64,
    /// Within subjects, n (k − 1).
    within: f64,
}

impl MeanSquares {
    fn of(rows: &[Vec<f64>]) -> Self {
        let (n, k) = (rows.len() as f64, rows[0].len() as f64);
        let of_subject: Vec<f64> = rows.iter().map(|row| row.iter().sum::<f64>() / k).collect();
        let of_reader: Vec<f64> = (0..rows[0].len())
            .map(|reader| rows.iter().map(|row| row[reader]).sum::<f64>() / n)
            .collect();
        let mean = of_subject.iter().sum::<f64>() / n;
        let (mut within, mut residual) = (0.0, 0.0);
        for (row, subject) in rows.iter().zip(&of_subject) {
            for (grade, reader) in row.iter().zip(&of_reader) {
                within += (grade - subject).powi(2);
                residual += (grade - subject - reader + mean).powi(2);
            }
        }
        let around_mean = |values: &[f64]| values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        Self {
            n,
            k,
            mean,
            subjects: k * around_mean(&of_subject) / (n - 1.0),
            readers: n * around_mean(&of_reader) / (k - 1.0),
            residual: residual / ((n - 1.0) * (k - 1.0)),
            within: within / (n * (k - 1.0)),
        }
    }

    fn one_way(&self) -> Icc {
        self.ratio_form(self.within, self.n * (self.k - 1.0))
    }

    fn consistency(&self) -> Icc {
        self.ratio_form(self.residual, (self.n - 1.0) * (self.k - 1.0))
    }

    /// (MS_R − MS) / (MS_R + (k − 1) MS), whose interval follows from the F distribution of MS_R / MS; `freedom` is that
    /// of MS. Written without the quotient, which is infinite if readers agree perfectly.
    fn ratio_form(&self, other: f64, freedom: f64) -> Icc {
        let of =
            |subjects: f64, other: f64| (subjects - other) / (subjects + (self.k - 1.0) * other);
        let freedom_of_subjects = self.n - 1.0;
        let below = f_quantile(freedom_of_subjects, freedom);
        let above = f_quantile(freedom, freedom_of_subjects);
        Icc {
            value: of(self.subjects, other),
            low: of(self.subjects, below * other),
            high: of(above * self.subjects, other),
        }
    }

    /// McGraw and Wong's case 2 and 3A, with Satterthwaite's degrees of freedom.
    fn agreement(&self) -> Icc {
        let Self {
            n,
            k,
            subjects,
            readers,
            residual,
            ..
        } = *self;
        let error = k * readers + (k * n - k - n) * residual;
        let value = n * (subjects - residual) / (n * subjects + error);
        if readers == 0.0 && residual == 0.0 {
            return Icc {
                value,
                low: value,
                high: value,
            };
        }
        // a and b of the source, times n (1 − ICC), which cancels in their ratio.
        let a = k * value;
        let b = n * (1.0 - value) + k * value * (n - 1.0);
        let freedom = (a * readers + b * residual).powi(2)
            / ((a * readers).powi(2) / (k - 1.0)
                + (b * residual).powi(2) / ((n - 1.0) * (k - 1.0)));
        let below = f_quantile(n - 1.0, freedom);
        let above = f_quantile(freedom, n - 1.0);
        let low = if below.is_finite() {
            n * (subjects - below * residual) / (below * error + n * subjects)
        } else {
            // The limit, if freedom is so low that the quantile exceeds all numbers.
            -n * residual / error
        };
        Icc {
            value,
            low,
            high: n * (above * subjects - residual) / (error + n * above * subjects),
        }
    }
}

fn f_quantile(numerator: f64, denominator: f64) -> f64 {
    let distribution = FisherSnedecor::new(numerator, denominator);
    distribution
        .expect("degrees of freedom are positive")
        .inverse_cdf(UPPER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn forms(rows: &[&[f64]]) -> IccForms {
        let rows = rows
            .iter()
            .map(|row| row.iter().map(|&g| Some(g)).collect());
        icc(&Ratings::new(rows.collect()).unwrap()).unwrap()
    }

    fn assert_equal(found: IccForms, expected: [[f64; 3]; 6]) {
        let found = [
            found.one_way_single,
            found.agreement_single,
            found.consistency_single,
            found.one_way_mean,
            found.agreement_mean,
            found.consistency_mean,
        ];
        for (found, [value, low, high]) in found.iter().zip(expected) {
            assert_abs_diff_eq!(found.value, value, epsilon = 1e-9);
            assert_abs_diff_eq!(found.low, low, epsilon = 1e-8);
            assert_abs_diff_eq!(found.high, high, epsilon = 1e-8);
        }
    }

    /// Shrout and Fleiss's table 2; expected: `pingouin.intraclass_corr` 0.7.0.
    #[test]
    fn shrout_and_fleiss() {
        let found = forms(&[
            &[9.0, 2.0, 5.0, 8.0],
            &[6.0, 1.0, 3.0, 2.0],
            &[8.0, 4.0, 6.0, 8.0],
            &[7.0, 1.0, 2.0, 6.0],
            &[10.0, 5.0, 6.0, 9.0],
            &[6.0, 2.0, 4.0, 7.0],
        ]);
        let expected = [
            [0.165_741_768_4, -0.132_932_32, 0.722_560_06],
            [0.289_763_779_5, 0.018_786_51, 0.761_084_37],
            [0.714_840_714_8, 0.342_464_77, 0.945_858_26],
            [0.442_797_133_7, -0.884_442_16, 0.912_415_42],
            [0.620_050_547_6, 0.071_136_82, 0.927_232_04],
            [0.909_315_542_4, 0.675_674_71, 0.985_891_68],
        ];
        assert_equal(found, expected);
    }

    /// Readers who disagree strongly leave almost no degrees of freedom, and limits that are numbers.
    #[test]
    fn strong_disagreement_has_finite_limits() {
        for rows in [[[2.5, 2.0], [1.0, 3.0]], [[1.0, 3.0], [3.0, 1.5]]] {
            let found = forms(&[&rows[0], &rows[1]]);
            for form in [found.agreement_single, found.agreement_mean] {
                let limits = [form.low, form.value, form.high];
                assert!(limits.iter().all(|limit| limit.is_finite()), "{form:?}");
            }
            let single = found.agreement_single;
            assert!(single.low <= single.value && single.value <= single.high);
        }
    }

    /// Half-step grades of four readers that agree well; expected: `pingouin.intraclass_corr` 0.7.0.
    #[test]
    fn half_steps() {
        let found = forms(&[
            &[1.0, 1.0, 1.5, 1.0],
            &[1.5, 2.0, 1.5, 1.5],
            &[3.0, 2.5, 3.0, 3.0],
            &[2.0, 2.0, 2.5, 1.5],
            &[2.5, 3.0, 2.5, 2.5],
            &[1.0, 1.5, 1.0, 1.0],
            &[2.0, 1.5, 2.0, 2.5],
            &[3.0, 3.0, 3.0, 2.5],
        ]);
        let expected = [
            [0.846_994_535_5, 0.638_108_21, 0.961_968_4],
            [0.846_649_484_5, 0.634_504_34, 0.962_007_03],
            [0.839_080_459_8, 0.614_000_32, 0.960_123_19],
            [0.956_790_123_5, 0.875_823_1, 0.990_212_94],
            [0.956_680_014_6, 0.874_119_5, 0.990_223_17],
            [0.954_248_366_0, 0.864_180_31, 0.989_723_45],
        ];
        assert_equal(found, expected);
    }

    #[test]
    fn perfect_agreement_is_one_and_an_offset_only_costs_agreement() {
        let same = forms(&[&[1.0, 1.0], &[2.0, 2.0], &[3.0, 3.0]]);
        let one = [[1.0; 3]; 6];
        assert_equal(same, one);
        let offset = forms(&[&[1.0, 1.5], &[2.0, 2.5], &[3.0, 3.5]]);
        assert_abs_diff_eq!(offset.consistency_single.value, 1.0, epsilon = 1e-12);
        assert!(offset.agreement_single.value < 0.95);
        assert!(offset.agreement_single.low < offset.agreement_single.value);
    }

    /// `scipy.stats.f.ppf(0.975, a, b)`, SciPy 1.17.1.
    #[test]
    fn quantiles_for_few_and_many_subjects() {
        for (numerator, denominator, quantile) in [
            (5.0, 15.0, 3.576_415_349_279_060_7),
            (127.0, 2.7, 17.552_059_577_068_46),
            (3.0, 1e4, 3.117_435_606_978_834),
            (3000.0, 9000.0, 1.059_726_424_306_193_7),
            (1.0, 3.0, 17.443_443_320_725_112),
            (2.2, 1.0, 816.342_188_697_369_1),
            (3.3, 3076.0, 3.004_496_817_958_201_2),
        ] {
            let found = f_quantile(numerator, denominator);
            approx::assert_relative_eq!(found, quantile, max_relative = 1e-9);
        }
    }

    #[test]
    fn nothing_to_correlate_is_refused() {
        let of = |rows: Vec<Vec<Option<f64>>>| icc(&Ratings::new(rows).unwrap());
        let equal = of(vec![vec![Some(2.0); 2]; 3]).unwrap_err();
        assert_eq!(
            equal.to_string(),
            "all 3 mean grades of subjects are 2: a correlation needs two different values"
        );
        // Readers disagree on every subject, and the means are the same: ICC(A,1) has no interval.
        let turned = [[1.0, 2.0, 3.0], [2.0, 3.0, 1.0], [3.0, 1.0, 2.0]];
        let turned = turned.map(|row| row.map(Some).to_vec()).to_vec();
        assert!(matches!(of(turned), Err(MetricError::Constant { .. })));
        let one_by_all = of(vec![vec![Some(2.0), None], vec![Some(1.0), Some(2.0)]]);
        assert_eq!(
            one_by_all.unwrap_err().to_string(),
            "the number of subjects graded by every reader is 1, expected at least 2"
        );
    }
}
