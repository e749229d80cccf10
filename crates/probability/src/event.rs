//! What can happen to a needle, and whether it does in a draw.

use nalgebra::{Point3, Vector3};

use crate::breath::Body;
use crate::case::{Anatomy, Case};
use crate::draw::{PathDraw, Shifts};
use crate::least::least_and_where;

/// What can happen. Structures are named by their number.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The needle's surface comes closer to a structure than a margin, m; 0: they meet.
    Closer {
        /// Which.
        structure: usize,
        /// 0 or more, m.
        margin_m: f64,
    },
    /// The same of any of some structures.
    Any {
        /// Which.
        structures: Vec<usize>,
        /// 0 or more, m.
        margin_m: f64,
    },
    /// The tip is inside a structure.
    TipInside {
        /// Which: the lesion.
        structure: usize,
    },
    /// At least so much of the notch is inside a structure.
    NotchInside {
        /// Which: the lesion.
        structure: usize,
        /// Where the notch begins and ends along the needle, from the planned tip, m; positive beyond it, in the throw.
        notch_m: [f64; 2],
        /// Length inside, m.
        least_m: f64,
    },
    /// The tip is within a distance of its planned point, which moves with a body.
    TipWithin {
        /// Distance, m.
        radius_m: f64,
        /// What the point moves with.
        body: Body,
    },
}

impl Event {
    /// Whether a case can be asked for it.
    pub(crate) fn check<A>(&self, case: &Case<'_, A>) -> Result<(), EventError> {
        let exists = |structure: usize| {
            let count = case.structures.len();
            if structure < count {
                Ok(())
            } else {
                Err(EventError::Structure { structure, count })
            }
        };
        let length = |what: &'static str, value_m: f64| {
            if value_m >= 0.0 && value_m.is_finite() {
                Ok(())
            } else {
                Err(EventError::Length { what, value_m })
            }
        };
        match self {
            Self::Closer {
                structure,
                margin_m,
            } => {
                exists(*structure)?;
                length("margin", *margin_m)
            }
            Self::Any {
                structures,
                margin_m,
            } => {
                for structure in structures {
                    exists(*structure)?;
                }
                length("margin", *margin_m)
            }
            Self::TipInside { structure } => exists(*structure),
            Self::NotchInside {
                structure,
                notch_m: [from_m, to_m],
                least_m,
            } => {
                exists(*structure)?;
                length("length of the notch inside", *least_m)?;
                let needle = &case.needle;
                let is_on_needle = *from_m >= -needle.depth_m && *to_m <= needle.throw_m;
                if is_on_needle && from_m < to_m {
                    Ok(())
                } else {
                    Err(EventError::Notch {
                        from_m: *from_m,
                        to_m: *to_m,
                    })
                }
            }
            Self::TipWithin { radius_m, .. } => length("radius", *radius_m),
        }
    }

    /// Whether it is wanted: its misses are then what is rare.
    pub fn is_wanted(&self) -> bool {
        !matches!(self, Self::Closer { .. } | Self::Any { .. })
    }

    /// Structures that come too close, and the margin, of events that are not wanted.
    pub(crate) fn obstacles(&self) -> Option<(&[usize], f64)> {
        match self {
            Self::Closer {
                structure,
                margin_m,
            } => Some((std::slice::from_ref(structure), *margin_m)),
            Self::Any {
                structures,
                margin_m,
            } => Some((structures, *margin_m)),
            _ => None,
        }
    }

    /// Structure whose boundary decides it alone.
    pub(crate) fn boundary(&self) -> Option<usize> {
        match self {
            Self::Closer { structure, .. }
            | Self::TipInside { structure }
            | Self::NotchInside { structure, .. } => Some(*structure),
            Self::Any { .. } | Self::TipWithin { .. } => None,
        }
    }
}

