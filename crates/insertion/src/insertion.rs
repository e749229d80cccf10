//! An insertion: the tip through all layers, element by element.

use nalgebra::Vector2;

use crate::element::{Element, Pair};
use crate::elimination::{Load, Open, Reached, Tip};
use crate::guide::{Answer, Bore, Guide, Held, Holder, Leaning, Rest, Seat};
use crate::layers::{Impulse, Layers};
use crate::needle::{Needle, NeedleError};

/// Longest element within a layer, m: with it 60 random layered cases are within 1 um of a fifth of it in the median.
const ELEMENT_M: f64 = 0.6e-3;

/// The first element in tissue that is stiffer than what is before it, m, and by how much each one is longer than the one
/// before it. A long overhang is softer than the first tenths of a millimetre of stiff tissue: what the tip does there
/// decides how the needle goes on. From 2e-6 m on, tips of 40 random cases are elsewhere by 5e-5 of their place in the
/// median, and by 1 % at worst.
const FIRST_M: f64 = 4e-5;
const GROWTH: f64 = 1.15;

/// Elements of a layer at least.
const LEAST_ELEMENTS: f64 = 3.0;

/// Small slopes are what the model is for: finite rotations change the bend of a 22 G needle by 1.7 % at 8 mm, where its
/// slope is about this.
pub const WARNED_SLOPE: f64 = 0.1;

/// The tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bevel {
    /// Where the force of a layer pushes the tip: a unit vector lateral to the needle, away from the bevel's face; shorter for a
    /// tip that is pushed less.
    pub towards: [f64; 2],
    /// Angle of the face against the axis, rad.
    pub angle_rad: f64,
    /// Depth at which the needle is turned by 180 degrees, m.
    pub turn_at_m: Option<f64>,
}

/// A needle in its layers.
#[derive(Debug, Clone, PartialEq)]
pub struct Insertion {
    /// Depths of the nodes from the skin, m: the first one is at the skin.
    pub depths_m: Vec<f64>,
    /// What the tip has cut, across the axis at those depths, m.
    pub path_m: Vec<[f64; 2]>,
    /// Where the needle is now, at the same depths, m.
    pub shape_m: Vec<[f64; 2]>,
    /// Its slopes there.
    pub slopes: Vec<[f64; 2]>,
    /// Displacement and slope at the guide's exit (or of the clamp).
    pub exit_m: [f64; 2],
    /// Slope at the exit.
    pub exit_slope: [f64; 2],
}

/// Tissue that moves lateral to the needle after it was inserted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// From this depth on, m.
    pub from_m: f64,
    /// By this, m.
    pub by_m: [f64; 2],
}

/// Why there is no insertion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InsertionError {
    /// The needle.
    #[error(transparent)]
    Needle(#[from] NeedleError),
    /// Too short.
    #[error("the needle is {length_m} m long, and its tip is to be {depth_m} m behind the skin")]
    Short {
        /// Of the needle, m.
        length_m: f64,
        /// Of the tip, m.
        depth_m: f64,
    },
    /// Distance of the guide from the skin.
    #[error("a stand-off of {0} m: it is 0 to 1 m")]
    StandOff(f64),
    /// The guide.
    #[error(
        "a guide of {length_m} m with a play of {play_m} m: a length above 0, a play of 0 to 1 mm"
    )]
    Guide {
        /// Length of the bore, m.
        length_m: f64,
        /// Play, m.
        play_m: f64,
    },
    /// The bevel's angle.
    #[error("a bevel of {0} rad: 5 to 90 degrees")]
    Bevel(f64),
    /// A turn where the needle does not get.
    #[error("a turn at a depth of {turn_at_m} m, and the tip ends at {depth_m} m")]
    Turn {
        /// Of the turn, m.
        turn_at_m: f64,
        /// Of the tip, m.
        depth_m: f64,
    },
}

