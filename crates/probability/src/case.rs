//! A needle with its law among structures.

use nalgebra::{Point3, Vector2};

use crate::bend::turned;
use crate::breath::Body;
use crate::draw::PathDraw;
use crate::law::Law;
use crate::least::least_m;
use crate::planes::HalfPlane;

/// The planned needle: a capsule from the skin to the tip and the throw beyond it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Needle {
    /// From entry to tip, m.
    pub depth_m: f64,
    /// How far the inner needle goes on beyond the tip, m.
    pub throw_m: f64,
    /// Radius, m.
    pub radius_m: f64,
}

/// What can be met or reached.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Name, as the caller prints it.
    pub name: String,
    /// What it moves with.
    pub body: Body,
    /// Standard deviation of its boundary, m: it lies outside or inside of where it was seen by one shift for each
    /// draw.
    pub boundary_sd_m: f64,
    /// Half-planes, each set of which holds all of it ([`HalfPlane::covers`]); empty if none are known.
    pub covers: Vec<Vec<HalfPlane>>,
}

/// Where structures are, as distances in the frame of the needle.
pub trait Anatomy: Sync {
    /// Signed distance of a point from a structure, by its number, m: negative inside. It changes by no more than the
    /// point moves, and may be capped far away.
    fn distance_m(&self, structure: usize, point_m: &Point3<f64>) -> f64;

    /// A lower bound of it, for the screen and for [`crate::at_most`], with the same slope.
    fn clearance_m(&self, structure: usize, point_m: &Point3<f64>) -> f64 {
        self.distance_m(structure, point_m)
    }
}

/// Why there is no case.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// Depth, throw or radius.
    #[error(
        "needle with depth {depth_m} m, throw {throw_m} m, radius {radius_m} m: depth must be above 0, others 0 or more"
    )]
    Needle {
        /// As given, m.
        depth_m: f64,
        /// As given, m.
        throw_m: f64,
        /// As given, m.
        radius_m: f64,
    },
    /// Standard deviation of a boundary.
    #[error("{structure}: standard deviation of the boundary is {sd_m} m; must be 0 or more")]
    Boundary {
        /// Name.
        structure: String,
        /// As given, m.
        sd_m: f64,
    },
    /// A distance that is no number.
    #[error("{structure}: distance at depth {depth_m:.4} m is not a number")]
    Distance {
        /// Name.
        structure: String,
        /// Along the planned needle, m.
        depth_m: f64,
    },
    /// A structure without a surface.
    #[error("{structure} is infinitely far from the whole needle path: is it empty?")]
    Empty {
        /// Name.
        structure: String,
    },
    /// Distances that change by more than their points move.
    #[error(
        "{structure}: distance changes by {change_m:.4} m over {step_m:.4} m at depth {depth_m:.4} m; \
         hint: distances are in m, not mm"
    )]
    Steep {
        /// Name.
        structure: String,
        /// Along the planned needle, m.
        depth_m: f64,
        /// Change, m.
        change_m: f64,
        /// Step, m.
        step_m: f64,
    },
    /// A half-plane that is none.
    #[error(
        "{structure}: the normal of a half-plane must have length 1, and its stretch must not be empty"
    )]
    Plane {
        /// Name.
        structure: String,
    },
}

/// Stations of the path are no farther apart, m: straight pieces in between are screened as one.
const STATION_M: f64 = 5e-3;

/// Clearances of stretches are too small by no more, m.
pub(crate) const CLEARANCE_M: f64 = 2e-5;

/// A needle with its law among structures: everything that questions are asked of.
pub struct Case<'a, A> {
    pub(crate) law: &'a Law,
    pub(crate) needle: Needle,
    pub(crate) structures: &'a [Structure],
    pub(crate) anatomy: &'a A,
    /// Stations of the path, as fractions of the planned depth, from 0 to the end of the throw.
    pub(crate) fractions: Vec<f64>,
    /// Which of them is the tip.
    pub(crate) tip: usize,
    /// Curves of the bend, station by station, m.
    bends_m: Vec<Vector2<f64>>,
    /// By how much each is off its chord at most, m.
    chords_m: Vec<f64>,
    pub(crate) clearances: Vec<Clearance>,
}

/// Distances of the planned path from a structure.
#[derive(Clone)]
#[expect(clippy::struct_field_names, reason = "all are in metres")]
pub(crate) struct Clearance {
    /// Of the path between two stations, a lower bound, m.
    pub stretches_m: Vec<f64>,
    /// The least of them.
    pub least_m: f64,
    /// As estimates have it, m.
    pub planned_m: f64,
}

