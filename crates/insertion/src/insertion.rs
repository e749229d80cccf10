//! An insertion: the tip through all layers, element by element.

use nalgebra::{Matrix2x4, RowVector4, Vector2};

use crate::element::Element;
use crate::elimination::{Across, EXIT, Elimination, MOMENT, Tip};
use crate::guide::{Answer, Guide, Holder, Seat};
use crate::layers::Layers;
use crate::needle::{Needle, NeedleError};

/// Longest element within a layer, m: with it 60 random layered cases are within 1 um of a fifth of it in the median.
const ELEMENT_M: f64 = 0.6e-3;

/// The first element in tissue that is stiffer than what is before it, m, and by how much each one is longer than the one
/// before it. A long overhang is softer than the first tenths of a millimetre of stiff tissue: what the tip does there
/// decides how the needle goes on. Shorter ones round: by 20 um at 2e-6 m.
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
/// Accuracy: see `tests/`: closed forms to 1e-6, the circle of a cut path to 1e-3.
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
    let path = case.cut();
    Ok(case.shape(path, None))
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
    let path = Case::new(needle, holder, stand_off_m, layers, bevel, ELEMENT_M)?.cut();
    Ok([path[0], path[path.len() - 1]])
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

/// What is inserted, checked and cut into elements.
pub(crate) struct Case<'c> {
    bending_nm2: f64,
    holder: &'c Holder,
    stand_off_m: f64,
    layers: &'c Layers,
    bevel: &'c Bevel,
    /// Of the bevel's face along the axis, m.
    bevel_m: f64,
    /// Of the nodes, m from the skin.
    pub depths_m: Vec<f64>,
    elements: Vec<Element>,
}

impl<'c> Case<'c> {
    pub fn new(
        needle: &Needle,
        holder: &'c Holder,
        stand_off_m: f64,
        layers: &'c Layers,
        bevel: &'c Bevel,
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
        let bending_nm2 = needle.bending_stiffness_nm2();
        let (mut depths_m, mut elements) = (vec![0.0], Vec::new());
        let (mut end_m, mut before_n_m2) = (0.0, 0.0);
        for layer in layers.all() {
            let begin_m = end_m;
            end_m += layer.length_m;
            let add =
                |from_m: f64, to_m: f64, depths_m: &mut Vec<f64>, elements: &mut Vec<Element>| {
                    let element = Element::new(to_m - from_m, bending_nm2, layer.stiffness_n_m2);
                    depths_m.push(to_m);
                    elements.push(element);
                };
            let mut from_m = begin_m;
            if layer.stiffness_n_m2 > before_n_m2 {
                let mut length_m = FIRST_M;
                // What is left is no sliver, which would round.
                while length_m < element_m && from_m + length_m + FIRST_M < end_m {
                    add(from_m, from_m + length_m, &mut depths_m, &mut elements);
                    from_m += length_m;
                    length_m *= GROWTH;
                }
            }
            before_n_m2 = layer.stiffness_n_m2;
            let rest_m = end_m - from_m;
            let count = (rest_m / element_m - 1e-9).ceil().max(LEAST_ELEMENTS);
            let mut number = 1.0;
            while number <= count {
                let to_m = begin_m + (from_m - begin_m) + rest_m * number / count;
                let last_m = *depths_m.last().expect("it begins with one");
                add(last_m, to_m, &mut depths_m, &mut elements);
                number += 1.0;
            }
        }
        let tangent = libm::tan(bevel.angle_rad);
        Ok(Self {
            bending_nm2,
            holder,
            stand_off_m,
            layers,
            bevel,
            bevel_m: (needle.outer_m / tangent).max(ELEMENT_M),
            depths_m,
            elements,
        })
    }

    /// The force across the tip at a depth, in both planes, N: the mean over the face of the bevel.
    pub fn force_n(&self, depth_m: f64) -> Across {
        let impulse = |depth_m: f64| self.layers.impulse_nm(depth_m, self.bevel.turn_at_m);
        let before_m = (depth_m - self.bevel_m).max(0.0);
        let mean_n = (impulse(depth_m) - impulse(before_m)) / self.bevel_m;
        self.bevel.towards.map(|towards| towards * mean_n)
    }

    fn guide(&self) -> Option<&Guide> {
        match self.holder {
            Holder::Guide(guide) => Some(guide),
            Holder::Clamp | Holder::Hub(_) => None,
        }
    }