/// Inserts a needle through all layers.
///
/// Accuracy: see `tests/`: closed forms to 1e-6, the circle of a cut path to 1e-3. Tips round by 3e-12 of their place in a
/// guide without play, and by 5e-10 in one with play (against 50 decimal digits, 360 random cases); where the first layer
/// has no force and the guide play, the needle may lean either way, and rounding decides.
///
/// # Errors
/// [`InsertionError`].
pub fn insert(
    needle: &Needle,
    holder: &Holder,
    stand_off_m: f64,
    layers: &Layers,
    bevel: &Bevel,
) -> Result<Insertion, InsertionError> {
    let case = Case::new(needle, holder, stand_off_m, layers, bevel, ELEMENT_M)?;
    Ok(case.shape(case.path(), None))
}

/// Where the tip is across the axis when it pierces the skin and at the end of its way, m: the first and the last of
/// [`Insertion::path_m`] of the same [`insert`], without the shape of the needle in between.
///
/// # Errors
/// [`InsertionError`].
pub fn ends(
    needle: &Needle,
    holder: &Holder,
    stand_off_m: f64,
    layers: &Layers,
    bevel: &Bevel,
) -> Result<[[f64; 2]; 2], InsertionError> {
    let case = Case::new(needle, holder, stand_off_m, layers, bevel, ELEMENT_M)?;
    let mut tip_m = 0.0;
    case.cut(|cut_m| tip_m = cut_m);
    Ok([case.at_skin(), tip_m].map(|off_m| case.across(off_m)))
}

impl Insertion {
    /// Displacement of the tip, m.
    pub fn tip_m(&self) -> [f64; 2] {
        self.shape_m.last().copied().unwrap_or([0.0; 2])
    }

    /// The largest slope, beside [`WARNED_SLOPE`].
    pub fn largest_slope(&self) -> f64 {
        let all = self.slopes.iter().chain([&self.exit_slope]);
        all.map(|[y, z]| (y * y + z * z).sqrt()).fold(0.0, f64::max)
    }

    /// The same needle once tissue has moved: nothing is cut any more, and the tip's force stays.
    ///
    /// # Errors
    /// [`InsertionError`], as [`insert`] of the same.
    pub fn slipped(
        &self,
        needle: &Needle,
        holder: &Holder,
        stand_off_m: f64,
        layers: &Layers,
        bevel: &Bevel,
        slip: Slip,
    ) -> Result<Self, InsertionError> {
        let case = Case::new(needle, holder, stand_off_m, layers, bevel, ELEMENT_M)?;
        Ok(case.shape(self.path_m.clone(), Some(slip)))
    }
}

/// Displacements in the two planes, m.
type Across = [f64; 2];

/// What is inserted, checked.
///
/// Without a slip all is along one direction: that of the tip's force.
pub(crate) struct Case<'c> {
    bending_nm2: f64,
    holder: &'c Holder,
    /// Where a guide holds it.
    bore: Option<Bore>,
    stand_off_m: f64,
    layers: &'c Layers,
    /// Where the tip is pushed, a unit vector, and what is left of the layers' force; nowhere without any.
    towards: [f64; 2],
    strength: f64,
    turn_at_m: Option<f64>,
    /// Of the bevel's face along the axis, m.
    bevel_m: f64,
    /// Longest element, m.
    element_m: f64,
}

impl<'c> Case<'c> {
    pub fn new(
        needle: &Needle,
        holder: &'c Holder,
        stand_off_m: f64,
        layers: &'c Layers,
        bevel: &Bevel,
        element_m: f64,
    ) -> Result<Self, InsertionError> {
        needle.check()?;
        let depth_m = layers.depth_m();
        match *holder {
            Holder::Guide(Guide { length_m, play_m })
                if !(length_m > 0.0 && (0.0..=1e-3).contains(&play_m)) =>
            {
                return Err(InsertionError::Guide { length_m, play_m });
            }
            Holder::Hub(length_m) if length_m.is_nan() || length_m <= depth_m => {
                return Err(InsertionError::Short { length_m, depth_m });
            }
            _ => {}
        }
        if !(0.0..=1.0).contains(&stand_off_m) {
            return Err(InsertionError::StandOff(stand_off_m));
        }
        let least_rad = 5.0_f64.to_radians();
        if !(least_rad..=std::f64::consts::FRAC_PI_2).contains(&bevel.angle_rad) {
            return Err(InsertionError::Bevel(bevel.angle_rad));
        }
        if let Some(turn_at_m) = bevel
            .turn_at_m
            .filter(|at_m| !(0.0..=depth_m).contains(at_m))
        {
            return Err(InsertionError::Turn { turn_at_m, depth_m });
        }
        let [y, z] = bevel.towards;
        let strength = (y * y + z * z).sqrt();
        let share = if strength > 0.0 { 1.0 / strength } else { 0.0 };
        let bending_nm2 = needle.bending_stiffness_nm2();
        Ok(Self {
            bending_nm2,
            holder,
            bore: match holder {
                Holder::Guide(guide) => Some(Bore::new(guide, bending_nm2)),
                Holder::Clamp | Holder::Hub(_) => None,
            },
            stand_off_m,
            layers,
            towards: bevel.towards.map(|each| each * share),
            strength,
            turn_at_m: bevel.turn_at_m,
            bevel_m: (needle.outer_m / libm::tan(bevel.angle_rad)).max(ELEMENT_M),
            element_m,
        })
    }