impl<'a, A: Anatomy> Case<'a, A> {
    /// # Errors
    /// [`CaseError`].
    pub fn new(
        law: &'a Law,
        needle: Needle,
        structures: &'a [Structure],
        anatomy: &'a A,
    ) -> Result<Self, CaseError> {
        let Needle {
            depth_m,
            throw_m,
            radius_m,
        } = needle;
        let is_length = |value: f64| value >= 0.0 && value.is_finite();
        if depth_m <= 0.0 || ![depth_m, throw_m, radius_m].into_iter().all(is_length) {
            return Err(CaseError::Needle {
                depth_m,
                throw_m,
                radius_m,
            });
        }
        let fractions = stations(law, &needle);
        let tip = fractions.iter().position(|each| *each >= 1.0).unwrap_or(0);
        let (bends_m, chords_m) = bends(law, &fractions);
        let mut case = Self {
            law,
            needle,
            structures,
            anatomy,
            fractions,
            tip,
            bends_m,
            chords_m,
            clearances: Vec::new(),
        };
        for (index, structure) in structures.iter().enumerate() {
            let clearance = case.clearance(index, structure)?;
            case.clearances.push(clearance);
        }
        Ok(case)
    }

    /// The same needle among the same structures under another law whose bend has the same fractions, with boundaries that
    /// may be seen otherwise.
    ///
    /// # Errors
    /// [`CaseError::Boundary`].
    pub fn under<'b>(
        &self,
        law: &'b Law,
        structures: &'b [Structure],
    ) -> Result<Case<'b, A>, CaseError>
    where
        'a: 'b,
    {
        structures.iter().try_for_each(check_boundary)?;
        let (bends_m, chords_m) = bends(law, &self.fractions);
        Ok(Case {
            law,
            needle: self.needle,
            structures,
            anatomy: self.anatomy,
            fractions: self.fractions.clone(),
            tip: self.tip,
            bends_m,
            chords_m,
            clearances: self.clearances.clone(),
        })
    }

    /// A point of the planned axis.
    pub(crate) fn planned(&self, fraction: f64) -> Point3<f64> {
        Point3::new(fraction * self.needle.depth_m, 0.0, 0.0)
    }

    /// Largest fraction.
    pub(crate) fn end(&self) -> f64 {
        1.0 + self.needle.throw_m / self.needle.depth_m
    }

    /// Lower bound of the distance of a planned stretch from a structure, m.
    pub(crate) fn stretch_m(&self, structure: usize, [from, to]: [f64; 2]) -> f64 {
        let of = |point: &Point3<f64>| self.anatomy.clearance_m(structure, point);
        least_m(&of, [&self.planned(from), &self.planned(to)], CLEARANCE_M) - CLEARANCE_M
    }

    fn clearance(&self, index: usize, structure: &Structure) -> Result<Clearance, CaseError> {
        /// Of a slope, relative, and of a distance, m.
        const ROUNDING: (f64, f64) = (1e-6, 1e-9);
        let name = || structure.name.clone();
        check_boundary(structure)?;
        let is_plane = |plane: &HalfPlane| {
            let [from_m, to_m] = plane.stretch_m;
            (plane.normal.norm() - 1.0).abs() < 1e-9 && from_m <= to_m && !plane.offset_m.is_nan()
        };
        if !structure.covers.iter().flatten().all(is_plane) {
            return Err(CaseError::Plane { structure: name() });
        }
        let both = |fraction: f64| {
            let point = self.planned(fraction);
            [
                self.anatomy.distance_m(index, &point),
                self.anatomy.clearance_m(index, &point),
            ]
        };
        let mut before: Option<(f64, [f64; 2])> = None;
        let mut is_empty = true;
        for fraction in &self.fractions {
            let values_m = both(*fraction);
            let depth_m = fraction * self.needle.depth_m;
            if values_m.iter().any(|each| each.is_nan()) {
                return Err(CaseError::Distance {
                    structure: name(),
                    depth_m,
                });
            }
            is_empty &= values_m[0] == f64::INFINITY;
            if let Some((last_m, last)) = before {
                let step_m = depth_m - last_m;
                for (value, last) in values_m.iter().zip(last) {
                    let change_m = (value - last).abs();
                    if change_m > step_m * (1.0 + ROUNDING.0) + ROUNDING.1 {
                        return Err(CaseError::Steep {
                            structure: name(),
                            depth_m,
                            change_m,
                            step_m,
                        });
                    }
                }
            }
            before = Some((depth_m, values_m));
        }
        if is_empty {
            return Err(CaseError::Empty { structure: name() });
        }
        let pairs = || self.fractions.windows(2).map(|pair| [pair[0], pair[1]]);
        let stretches_m: Vec<f64> = pairs().map(|pair| self.stretch_m(index, pair)).collect();
        let of = |point: &Point3<f64>| self.anatomy.distance_m(index, point);
        let planned_m = pairs()
            .map(|pair| {
                least_m(
                    &of,
                    [&self.planned(pair[0]), &self.planned(pair[1])],
                    CLEARANCE_M,
                )
            })
            .fold(f64::INFINITY, f64::min);
        if stretches_m.iter().any(|each| each.is_nan()) || planned_m.is_nan() {
            return Err(CaseError::Distance {
                structure: name(),
                depth_m: 0.0,
            });
        }
        Ok(Clearance {
            least_m: stretches_m.iter().copied().fold(f64::INFINITY, f64::min),
            stretches_m,
            planned_m,
        })
    }

    /// How far the path of a draw is off at a station relative to a body, m.
    #[inline]
    pub(crate) fn off_m(
        &self,
        path: &PathDraw,
        station: usize,
        body: Body,
    ) -> nalgebra::Vector3<f64> {
        let mut off_m = path.straight_m(self.fractions[station], body);
        if !self.bends_m.is_empty() {
            let bend = self.bends_m[path.curve * self.fractions.len() + station];
            let bent = turned(bend, path.turn);
            off_m.y += bent.x;
            off_m.z += bent.y;
        }
        off_m
    }

    /// No point of the path of a draw is farther off relative to a body, m.
    pub(crate) fn reach_m(&self, path: &PathDraw, body: Body) -> f64 {
        let last = self.fractions.len() - 1;
        let ends = [0, last].map(|station| self.off_m(path, station, body).norm());
        ends[0].max(ends[1]) + self.chords_m.get(path.curve).copied().unwrap_or(0.0)
    }
}

