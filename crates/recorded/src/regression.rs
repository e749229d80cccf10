//! Estimates with intervals.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Parts of a run of which one is left out at a time.
pub(crate) const BLOCKS: usize = 20;

/// 97.5 % point of Student's distribution with `BLOCKS - 1` degrees of freedom.
const STUDENT: f64 = 2.093;

/// Share of a parameter that may lie in directions which the data do not determine.
const UNDETERMINED: f64 = 1e-4;

/// Directions with less of the scaled information than this, as a share of the largest, are not
/// determined: rounding of sums of a million products.
const RANK: f64 = 1e-10;

/// A figure of a run, with how well the run shows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The value; none where the run does not show it.
    pub value: Option<f64>,
    /// Half of the 95 % interval.
    pub half_width: Option<f64>,
    /// Whether the run shows it well enough to be used.
    pub identifiable: bool,
}

impl Estimate {
    /// What a run does not show at all.
    pub const NONE: Self = Self {
        value: None,
        half_width: None,
        identifiable: false,
    };

    /// The value, if it can be used.
    pub fn known(&self) -> Option<f64> {
        self.value.filter(|_| self.identifiable)
    }

    /// Not identifiable if it is negative by more than its interval: what cannot be negative and comes out
    /// so is of torques that the equation does not describe.
    #[must_use]
    pub(crate) fn not_negative(mut self) -> Self {
        if let (Some(value), Some(half)) = (self.value, self.half_width) {
            self.identifiable &= value >= -half;
        }
        self
    }

    /// Identifiable if the interval is no wider, to each side, than `coarsest` or a share of the value.
    #[must_use]
    pub(crate) fn within(mut self, coarsest: f64, share: f64) -> Self {
        self.identifiable = match (self.value, self.half_width) {
            (Some(value), Some(half)) => half <= coarsest.max(share * value.abs()),
            _ => false,
        };
        self
    }
}

/// Rows of each block: contiguous and as long as each other.
pub(crate) fn spans(count: usize) -> Vec<Range<usize>> {
    (0..BLOCKS)
        .map(|k| k * count / BLOCKS..(k + 1) * count / BLOCKS)
        .collect()
}

/// The estimate of all blocks with the interval of the delete-one-block jackknife: neighbouring rows
/// are not independent, blocks nearly are.
///
/// `of(None)` is the estimate of all, `of(Some(block))` that without a block; a block without which
/// there is no estimate leaves none.
pub(crate) fn jackknife(of: &dyn Fn(Option<usize>) -> Option<f64>) -> Estimate {
    let Some(value) = of(None) else {
        return Estimate::NONE;
    };
    let without: Option<Vec<f64>> = (0..BLOCKS).map(|block| of(Some(block))).collect();
    Estimate {
        value: Some(value),
        half_width: without.map(|values| half_width(&values)),
        identifiable: false,
    }
}

/// Half of the 95 % interval from estimates without a block each.
pub(crate) fn half_width(without: &[f64]) -> f64 {
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let square: f64 = without.iter().map(|value| (value - mean).powi(2)).sum();
    STUDENT * ((count - 1.0) / count * square).sqrt()
}

/// A figure of fits: of all blocks, with the interval by those without a block each. A fit that does not
/// show it leaves no interval.
pub(crate) fn estimate<T>(all: &T, without: &[T], of: &dyn Fn(&T) -> Option<f64>) -> Estimate {
    let Some(value) = of(all) else {
        return Estimate::NONE;
    };
    let others: Option<Vec<f64>> = without.iter().map(of).collect();
    Estimate {
        value: Some(value),
        half_width: others.map(|values| half_width(&values)),
        identifiable: false,
    }
}

/// A least-squares solution.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    /// One value per parameter; the smallest ones where the data leave a choice.
    pub values: DVector<f64>,
    /// Whether the data determine each parameter.
    pub determined: Vec<bool>,
}

impl Solution {
    /// As many unknowns as rows fit any rows: they determine nothing.
    pub(crate) fn determined_by(&mut self, rows: f64) {
        if rows <= self.values.len() as f64 {
            self.determined.fill(false);
        }
    }
}

/// Solves `N p = r` for a symmetric positive semi-definite `N`, in the directions that it determines.
pub(crate) fn solve(normal: &DMatrix<f64>, right: &DVector<f64>) -> Solution {
    let count = right.len();
    let scale = normal
        .diagonal()
        .map(|value| if value > 0.0 { value.sqrt() } else { 0.0 });
    let inverse = scale.map(|value| if value > 0.0 { 1.0 / value } else { 0.0 });
    let scaled = DMatrix::from_fn(count, count, |i, j| {
        normal[(i, j)] * inverse[i] * inverse[j]
    });
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let scaled_right = right.component_mul(&inverse);
    let mut values = DVector::zeros(count);
    let mut lost = DVector::<f64>::zeros(count);
    for (k, eigenvalue) in eigen.eigenvalues.iter().enumerate() {
        let direction = eigen.eigenvectors.column(k);
        if *eigenvalue > RANK * largest {
            values += direction * (direction.dot(&scaled_right) / eigenvalue);
        } else {
            lost += direction.component_mul(&direction);
        }
    }
    Solution {
        values: values.component_mul(&inverse),
        determined: (0..count)
            .map(|i| scale[i] > 0.0 && lost[i] < UNDETERMINED)
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_data_leave_open_is_not_determined() {
        // p0 + p1 = 3, p2 = 1; the third column stands alone.
        let rows = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 4.0]);
        let right = DVector::from_column_slice(&[3.0, 6.0, 4.0]);
        let found = solve(&(rows.transpose() * &rows), &(rows.transpose() * right));
        assert_eq!(found.determined, [false, false, true]);
        assert!((found.values[2] - 1.0).abs() < 1e-12);
        assert!((found.values[0] + found.values[1] - 3.0).abs() < 1e-9);
    }

    /// Of a mean the jackknife's interval is that of the blocks' means.
    #[test]
    fn the_interval_of_a_mean_is_students() {
        let blocks: Vec<f64> = (0..BLOCKS).map(|k| (k * 7 % 11) as f64).collect();
        let count = BLOCKS as f64;
        let mean = blocks.iter().sum::<f64>() / count;
        let of = |without: Option<usize>| {
            let kept = blocks
                .iter()
                .enumerate()
                .filter(|(k, _)| Some(*k) != without);
            let (sum, n) = kept.fold((0.0, 0.0), |(sum, n), (_, value)| (sum + value, n + 1.0));
            Some(sum / n)
        };
        let found = jackknife(&of);
        let variance = blocks.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let wanted = STUDENT * (variance / count).sqrt();
        assert!((found.value.unwrap() - mean).abs() < 1e-12);
        assert!((found.half_width.unwrap() - wanted).abs() < 1e-12);
    }
}
