//! The least-squares fit of torques, from sums of products of terms.

use nalgebra::{DMatrix, DVector, Vector3};
use needlebench_kinematics::{JOINT_COUNT, Joints};

use super::{Context, blocks};
use crate::Load;
use crate::regression::{BLOCKS, solve};
use crate::terms::{TERMS, point_inertia, term};

/// Places of the parameters: rotors, sliding and viscous friction per joint, then four per load.
const COULOMB: usize = JOINT_COUNT;
const VISCOUS: usize = 2 * JOINT_COUNT;
const LOADS: usize = 3 * JOINT_COUNT;

/// Combinations of terms per joint: what is to be explained, and the joint's parameters: rotor, two of
/// friction, four of the load.
const COMBINED: usize = 8;

/// Rounds of weights, and of gravity and the loads' own inertia, which enter the fit as known.
const ROUNDS: usize = 3;

/// Gravity lies within this of the standard one on earth, m/s^2, with room for a controller's rounding.
const GRAVITY_RANGE: [f64; 2] = [9.6, 10.0];
const STANDARD_GRAVITY: f64 = 9.806_65;

/// Step of the parabola through three costs by which gravity is found, m/s^2.
const GRAVITY_STEP: f64 = 0.02;

/// Least weight's scale, as a share of the largest joint's error, and absolutely, N m: numbers of a log
/// have nine digits or fewer.
const LEAST_ERROR: f64 = 1e-3;
const LEAST_ERROR_NM: f64 = 1e-7;

/// What digits of logs and unmodelled trifles leave of a torque in any case, N m.
const DIGITS_NM: f64 = 1e-5;

/// A lighter load has no centre, kg.
const LEAST_MASS_KG: f64 = 1e-3;

/// Sums of products of all terms of a joint, and the number of rows.
#[derive(Clone)]
struct Gram {
    sums: [[f64; TERMS]; TERMS],
    rows: f64,
}

impl Gram {
    const ZERO: Self = Self {
        sums: [[0.0; TERMS]; TERMS],
        rows: 0.0,
    };

    fn add(&mut self, terms: &[f64; TERMS]) {
        for i in 0..TERMS {
            for j in i..TERMS {
                self.sums[i][j] += terms[i] * terms[j];
            }
        }
        self.rows += 1.0;
    }

    fn plus(&mut self, other: &Self, sign: f64) {
        for (row, others) in self.sums.iter_mut().zip(&other.sums) {
            for (sum, other) in row.iter_mut().zip(others) {
                *sum += sign * other;
            }
        }
        self.rows += sign * other.rows;
    }

    fn of(&self, i: usize, j: usize) -> f64 {
        self.sums[i.min(j)][i.max(j)]
    }
}

/// Per load, per joint.
type Grams = Vec<Vec<Gram>>;

/// The sums of a run, by block.
pub(super) struct Data {
    blocks: Vec<Grams>,
    /// Inertia of each load about its own centre, as the log has it, kg m^2.
    loads: Vec<[f64; 6]>,
}

impl Data {
    /// Sums over the rows that count for a joint.
    pub fn gather(
        context: &Context<'_>,
        torque_nm: &dyn Fn(usize) -> Joints,
        counts: &dyn Fn(usize, usize) -> bool,
    ) -> Self {
        let loads = context.loads.len();
        let mut found = vec![vec![vec![Gram::ZERO; JOINT_COUNT]; loads]; BLOCKS];
        for (row, block) in blocks(context.run.len()).enumerate() {
            let Some(load) = (context.load_of)(row) else {
                continue;
            };
            let state = &context.states[row];
            let torque_nm = torque_nm(row);
            let mut terms =
                context
                    .arm
                    .terms(&state.position, &state.velocity, &state.acceleration);
            for (joint, terms) in terms.iter_mut().enumerate() {
                if counts(row, joint) {
                    terms[term::TORQUE] = torque_nm[joint];
                    found[block][load][joint].add(terms);
                }
            }
        }
        let own = |load: &Option<Load>| load.map_or([0.0; 6], |load| load.inertia_kgm2);
        Self {
            blocks: found,
            loads: context.loads.iter().map(own).collect(),
        }
    }

