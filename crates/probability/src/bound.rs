//! At most: upper bounds of how likely a needle comes too close, without sampling.
//!
//! Both are proofs given the law. Distributions that are no normal ones (bends, their directions, phases of failed
//! holds) are cut into cells, each taken at its worst end, so that no step makes a bound smaller.

mod along;
mod mixture;
mod planes;
mod stations;

use crate::case::{Anatomy, Case};
use crate::event::{Event, EventError};

/// How a bound was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundKind {
    /// A path that is off laterally by e at a station does not meet what is farther away than |e|.
    Stations,
    /// A path does not meet what lies beyond a plane unless it is off towards it.
    HalfPlanes,
    /// Sum of the bounds of several structures.
    Sum,
}

/// An upper bound of a probability, given the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// 0 to 1.
    pub probability: f64,
    /// How it was found.
    pub kind: BoundKind,
}

/// Below this half-planes are enough: stations, which take as long, were never lower (130 cells of the tests).
const CLEAR: f64 = 0.01;

/// Rounding of sums of up to 1e5 tails, relative.
const ROUNDING: f64 = 1e-9;

/// How likely a needle comes closer to structures than a margin, at most; none for events that are wanted.
///
/// # Errors
/// [`EventError`].
pub fn at_most<A: Anatomy>(case: &Case<'_, A>, event: &Event) -> Result<Option<Bound>, EventError> {
    event.check(case)?;
    Ok(event
        .obstacles()
        .map(|(structures, margin_m)| of_structures(case, structures, margin_m)))
}

fn of_structures<A: Anatomy>(case: &Case<'_, A>, structures: &[usize], margin_m: f64) -> Bound {
    let each: Vec<Bound> = structures
        .iter()
        .map(|structure| of_structure(case, *structure, margin_m))
        .collect();
    if let [one] = each.as_slice() {
        return *one;
    }
    let sum: f64 = each.iter().map(|bound| bound.probability).sum();
    Bound {
        probability: sum.min(1.0),
        kind: BoundKind::Sum,
    }
}

fn of_structure<A: Anatomy>(case: &Case<'_, A>, structure: usize, margin_m: f64) -> Bound {
    let planes = planes::bound(case, structure, margin_m);
    let (probability, kind) = match planes {
        Some(planes) if planes < CLEAR => (planes, BoundKind::HalfPlanes),
        _ => {
            let stations = stations::bound(case, structure, margin_m);
            let planes = planes.filter(|planes| *planes < stations);
            planes.map_or((stations, BoundKind::Stations), |planes| {
                (planes, BoundKind::HalfPlanes)
            })
        }
    };
    Bound {
        probability: (probability * (1.0 + ROUNDING)).min(1.0),
        kind,
    }
}
