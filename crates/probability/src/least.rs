//! Least value, along a line, of a function that changes by no more than the distance.

use nalgebra::Point3;

/// Least value of `of` on the line from `from` to `to`, to `within` too large: no point is lower by more. NaN if any
/// value that was looked up is NaN.
pub(crate) fn least_m(
    of: &impl Fn(&Point3<f64>) -> f64,
    [from, to]: [&Point3<f64>; 2],
    within: f64,
) -> f64 {
    least_and_where(of, [from, to], f64::INFINITY, within).0
}

/// The same, and where it is; nothing that is above `already` is looked for.
pub(crate) fn least_and_where(
    of: &impl Fn(&Point3<f64>) -> f64,
    [from, to]: [&Point3<f64>; 2],
    already: f64,
    within: f64,
) -> (f64, Point3<f64>) {
    let ends = [of(from), of(to)];
    if ends.iter().any(|each| each.is_nan()) {
        return (f64::NAN, *from);
    }
    let mut best = if ends[0] <= ends[1] {
        (ends[0], *from)
    } else {
        (ends[1], *to)
    };
    if already < best.0 {
        best.0 = already;
    }
    descend(of, [from, to], ends, within, &mut best);
    best
}

fn descend(
    of: &impl Fn(&Point3<f64>) -> f64,
    [from, to]: [&Point3<f64>; 2],
    [at_from, at_to]: [f64; 2],
    within: f64,
    best: &mut (f64, Point3<f64>),
) {
    let length = (to - from).norm();
    if best.0.is_nan() || 0.5 * (at_from + at_to - length) >= best.0 - within {
        return;
    }
    let middle = nalgebra::center(from, to);
    let at_middle = of(&middle);
    if at_middle.is_nan() || at_middle < best.0 {
        *best = (at_middle, middle);
    }
    descend(of, [from, &middle], [at_from, at_middle], within, best);
    descend(of, [&middle, to], [at_middle, at_to], within, best);
}