    /// Along the axes, of what is towards where the tip is pushed.
    fn across(&self, off_m: f64) -> Across {
        self.towards.map(|towards| towards * off_m)
    }

    /// All elements in tissue, with the depth of their ends, m.
    pub fn elements(&self, mut each: impl FnMut(&Element, f64)) {
        let (mut end_m, mut before_n_m2) = (0.0, 0.0);
        for layer in self.layers.all() {
            let of = |length_m: f64| Element::new(length_m, self.bending_nm2, layer.stiffness_n_m2);
            let begin_m: f64 = end_m;
            end_m += layer.length_m;
            let (mut short, mut from_m, mut length_m) = (0.0, begin_m, FIRST_M);
            if layer.stiffness_n_m2 > before_n_m2 {
                // What is left is no sliver, which would round.
                while length_m < self.element_m && from_m + length_m + FIRST_M < end_m {
                    short += 1.0;
                    from_m += length_m;
                    length_m *= GROWTH;
                }
            }
            before_n_m2 = layer.stiffness_n_m2;
            let rest_m = end_m - from_m;
            let count = (rest_m / self.element_m - 1e-9).ceil().max(LEAST_ELEMENTS);
            let even_m = rest_m / count;
            let even = of(even_m);
            let mut graded;
            let (mut number, mut depth_m, mut length_m) = (1.0, begin_m, FIRST_M);
            while number <= short + count {
                let element = if number <= short {
                    depth_m += length_m;
                    graded = of(length_m);
                    length_m *= GROWTH;
                    &graded
                } else {
                    depth_m = from_m + even_m * (number - short);
                    &even
                };
                each(element, depth_m);
                number += 1.0;
            }
        }
    }

    /// The force across the tip at depths that rise, N: the mean over the face of the bevel.
    pub fn force_n(&self) -> impl FnMut(f64) -> f64 {
        let [mut to, mut from] = [0, 1].map(|_| Impulse::new(self.layers, self.turn_at_m));
        let share = self.strength / self.bevel_m;
        let bevel_m = self.bevel_m;
        move |depth_m| (to.until_nm(depth_m) - from.until_nm((depth_m - bevel_m).max(0.0))) * share
    }

    /// Where the path begins: free of tissue, the least force leans the needle on both ends of its guide.
    fn at_skin(&self) -> f64 {
        let mut forces = self.layers.all().iter().map(|layer| layer.force_n);
        match (&self.bore, forces.find(|force_n| *force_n != 0.0)) {
            (Some(bore), Some(force_n)) => {
                force_n.signum() * (bore.play_m + self.stand_off_m * bore.lean)
            }
            _ => 0.0,
        }
    }

    /// The element from the holder to the skin, with the tip at a depth; none where the holder is at the skin.
    fn before_skin(&self, depth_m: f64) -> Option<Element> {
        let length_m = match self.holder {
            Holder::Hub(length_m) => length_m - depth_m,
            Holder::Guide(_) | Holder::Clamp => self.stand_off_m,
        };
        (length_m > 0.0).then(|| Element::new(length_m, self.bending_nm2, 0.0))
    }

    fn rotation_nm(&self) -> Option<f64> {
        self.bore.map(|bore| bore.rotation_nm)
    }