fn check_boundary(structure: &Structure) -> Result<(), CaseError> {
    let sd_m = structure.boundary_sd_m;
    if sd_m < 0.0 || !sd_m.is_finite() {
        return Err(CaseError::Boundary {
            structure: structure.name.clone(),
            sd_m,
        });
    }
    Ok(())
}

/// Curves of the bend, station by station, and how far each is off its chord at most, m.
fn bends(law: &Law, fractions: &[f64]) -> (Vec<Vector2<f64>>, Vec<f64>) {
    let bends_m: Vec<Vector2<f64>> = law.bend().map_or_else(Vec::new, |bend| {
        let curves = 0..bend.count();
        curves
            .flat_map(|curve| fractions.iter().map(move |each| bend.at(curve, *each)))
            .collect()
    });
    let chords_m = bends_m
        .chunks(fractions.len())
        .map(|curve| off_chord_m(fractions, curve))
        .collect();
    (bends_m, chords_m)
}

/// Stations of a path: where curves have their values, entry, tip and end, and enough in between.
fn stations(law: &Law, needle: &Needle) -> Vec<f64> {
    let end = 1.0 + needle.throw_m / needle.depth_m;
    let mut wanted: Vec<f64> = vec![0.0, 1.0, end];
    if let Some(bend) = law.bend() {
        wanted.extend(bend.fractions().iter().filter(|each| **each < end));
    }
    wanted.sort_by(f64::total_cmp);
    wanted.dedup();
    let mut fractions = vec![0.0];
    for pair in wanted.windows(2) {
        let steps = ((pair[1] - pair[0]) * needle.depth_m / STATION_M)
            .ceil()
            .max(1.0);
        let mut step = 1.0;
        while step < steps {
            fractions.push(pair[0] + (pair[1] - pair[0]) * step / steps);
            step += 1.0;
        }
        fractions.push(pair[1]);
    }
    fractions
}

/// How far a curve is off the line between its ends, at most, m.
pub(crate) fn off_chord_m(fractions: &[f64], curve: &[Vector2<f64>]) -> f64 {
    let (Some(first), Some(last)) = (curve.first(), curve.last()) else {
        return 0.0;
    };
    let length = fractions[fractions.len() - 1] - fractions[0];
    let each = fractions.iter().zip(curve).map(|(fraction, value)| {
        let share = if length > 0.0 {
            (fraction - fractions[0]) / length
        } else {
            0.0
        };
        (value - (first * (1.0 - share) + last * share)).norm()
    });
    each.fold(0.0, f64::max)
}