    /// Where the path begins: free of tissue, the least force leans the needle on both ends of its guide.
    fn at_skin(&self) -> Across {
        let first = self.layers.all().iter().map(|layer| layer.force_n);
        let sign = first
            .filter(|force_n| *force_n != 0.0)
            .map(f64::signum)
            .next();
        let [y, z] = self.bevel.towards;
        let length = (y * y + z * z).sqrt();
        match (self.guide(), sign) {
            (Some(guide), Some(sign)) if length > 0.0 => {
                let off_m = guide.play_m + self.stand_off_m * guide.lean();
                [y, z].map(|towards| sign * off_m * towards / length)
            }
            _ => [0.0; 2],
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
        self.guide()
            .map(|guide| guide.rotation_nm(self.bending_nm2))
    }

    /// What the tip cuts, at all nodes.
    pub fn cut(&self) -> Vec<Across> {
        let mut path = Vec::with_capacity(self.depths_m.len());
        path.push(self.at_skin());
        let stays = !matches!(self.holder, Holder::Hub(_));
        let mut known: Option<Elimination> = None;
        if stays && let Some(before) = self.before_skin(0.0) {
            known = Some(Elimination::first(
                &before,
                self.rotation_nm(),
                [[0.0; 2]; 2],
            ));
        }
        for at in 1..self.depths_m.len() {
            let element = &self.elements[at - 1];
            let tip = match &known {
                Some(known) if stays => known.tip(element, path[at - 1]),
                _ if stays => Elimination::first_tip(element, self.rotation_nm(), path[at - 1]),
                // The hub comes nearer.
                _ => self
                    .before(|at| [path[at], path[at + 1]], at - 1, self.depths_m[at])
                    .tip(element, path[at - 1]),
            };
            let cut = self.cut_by(&tip, self.force_n(self.depths_m[at]));
            path.push(cut);
            known = Some(tip.closed(cut));
        }
        path
    }

    /// Where the tip is.
    fn cut_by(&self, tip: &Tip, force: Across) -> Across {
        let (displacement, exit) = tip.answers(force);
        let seat = self.seat(&exit);
        [0, 1].map(|plane| with(&displacement, plane, &seat))
    }

    fn seat(&self, exit: &Matrix2x4<f64>) -> Seat {
        let answer = Answer {
            slope: Vector2::new(exit[(0, 0)], exit[(0, 1)]),
            force_n: Vector2::new(exit[(1, 0)], exit[(1, 1)]),
            slope_by_exit: exit[(0, EXIT)],
            slope_by_moment: exit[(0, MOMENT)],
            force_by_exit: exit[(1, EXIT)],
        };
        match self.guide() {
            Some(guide) => guide.seat(self.bending_nm2, &answer),
            None => Seat {
                exit_m: Vector2::zeros(),
                moment_nm: Vector2::zeros(),
                slope: Vector2::zeros(),
            },
        }
    }

    /// What is before a node, with the tip at a depth; `path` is that at both ends of an element.
    fn before(
        &self,
        path: impl Fn(usize) -> [Across; 2],
        node: usize,
        depth_m: f64,
    ) -> Elimination {
        let mut first = 0;
        let mut known = if let Some(before) = self.before_skin(depth_m) {
            Elimination::first(&before, self.rotation_nm(), [[0.0; 2]; 2])
        } else {
            first = 1;
            Elimination::first(&self.elements[0], self.rotation_nm(), path(0))
        };
        for at in first..node {
            known = known.next(&self.elements[at], path(at));
        }
        known
    }

    /// The needle at the end of its way, on a path; with what has moved since.
    pub fn shape(&self, path: Vec<Across>, slip: Option<Slip>) -> Insertion {
        // Tissue moves whole, from the end of an element on.
        let moved = |at: usize| {
            let middle_m = 0.5 * (self.depths_m[at] + self.depths_m[at + 1]);
            let [y_m, z_m] = slip
                .filter(|slip| middle_m > slip.from_m)
                .map_or([0.0; 2], |slip| slip.by_m);
            [path[at], path[at + 1]].map(|[y, z]| [y + y_m, z + z_m])
        };
        let depth_m = self.layers.depth_m();
        let last = self.elements.len();
        // What is before each node, from the skin on.
        let has_stand_off = self.before_skin(depth_m).is_some();
        let mut all: Vec<Elimination> = Vec::with_capacity(last + 1);
        let first = usize::from(!has_stand_off);
        all.push(self.before(moved, first, depth_m));
        for at in first..last {
            all.push(all[at - first].next(&self.elements[at], moved(at)));
        }
        let end = all[last - first];
        let inverse = end
            .stiffness
            .try_inverse()
            .expect("a needle that is held is stiff");
        let mut right = end.right;
        for (plane, force_n) in self.force_n(depth_m).into_iter().enumerate() {
            right[(0, plane)] += force_n;
        }
        let mut state = inverse * right;
        let seat = self.seat(&(end.exit + end.turn * state));
        let mut shape = vec![[0.0; 2]; last + 1];
        let mut slopes = shape.clone();
        for at in (first..=last).rev() {
            for plane in 0..2 {
                shape[at][plane] = with(&state.row(0).into_owned(), plane, &seat);
                slopes[at][plane] = with(&state.row(1).into_owned(), plane, &seat);
            }
            if at > first {
                let (constant, by_next) =
                    all[at - 1 - first].back(&self.elements[at - 1], moved(at - 1));
                state = constant + by_next * state;
            }
        }
        if !has_stand_off {
            shape[0] = [seat.exit_m.x, seat.exit_m.y];
            slopes[0] = [seat.slope.x, seat.slope.y];
        }
        Insertion {
            depths_m: self.depths_m.clone(),
            path_m: path,
            shape_m: shape,
            slopes,
            exit_m: [seat.exit_m.x, seat.exit_m.y],
            exit_slope: [seat.slope.x, seat.slope.y],
        }
    }
}

/// What answers to both planes are with a seat.
fn with(answers: &RowVector4<f64>, plane: usize, seat: &Seat) -> f64 {
    answers[plane] + answers[EXIT] * seat.exit_m[plane] + answers[MOMENT] * seat.moment_nm[plane]
}