/// Why a case cannot be asked for an event.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EventError {
    /// A structure that is not there.
    #[error("structure {structure} is not one of the {count} of the case")]
    Structure {
        /// Number.
        structure: usize,
        /// How many there are.
        count: usize,
    },
    /// A margin, a radius or a length.
    #[error("{what} is {value_m} m; must be 0 or more")]
    Length {
        /// What it is.
        what: &'static str,
        /// As given, m.
        value_m: f64,
    },
    /// A notch that is not on the needle.
    #[error(
        "the notch from {from_m} to {to_m} m from the tip is not between entry and the end of the throw"
    )]
    Notch {
        /// Its beginning, m.
        from_m: f64,
        /// Its end, m.
        to_m: f64,
    },
}

/// Beyond this the screen leaves a draw out, m: more than rounding, and than [`TOUCHING_M`].
const SLACK_M: f64 = 2e-6;

/// Pieces of a path that are shorter are one point, m: what is nearer to the limit than half of it counts as a hit.
const TOUCHING_M: f64 = 1e-6;

/// Pieces of the notch that are shorter are inside by the distances of their ends, m.
const CHORD_M: f64 = 5e-5;

/// Asks draws of a case for events, one draw after the other.
pub(crate) struct Asked<'a, 'c, A> {
    case: &'a Case<'c, A>,
    /// Without it every distance is looked up.
    is_screened: bool,
    path: PathDraw,
    shifts: Shifts<'a>,
    /// How far the path is off relative to each body at most, once it is needed.
    reach_m: [Option<f64>; 2],
    /// Points of the path relative to each body, and how far they are off, once they are needed.
    points: [Vec<(Point3<f64>, f64)>; 2],
    /// Whether the path is closer to a structure than a margin, as far as it was asked: of any is asked again.
    closer: Vec<Option<(f64, bool)>>,
    /// A distance that is not a number.
    pub broken: Option<usize>,
}

impl<'a, 'c, A: Anatomy> Asked<'a, 'c, A> {
    pub fn new(
        case: &'a Case<'c, A>,
        path: PathDraw,
        shifts: Shifts<'a>,
        is_screened: bool,
    ) -> Self {
        Self {
            case,
            is_screened,
            path,
            shifts,
            reach_m: [None; 2],
            points: [const { Vec::new() }; 2],
            closer: vec![None; case.structures.len()],
            broken: None,
        }
    }

    /// The next draw.
    pub fn turn_to(&mut self, path: PathDraw, shifts: Shifts<'a>) {
        self.path = path;
        self.shifts = shifts;
        self.reach_m = [None; 2];
        for points in &mut self.points {
            points.clear();
        }
        self.closer.fill(None);
    }

    fn reach_m(&mut self, body: Body) -> f64 {
        let (case, path) = (self.case, &self.path);
        *self.reach_m[body.index()].get_or_insert_with(|| case.reach_m(path, body))
    }

    /// Whether an event happens in this draw.
    pub fn happens(&mut self, event: &Event) -> bool {
        match event {
            Event::Closer {
                structure,
                margin_m,
            } => self.is_closer(*structure, *margin_m),
            Event::Any {
                structures,
                margin_m,
            } => structures
                .iter()
                .any(|each| self.is_closer(*each, *margin_m)),
            Event::TipInside { structure } => {
                let body = self.case.structures[*structure].body;
                let tip = self.case.planned(1.0) + self.tip_m(body);
                self.distance_m(*structure, &tip) < self.shift_m(*structure)
            }
            Event::NotchInside {
                structure,
                notch_m,
                least_m,
            } => self.inside_m(*structure, *notch_m) >= *least_m,
            Event::TipWithin { radius_m, body } => self.tip_m(*body).norm() <= *radius_m,
        }
    }

    fn tip_m(&self, body: Body) -> Vector3<f64> {
        self.case.off_m(&self.path, self.case.tip, body)
    }

    /// By how much a structure reaches beyond where it was seen, m.
    fn shift_m(&self, structure: usize) -> f64 {
        let sd_m = self.case.structures[structure].boundary_sd_m;
        if sd_m > 0.0 {
            sd_m * self.shifts.of(structure)
        } else {
            0.0
        }
    }

    fn distance_m(&mut self, structure: usize, point: &Point3<f64>) -> f64 {
        let distance_m = self.case.anatomy.distance_m(structure, point);
        if distance_m.is_nan() {
            self.broken = Some(structure);
        }
        distance_m
    }

