//! Whether the arm keeps clearances while it and the patient are moved, by bounds of travel.
//!
//! Of each pair of bodies some places of the one beside the other are kept at which their distance was
//! measured. At a new place the distance is the same up to how far the one has travelled beside the other
//! since ([`Placement::travel_m`]), whatever both do in the room: what moves together keeps its distance.
//! Where that decides nothing the pair alone is measured, which is kept in turn. What is decided is proven
//! either way; see [`search`](crate::Nearby) for why distances follow travel, in penetration too, and why
//! those of meshes do above zero alone.

use std::cell::OnceCell;

use needlebench_cell::ClearanceClass;
use needlebench_geometry::Placement;
use needlebench_kinematics::{Joints, Pose};

use crate::body::LinkPlacements;
use crate::model::ClearanceModel;
use crate::posture::Posture;
use crate::search::after_travel;

/// Distances nearer to a limit than this decide nothing, m: they are computed in another frame than those
/// of a cell with the patient there, and differ by what rounding leaves of a distance (2e-7 m at most, see
/// [`needlebench_geometry`]).
const UNDECIDED_M: f64 = 1e-6;

/// Places that are kept of a pair.
const PLACES: usize = 16;

/// Pairs of which some clearance is to be kept, and what is known of their distances.
///
/// Some bodies of the model, those that lie with the patient, may be moved as one; all others stand as in
/// the model. Answers do not depend on what was asked before, but for whether there is one.
#[derive(Debug)]
pub struct KnownGaps<'m> {
    model: &'m ClearanceModel,
    watched: Vec<Watched>,
}

#[derive(Debug)]
struct Watched {
    /// Index of the pair.
    pair: usize,
    /// Least distance that is to be kept, m.
    limit_m: f64,
    /// Body B lies with the patient.
    of_patient: bool,
    /// The one measured last is the last.
    known: Vec<Gap>,
}

/// A distance that was measured.
#[derive(Debug)]
struct Gap {
    /// Where body A was beside body B.
    b_from_a: Placement,
    gap_m: f64,
}

/// The arm seen from something that stands still.
struct View<'m> {
    model: &'m ClearanceModel,
    links: &'m LinkPlacements,
    posture: OnceCell<Posture<'m>>,
}

impl<'m> View<'m> {
    fn new(model: &'m ClearanceModel, links: &'m LinkPlacements) -> Self {
        Self {
            model,
            links,
            posture: OnceCell::new(),
        }
    }

    fn gap_m(&self, pair: usize) -> f64 {
        let posture = || Posture::new(&self.model.bodies, self.links);
        let posture = self.posture.get_or_init(posture);
        let nearest = self.model.pair_at(pair, self.links, posture);
        nearest.map_or(f64::INFINITY, |nearest| nearest.separation.distance_m)
    }
}

impl<'m> KnownGaps<'m> {
    /// Nothing is known yet. `limit_m` says what each class is to keep, m, negative infinity for those of
    /// which nothing is asked; `lies_with_patient` which bodies are moved with the patient, by their indices.
    pub fn new(
        model: &'m ClearanceModel,
        limit_m: impl Fn(ClearanceClass) -> f64,
        lies_with_patient: impl Fn(usize) -> bool,
    ) -> Self {
        let pairs = model.pairs.iter().enumerate();
        let watched = pairs.map(|(index, pair)| Watched {
            pair: index,
            limit_m: limit_m(pair.class),
            of_patient: lies_with_patient(pair.b),
            known: Vec::new(),
        });
        Self {
            model,
            watched: watched
                .filter(|watched| watched.limit_m > f64::NEG_INFINITY)
                .collect(),
        }
    }

    /// Whether all pairs keep their clearances with the arm at `q` and the patient moved by `moved` from
    /// where he lies in the model, in the world; `None` where one is at its limit up to rounding.
    pub fn keeps(&mut self, q: &Joints, moved: &Pose) -> Option<bool> {
        let model = self.model;
        let links = model.world_from_links(q).each_ref().map(Placement::new);
        let moved = Placement::new(moved);
        let beside_patient = links.each_ref().map(|link| moved.inverse_after(link));
        let views = [&links, &beside_patient].map(|links| View::new(model, links));
        let mut open: Vec<(usize, Placement)> = Vec::new();
        for (index, watched) in self.watched.iter().enumerate() {
            let pair = &model.pairs[watched.pair];
            let b_from_a = model.b_from_a(pair, views[usize::from(watched.of_patient)].links);
            match watched.by_travel(model, &b_from_a) {
                Some(true) => {}
                Some(false) => return Some(false),
                None => open.push((index, b_from_a)),
            }
        }
        let mut all_keep = Some(true);
        for (index, b_from_a) in open {
            let watched = &mut self.watched[index];
            let gap_m = views[usize::from(watched.of_patient)].gap_m(watched.pair);
            watched.learn(Gap { b_from_a, gap_m });
            if gap_m < watched.limit_m - UNDECIDED_M {
                return Some(false);
            }
            // What is not a number is not above it either.
            let is_kept = gap_m >= watched.limit_m + UNDECIDED_M;
            all_keep = all_keep.filter(|_| is_kept);
        }
        all_keep
    }
}

impl Watched {
    /// What the distances that are known prove.
    fn by_travel(&self, model: &ClearanceModel, b_from_a: &Placement) -> Option<bool> {
        let pair = &model.pairs[self.pair];
        let ball = &model.bodies[pair.a].bound;
        self.known.iter().rev().find_map(|known| {
            let travel_m = known
                .b_from_a
                .travel_m(b_from_a, &ball.centre, ball.ball_radius_m);
            if after_travel(known.gap_m, travel_m, pair.is_convex) >= self.limit_m + UNDECIDED_M {
                Some(true)
            } else if pair.is_convex && known.gap_m + travel_m < self.limit_m - UNDECIDED_M {
                Some(false)
            } else {
                None
            }
        })
    }

    fn learn(&mut self, gap: Gap) {
        if self.known.len() == PLACES {
            self.known.remove(0);
        }
        self.known.push(gap);
    }
}