    /// Sums of the blocks that are wanted.
    fn sum(&self, wanted: impl Fn(usize) -> bool) -> Grams {
        let mut total = vec![vec![Gram::ZERO; JOINT_COUNT]; self.loads.len()];
        for (_, block) in self.blocks.iter().enumerate().filter(|(at, _)| wanted(*at)) {
            for (total, grams) in total.iter_mut().zip(block) {
                for (total, gram) in total.iter_mut().zip(grams) {
                    total.plus(gram, 1.0);
                }
            }
        }
        total
    }

    /// Root mean square of what rotors, gravity and loads that are given leave of the torques, N m.
    pub(crate) fn rms_by(
        &self,
        rotors: &[f64; JOINT_COUNT],
        gravity_m_s2: f64,
        loads: &[Option<Load>],
    ) -> [f64; JOINT_COUNT] {
        let mut values = DVector::zeros(LOADS + 4 * self.loads.len());
        let mut inertia = Vec::new();
        for (at, load) in loads.iter().enumerate() {
            let (mass_kg, centre_m) = load.map_or((0.0, Vector3::zeros()), |load| {
                (load.mass_kg, Vector3::from(load.centre_m))
            });
            values[LOADS + 4 * at] = mass_kg;
            for axis in 0..3 {
                values[LOADS + 4 * at + 1 + axis] = mass_kg * centre_m[axis];
            }
            inertia.push(sum(&self.loads[at], &point_inertia(mass_kg, &centre_m)));
        }
        for (joint, rotor) in rotors.iter().enumerate() {
            values[joint] = *rotor;
        }
        let fit = Fit {
            model: Model {
                has_tensors: true,
                has_friction: false,
                gravity_m_s2: Some(gravity_m_s2),
            },
            gravity_m_s2,
            own_inertia: self.loads.clone(),
            inertia,
            determined: vec![true; values.len()],
            values,
            weights: [1.0; JOINT_COUNT],
            gravity_is_determined: false,
        };
        fit.rms_nm(self)
    }
}

/// What the equation has.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model {
    pub has_tensors: bool,
    pub has_friction: bool,
    /// Gravity, m/s^2; sought if none.
    pub gravity_m_s2: Option<f64>,
}

/// A fit.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    model: Model,
    gravity_m_s2: f64,
    gravity_is_determined: bool,
    /// Inertia of each load about its own centre, kg m^2.
    own_inertia: Vec<[f64; 6]>,
    /// The same about the flange's origin, by the mass and centre that were found, kg m^2.
    inertia: Vec<[f64; 6]>,
    values: DVector<f64>,
    determined: Vec<bool>,
    /// Of each joint's squares, 1/(N m)^2.
    weights: [f64; JOINT_COUNT],
}

/// Normal equations of all parameters, and the sum of weighted squares of what is to be explained.
struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

impl Fit {
    /// A fit of the whole run, each joint weighted by its own error.
    pub fn weighted(data: &Data, model: Model) -> Self {
        let total = data.sum(|_| true);
        let mut fit = Self::start(&data.loads, model, [1.0; JOINT_COUNT]);
        for _ in 0..ROUNDS {
            fit.improve(&total);
            let rms = fit.rms_of(&total);
            let largest = rms.iter().copied().fold(0.0, f64::max);
            let least = (LEAST_ERROR * largest).max(LEAST_ERROR_NM);
            fit.weights = rms.map(|rms| rms.max(least).powi(-2));
        }
        fit.improve(&total);
        fit
    }

    fn start(loads: &[[f64; 6]], model: Model, weights: [f64; JOINT_COUNT]) -> Self {
        let count = LOADS + 4 * loads.len();
        Self {
            model,
            gravity_m_s2: model.gravity_m_s2.unwrap_or(STANDARD_GRAVITY),
            gravity_is_determined: false,
            own_inertia: loads.to_vec(),
            inertia: loads.to_vec(),
            values: DVector::zeros(count),
            determined: vec![false; count],
            weights,
        }
    }

    /// The same fit without a block.
    pub fn without(&self, data: &Data, block: usize) -> Self {
        self.of(&data.sum(|at| at != block))
    }

    fn of(&self, grams: &Grams) -> Self {
        let mut fit = self.clone();
        fit.improve(grams);
        fit
    }