    /// Points of the path relative to a body.
    fn fill(&mut self, body: Body) {
        let points = &mut self.points[body.index()];
        if points.is_empty() {
            let case = self.case;
            let path = &self.path;
            points.extend(
                case.fractions
                    .iter()
                    .enumerate()
                    .map(|(station, fraction)| {
                        let off_m = case.off_m(path, station, body);
                        (case.planned(*fraction) + off_m, off_m.norm())
                    }),
            );
        }
    }

    fn is_closer(&mut self, structure: usize, margin_m: f64) -> bool {
        if let Some((_, closer)) = self.closer[structure].filter(|known| known.0 == margin_m) {
            return closer;
        }
        let closer = self.comes_closer(structure, margin_m);
        self.closer[structure] = Some((margin_m, closer));
        closer
    }

    fn comes_closer(&mut self, structure: usize, margin_m: f64) -> bool {
        let case = self.case;
        let Structures {
            body,
            sd_m,
            stretches_m,
            least_m,
        } = Structures::of(case, structure);
        let needed_m = case.needle.radius_m + margin_m;
        // What the boundary has to be off by for a hit.
        let left_m = least_m - needed_m - self.reach_m(body) - SLACK_M;
        if self.is_screened && sd_m > 0.0 && self.shifts.is_below(structure, left_m / sd_m) {
            return false;
        }
        let shift_m = self.shift_m(structure);
        if self.is_screened && left_m > shift_m {
            return false;
        }
        self.fill(body);
        let limit_m = needed_m + shift_m;
        let mut last_m = None;
        for (stretch, clearance_m) in stretches_m.iter().enumerate() {
            let [from, to] = [stretch, stretch + 1].map(|at| self.points[body.index()][at]);
            if self.is_screened && clearance_m - from.1.max(to.1) > limit_m + SLACK_M {
                last_m = None;
                continue;
            }
            let from_m = last_m.unwrap_or_else(|| self.distance_m(structure, &from.0));
            let to_m = self.distance_m(structure, &to.0);
            let line = [(from.0, from_m), (to.0, to_m)];
            if self.touches(structure, line, limit_m) {
                return true;
            }
            last_m = Some(to_m);
        }
        false
    }

    /// Whether a straight piece comes closer than a limit.
    fn touches(&mut self, structure: usize, line: [(Point3<f64>, f64); 2], limit_m: f64) -> bool {
        let [(from, from_m), (to, to_m)] = line;
        if from_m <= limit_m || to_m <= limit_m || self.broken.is_some() {
            return true;
        }
        let length_m = (to - from).norm();
        if from_m + to_m - length_m > 2.0 * limit_m {
            return false;
        }
        if length_m < TOUCHING_M {
            return true;
        }
        let middle = nalgebra::center(&from, &to);
        let middle = (middle, self.distance_m(structure, &middle));
        self.touches(structure, [line[0], middle], limit_m)
            || self.touches(structure, [middle, line[1]], limit_m)
    }

    /// Length of the notch that is inside a structure, m.
    fn inside_m(&mut self, structure: usize, notch_m: [f64; 2]) -> f64 {
        let case = self.case;
        let body = case.structures[structure].body;
        self.fill(body);
        let ends = notch_m.map(|along_m| 1.0 + along_m / case.needle.depth_m);
        let within = case
            .fractions
            .iter()
            .copied()
            .filter(|each| (ends[0]..ends[1]).contains(each) && *each > ends[0]);
        let mut stations = vec![ends[0]];
        stations.extend(within);
        stations.push(ends[1]);
        let limit_m = self.shift_m(structure);
        let points: Vec<(Point3<f64>, f64)> = stations
            .iter()
            .map(|fraction| {
                let point = self.point(*fraction, body);
                (point, self.distance_m(structure, &point))
            })
            .collect();
        let pieces = points.windows(2);
        pieces
            .map(|pair| self.piece_inside_m(structure, [pair[0], pair[1]], limit_m))
            .sum()
    }