    /// What is before the skin, with the tip at a depth.
    fn reached<const PLANES: usize>(&self, depth_m: f64) -> Option<Reached<PLANES>> {
        let element = self.before_skin(depth_m)?;
        let nothing = [0.0; PLANES];
        Some(Open::first(&element, self.rotation_nm(), nothing).closed(nothing))
    }

    /// Behind a further element, by the path at its first node; the first one if there is nothing before.
    #[inline(always)]
    fn behind<const PLANES: usize>(
        &self,
        known: Option<&Reached<PLANES>>,
        element: &Element,
        path_m: [f64; PLANES],
    ) -> Open<PLANES> {
        match known {
            Some(known) => known.next(element, path_m),
            None => Open::first(element, self.rotation_nm(), path_m),
        }
    }

    /// What the tip cuts, at all nodes behind the skin, in their order.
    pub fn cut(&self, mut seen: impl FnMut(f64)) {
        let mut force_n = self.force_n();
        let mut path_m = self.at_skin();
        if let Holder::Hub(_) = self.holder {
            self.cut_from_hub(&mut seen);
            return;
        }
        let before = self.reached(0.0);
        let mut known = before;
        let mut rest = Rest::MIDDLE;
        self.elements(|element, depth_m| {
            let open = self.behind(known.as_ref(), element, [path_m]);
            (path_m, rest) = self.tip_m(&open, force_n(depth_m), &rest);
            known = Some(open.closed([path_m]));
            seen(path_m);
        });
    }

    /// The same with a hub that comes nearer: all is put together anew at each node.
    fn cut_from_hub(&self, seen: &mut dyn FnMut(f64)) {
        let mut force_n = self.force_n();
        let mut path_m = self.at_skin();
        let mut passed: Vec<(Element, [f64; 2])> = Vec::new();
        self.elements(|element, depth_m| {
            let mut known = self.reached(depth_m);
            for (element, [from_m, to_m]) in &passed {
                known = Some(
                    self.behind(known.as_ref(), element, [*from_m])
                        .closed([*to_m]),
                );
            }
            let open = self.behind(known.as_ref(), element, [path_m]);
            let from_m = path_m;
            path_m = self.tip_m(&open, force_n(depth_m), &Rest::MIDDLE).0;
            passed.push((*element, [from_m, path_m]));
            seen(path_m);
        });
    }

    /// All that the tip cuts, from the skin on.
    pub fn path(&self) -> Vec<Across> {
        let mut path = vec![self.across(self.at_skin())];
        self.cut(|cut_m| path.push(self.across(cut_m)));
        path
    }

    /// Where the tip is, m, and where the needle rests in its guide; it is tried first whether it does as before.
    #[inline(always)]
    fn tip_m(&self, open: &Open<1>, force_n: f64, rest: &Rest) -> (f64, Rest) {
        let tip = Tip::new(open);
        let load = &open.loads[0];
        let Some(bore) = self.bore.as_ref().filter(|bore| bore.play_m > 0.0) else {
            return (tip.answer(load, force_n, [0.0; 2]).0, *rest);
        };
        let on_ends = bore.leaning(rest.side);
        let (tip_m, at_exit) = tip.answer(load, force_n, [on_ends.exit_m, on_ends.moment_nm]);
        let leaning = bore.leans(rest.side, at_exit);
        if leaning == Leaning::OnEnds {
            return (tip_m, on_ends);
        }
        let (tip_m, by_load) = tip.answer(load, force_n, [0.0; 2]);
        let [(tip_by_exit, by_exit), (tip_by_moment, by_moment)] =
            [[1.0, 0.0], [0.0, 1.0]].map(|exit| tip.answer(&Load::default(), 0.0, exit));
        let by = held(by_exit, by_moment);
        let rest = if leaning == Leaning::OnWall {
            bore.lying(rest.side, by_load, &by, rest)
        } else {
            bore.seat_along(by_load, &by, rest)
        };
        (
            tip_m + tip_by_exit * rest.exit_m + tip_by_moment * rest.moment_nm,
            rest,
        )
    }