    /// Rounds of gravity, parameters, and the loads' inertia.
    fn improve(&mut self, grams: &Grams) {
        for _ in 0..ROUNDS {
            if self.model.gravity_m_s2.is_none() {
                self.find_gravity(grams);
            }
            let normal = self.normal(grams, self.gravity_m_s2);
            let mut solution = solve(&normal.matrix, &normal.right);
            solution.determined_by(grams.iter().flatten().map(|gram| gram.rows).sum());
            (self.values, self.determined) = (solution.values, solution.determined);
            for load in 0..self.inertia.len() {
                let mass_kg = self.values[LOADS + 4 * load];
                self.inertia[load] = if mass_kg > LEAST_MASS_KG {
                    let centre_m = Vector3::from_fn(|axis, _| {
                        self.values[LOADS + 4 * load + 1 + axis] / mass_kg
                    });
                    sum(&self.own_inertia[load], &point_inertia(mass_kg, &centre_m))
                } else {
                    self.own_inertia[load]
                };
            }
        }
    }

    /// The gravity of the least cost, by parabolas.
    fn find_gravity(&mut self, grams: &Grams) {
        let cost_at = |gravity: f64| {
            let normal = self.normal(grams, gravity);
            cost(&normal, &solve(&normal.matrix, &normal.right).values)
        };
        let mut gravity = self.gravity_m_s2;
        let mut step = GRAVITY_STEP;
        let mut determined = false;
        for _ in 0..ROUNDS {
            let [below, at, above] = [gravity - step, gravity, gravity + step].map(cost_at);
            let bend = above - 2.0 * at + below;
            // As flat as rounding leaves it: nothing in the run depends on gravity.
            determined = bend > 1e-12 * at.abs() && bend > 0.0;
            if !determined {
                break;
            }
            let change = 0.5 * step * (below - above) / bend;
            gravity = (gravity + change).clamp(GRAVITY_RANGE[0], GRAVITY_RANGE[1]);
            step *= 0.1;
        }
        self.gravity_m_s2 = gravity;
        self.gravity_is_determined =
            determined && gravity > GRAVITY_RANGE[0] && gravity < GRAVITY_RANGE[1];
    }

    /// How the combinations of a joint and load are made of the terms.
    fn combinations(&self, load: usize, gravity: f64) -> [Vec<(usize, f64)>; COMBINED] {
        let mut explained = vec![
            (term::TORQUE, 1.0),
            (term::LINKS, -1.0),
            (term::LINKS_GRAVITY, -gravity),
        ];
        if self.model.has_tensors {
            explained.push((term::TENSORS, -1.0));
        }
        for (k, inertia) in self.inertia[load].iter().enumerate() {
            explained.push((term::LOAD_INERTIA + k, -inertia));
        }
        let friction = |place: usize| {
            if self.model.has_friction {
                vec![(place, 1.0)]
            } else {
                Vec::new()
            }
        };
        let of_load = |k: usize| vec![(term::LOAD + k, 1.0), (term::LOAD_GRAVITY + k, gravity)];
        [
            explained,
            vec![(term::ACCELERATION, 1.0)],
            friction(term::DIRECTION),
            friction(term::SPEED),
            of_load(0),
            of_load(1),
            of_load(2),
            of_load(3),
        ]
    }

    /// Products of the combinations of a joint and load.
    fn combined(
        gram: &Gram,
        combinations: &[Vec<(usize, f64)>; COMBINED],
    ) -> [[f64; COMBINED]; COMBINED] {
        let mut products = [[0.0; COMBINED]; COMBINED];
        for (a, first) in combinations.iter().enumerate() {
            for (b, second) in combinations.iter().enumerate().skip(a) {
                let mut sum = 0.0;
                for (i, x) in first {
                    for (j, y) in second {
                        sum += x * y * gram.of(*i, *j);
                    }
                }
                products[a][b] = sum;
                products[b][a] = sum;
            }
        }
        products
    }

    /// Places of a joint's and load's combinations among the parameters.
    fn places(joint: usize, load: usize) -> [usize; COMBINED - 1] {
        let loads = LOADS + 4 * load;
        [
            joint,
            COULOMB + joint,
            VISCOUS + joint,
            loads,
            loads + 1,
            loads + 2,
            loads + 3,
        ]
    }