    /// Between stations the path is straight.
    fn point(&self, fraction: f64, body: Body) -> Point3<f64> {
        let fractions = &self.case.fractions;
        let next = fractions.partition_point(|each| *each < fraction);
        let next = next.clamp(1, fractions.len() - 1);
        let share = (fraction - fractions[next - 1]) / (fractions[next] - fractions[next - 1]);
        let [from, to] = [next - 1, next].map(|at| self.points[body.index()][at].0);
        from + (to - from) * share
    }

    fn piece_inside_m(
        &mut self,
        structure: usize,
        line: [(Point3<f64>, f64); 2],
        limit_m: f64,
    ) -> f64 {
        let [(from, from_m), (to, to_m)] = line;
        let length_m = (to - from).norm();
        if self.broken.is_some() || from_m + to_m - length_m >= 2.0 * limit_m {
            return 0.0;
        }
        if from_m + to_m + length_m <= 2.0 * limit_m {
            return length_m;
        }
        if length_m < CHORD_M {
            let [from_m, to_m] = [limit_m - from_m, limit_m - to_m];
            let inside = from_m.max(0.0) + to_m.max(0.0);
            let whole = from_m.abs() + to_m.abs();
            return if whole > 0.0 {
                length_m * inside / whole
            } else {
                0.0
            };
        }
        let middle = nalgebra::center(&from, &to);
        let middle = (middle, self.distance_m(structure, &middle));
        self.piece_inside_m(structure, [line[0], middle], limit_m)
            + self.piece_inside_m(structure, [middle, line[1]], limit_m)
    }

    /// How far a structure, where it was seen, is from coming closer than a margin, m: negative if it does. Smooth
    /// where the distance is: for derivatives.
    pub fn spare_m(&mut self, structure: usize, margin_m: f64) -> f64 {
        /// What the search for the nearest piece of the path may miss, m; the path about it, m, and how often that is
        /// cut.
        const COARSE_M: f64 = 2e-4;
        const ABOUT_M: f64 = 1.5e-3;
        const CUTS: usize = 12;
        /// 1 over the golden section.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let case = self.case;
        let body = case.structures[structure].body;
        self.fill(body);
        let of = |point: &Point3<f64>| case.anatomy.distance_m(structure, point);
        let points = &self.points[body.index()];
        let (mut best_m, mut nearest) = (f64::INFINITY, points[0].0);
        for pair in points.windows(2) {
            let ends = [&pair[0].0, &pair[1].0];
            let (least_m, at) = least_and_where(&of, ends, best_m, COARSE_M);
            if least_m < best_m {
                (best_m, nearest) = (least_m, at);
            }
        }
        // Along the planned needle the path runs on at nearly the same pace.
        let depth_m = case.needle.depth_m;
        let middle = (nearest.x - points[0].0.x) / depth_m;
        let about = ABOUT_M / depth_m;
        let [mut low, mut high] =
            [middle - about, middle + about].map(|end| end.clamp(0.0, case.end()));
        let at = |fraction: f64| of(&self.point(fraction, body));
        let inner =
            |low: f64, high: f64| [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        let [mut left, mut right] = inner(low, high);
        let (mut at_left, mut at_right) = (at(left), at(right));
        for _ in 0..CUTS {
            if at_left < at_right {
                (high, right, at_right) = (right, left, at_left);
                left = inner(low, high)[0];
                at_left = at(left);
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = inner(low, high)[1];
                at_right = at(right);
            }
        }
        best_m.min(at_left).min(at_right).min(at(low)).min(at(high))
            - case.needle.radius_m
            - margin_m
    }
}

/// What the screen knows of a structure.
struct Structures<'a> {
    body: Body,
    sd_m: f64,
    stretches_m: &'a [f64],
    least_m: f64,
}

impl<'a> Structures<'a> {
    fn of<A>(case: &'a Case<'_, A>, structure: usize) -> Self {
        let seen = &case.structures[structure];
        let clearance = &case.clearances[structure];
        Self {
            body: seen.body,
            sd_m: seen.boundary_sd_m,
            stretches_m: &clearance.stretches_m,
            least_m: clearance.least_m,
        }
    }
}