    /// The needle at the end of its way, on a path; with what has moved since.
    pub fn shape(&self, path: Vec<Across>, slip: Option<Slip>) -> Insertion {
        let (mut depths_m, mut elements) = (vec![0.0], Vec::with_capacity(path.len()));
        self.elements(|element, depth_m| {
            depths_m.push(depth_m);
            elements.push(*element);
        });
        // Tissue moves whole, from the end of an element on.
        let moved = |at: usize| {
            let middle_m = 0.5 * (depths_m[at] + depths_m[at + 1]);
            let [y_m, z_m] = slip
                .filter(|slip| middle_m > slip.from_m)
                .map_or([0.0; 2], |slip| slip.by_m);
            [path[at], path[at + 1]].map(|[y, z]| [y + y_m, z + z_m])
        };
        // What is before each node, from the skin on.
        let mut all = Vec::with_capacity(path.len());
        let mut known = self.reached(self.layers.depth_m());
        all.extend(known);
        for (at, element) in elements.iter().enumerate() {
            let [from, to] = moved(at);
            let next = self.behind(known.as_ref(), element, from).closed(to);
            known = Some(next);
            all.push(next);
        }
        let first = elements.len() + 1 - all.len();
        let Reached { before, mut loads } = all[all.len() - 1];
        let force_n = self.force_n()(self.layers.depth_m());
        for (load, towards) in loads.iter_mut().zip(self.towards) {
            *load = load.pushed(towards * force_n);
        }
        let at_exit = |load: &Load| before.at_exit(load, before.under(load.right));
        let [by_exit, by_moment] =
            [[1.0, 0.0], [0.0, 1.0]].map(|exit| at_exit(&before.seated(&Load::default(), exit)));
        let [y, z] = loads.map(|load| at_exit(&load));
        let answer = Answer {
            slope: Vector2::new(y[1], z[1]),
            force_n: Vector2::new(y[0], z[0]),
            by: held(by_exit, by_moment),
        };
        let beside = slip.is_some_and(
            |Slip {
                 by_m: [y_m, z_m], ..
             }| {
                self.strength == 0.0 || y_m * self.towards[1] != z_m * self.towards[0]
            },
        );
        let seat = self.seat(&answer, beside);
        let mut shape = vec![[0.0; 2]; path.len()];
        let mut slopes = shape.clone();
        for plane in 0..2 {
            let exit = [seat.exit_m[plane], seat.moment_nm[plane]];
            let mut state = before.under(before.seated(&loads[plane], exit).right);
            for at in (first..path.len()).rev() {
                [shape[at][plane], slopes[at][plane]] = state;
                if at > first {
                    let Reached { before, loads } = &all[at - 1 - first];
                    let right = before.seated(&loads[plane], exit).right;
                    let path_m = moved(at - 1).map(|both| both[plane]);
                    state = before.back(&elements[at - 1], right, path_m, state);
                }
            }
        }
        if first > 0 {
            shape[0] = [seat.exit_m.x, seat.exit_m.y];
            slopes[0] = [seat.slope.x, seat.slope.y];
        }
        Insertion {
            depths_m,
            path_m: path,
            shape_m: shape,
            slopes,
            exit_m: [seat.exit_m.x, seat.exit_m.y],
            exit_slope: [seat.slope.x, seat.slope.y],
        }
    }

    /// Where the needle rests in its guide; `beside` if it is also loaded beside the direction of the tip's force.
    fn seat(&self, answer: &Answer, beside: bool) -> Seat {
        match &self.bore {
            Some(bore) if beside => bore.seat(answer),
            Some(bore) => {
                let (towards, by) = (Vector2::from(self.towards), &answer.by);
                let along = [answer.force_n, answer.slope].map(|each| each.dot(&towards));
                let rest = bore.seat_along(along, by, &Rest::MIDDLE);
                let turned = by.slope_by_exit * rest.exit_m + by.slope_by_moment * rest.moment_nm;
                Seat {
                    exit_m: towards * rest.exit_m,
                    moment_nm: towards * rest.moment_nm,
                    slope: towards * (along[1] + turned),
                }
            }
            None => Seat {
                exit_m: Vector2::zeros(),
                moment_nm: Vector2::zeros(),
                slope: Vector2::zeros(),
            },
        }
    }
}

/// By force and slope at the exit, of a displacement and of a moment there.
fn held(by_exit: Pair, by_moment: Pair) -> Held {
    Held {
        slope_by_exit: by_exit[1],
        slope_by_moment: by_moment[1],
        force_by_exit: by_exit[0],
    }
}