    fn normal(&self, grams: &Grams, gravity: f64) -> Normal {
        let count = self.values.len();
        let mut matrix = DMatrix::zeros(count, count);
        let mut right = DVector::zeros(count);
        let mut square = 0.0;
        for (load, joints) in grams.iter().enumerate() {
            let combinations = self.combinations(load, gravity);
            for (joint, gram) in joints.iter().enumerate() {
                let products = Self::combined(gram, &combinations);
                let weight = self.weights[joint];
                let places = Self::places(joint, load);
                square += weight * products[0][0];
                for (a, place) in places.iter().enumerate() {
                    right[*place] += weight * products[0][a + 1];
                    for (b, other) in places.iter().enumerate() {
                        matrix[(*place, *other)] += weight * products[a + 1][b + 1];
                    }
                }
            }
        }
        Normal {
            matrix,
            right,
            square,
        }
    }

    /// How unlikely the run is by this fit: the sum over rows of the logarithm of their joint's error.
    /// Models with the same number of parameters compare by it.
    pub(crate) fn unlikelihood(&self, data: &Data) -> f64 {
        let squares = self.squares(&data.sum(|_| true));
        let each = squares.iter().filter(|(_, rows)| *rows > 0.0);
        each.map(|(sum, rows)| 0.5 * rows * libm::log(sum / rows + DIGITS_NM * DIGITS_NM))
            .sum()
    }

    pub fn rms_nm(&self, data: &Data) -> [f64; JOINT_COUNT] {
        self.rms_of(&data.sum(|_| true))
    }

    /// Of every other block from a fit of those between, both ways.
    pub fn held_out_rms_nm(&self, data: &Data) -> [f64; JOINT_COUNT] {
        let halves = [0, 1].map(|parity| data.sum(|block| block % 2 == parity));
        let [a, b] = &halves;
        let (of_b, of_a) = (self.of(a).squares(b), self.of(b).squares(a));
        std::array::from_fn(|joint| {
            let rows = of_a[joint].1 + of_b[joint].1;
            ((of_a[joint].0 + of_b[joint].0) / rows.max(1.0)).sqrt()
        })
    }

    fn rms_of(&self, grams: &Grams) -> [f64; JOINT_COUNT] {
        self.squares(grams)
            .map(|(sum, rows)| (sum / rows.max(1.0)).sqrt())
    }

    /// Sum of squares that is left of each joint, and its rows.
    fn squares(&self, grams: &Grams) -> [(f64, f64); JOINT_COUNT] {
        let mut found = [(0.0, 0.0); JOINT_COUNT];
        for (load, joints) in grams.iter().enumerate() {
            let combinations = self.combinations(load, self.gravity_m_s2);
            for (joint, gram) in joints.iter().enumerate() {
                let products = Self::combined(gram, &combinations);
                let places = Self::places(joint, load);
                let mut factors = [1.0; COMBINED];
                for (factor, place) in factors[1..].iter_mut().zip(places) {
                    *factor = -self.values[place];
                }
                let mut sum = 0.0;
                for (a, x) in factors.iter().enumerate() {
                    for (b, y) in factors.iter().enumerate() {
                        sum += x * y * products[a][b];
                    }
                }
                found[joint].0 += sum.max(0.0);
                found[joint].1 += gram.rows;
            }
        }
        found
    }

    fn known(&self, place: usize) -> Option<f64> {
        self.determined[place].then(|| self.values[place])
    }

    pub fn rotor(&self, joint: usize) -> Option<f64> {
        self.known(joint)
    }

    pub fn coulomb(&self, joint: usize) -> Option<f64> {
        self.known(COULOMB + joint)
    }

    pub fn viscous(&self, joint: usize) -> Option<f64> {
        self.known(VISCOUS + joint)
    }

    pub fn mass(&self, load: usize) -> Option<f64> {
        self.known(LOADS + 4 * load)
    }

    pub fn centre(&self, load: usize, axis: usize) -> Option<f64> {
        let mass_kg = self.mass(load).filter(|mass_kg| *mass_kg > LEAST_MASS_KG)?;
        Some(self.known(LOADS + 4 * load + 1 + axis)? / mass_kg)
    }

    pub fn gravity(&self) -> Option<f64> {
        self.gravity_is_determined.then_some(self.gravity_m_s2)
    }
}

fn sum(a: &[f64; 6], b: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|k| a[k] + b[k])
}

fn cost(normal: &Normal, values: &DVector<f64>) -> f64 {
    normal.square - 2.0 * normal.right.dot(values) + values.dot(&(&normal.matrix * values))
}
