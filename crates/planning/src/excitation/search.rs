//! The search for a run's postures and sweeps.
//!
//! Candidates are quasi-random postures that keep the clearances and to which the straight motion from the start
//! posture keeps them too: so there is a way between any two, over the start at worst. Of these as many as are wished
//! for are chosen by what they tell (the determinant of the information of a calibration, of the payload's moments
//! and of the torques of gravity), one after the other and then by exchange, ordered so that motions are short,
//! and every motion is certified.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{Matrix2, Vector2};
use needlebench_cell::ClearanceClass;
use needlebench_clearance::{ClearanceModel, Nearby, PairClearance};
use needlebench_kinematics::{Body, Dynamics, JOINT_COUNT, JOINT_LABELS, Joints};
use needlebench_numerics::order::upper_median;
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::excitation::{ExcitationProtocol, Load, Sweep};

use super::information::{Calibration, CalibrationInformation, Identification};
use super::{Leg, least_m, legs};
use crate::limits::{ByClass, ClassLimits};
use crate::motion::MotionChecker;
use crate::rejection::distance_in_words;

/// Reserve of postures beyond the limits, m. Assumed: above what a factory calibration moves the flange by, what
/// tracking adds, and what lies between two looks at a motion.
const RESERVE_M: f64 = 3e-3;

/// Candidates that are enough to choose from.
const ENOUGH: usize = 400;

/// Postures that are drawn for them at most.
const MOST_DRAWS: u32 = 20_000;

/// Joints stay this far from the ends of their ranges, rad: 5 deg.
const END_RAD: f64 = 0.087;

/// Half of the range of a joint about the start posture, rad: half a turn, so that no cable is wound up; the base
/// a quarter, so that there is a side to stand on. Assumed.
const HALF_RANGE_RAD: Joints = Joints::new(
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::PI,
    std::f64::consts::PI,
    std::f64::consts::PI,
    std::f64::consts::PI,
    std::f64::consts::PI,
);

/// Share of a joint's torque limit that holding a posture may take.
const HOLDING_SHARE: f64 = 0.7;

/// Lengths of sweeps that are tried, the longest first, rad: 60, 45 and 30 deg.
const SWEEPS_RAD: [f64; 3] = [1.05, 0.785, 0.524];

/// Exchanges of one chosen posture for a better one, over all of them, at most.
const EXCHANGES: usize = 6;

/// Postures at which a calibration is evaluated.
const ELSEWHERE: usize = 200;

/// Runs with random postures that a run is compared with.
const RANDOM_RUNS: u64 = 9;

/// Standard deviation of a torque about its law that spreads of gravity are compared with, N m. Assumed: a wrist's
/// friction.
const GRAVITY_NOISE_NM: f64 = 0.5;

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchOptions {
    /// Postures that are wished for.
    pub postures: usize,
    /// Seed of everything random.
    pub seed: u64,
}

/// A run that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundRun {
    /// The protocol with its postures and sweeps.
    pub protocol: ExcitationProtocol,
    /// Postures that are passed through again, because the direct way is not free: the start's.
    pub detours: usize,
    /// Candidates that were chosen from.
    pub candidates: usize,
    /// Postures that were drawn for them.
    pub drawn: u32,
    /// What it tells.
    pub tells: (CalibrationInformation, Identification),
    /// What runs with as many random free postures and no sweeps tell: the median one, by the error of the
    /// flange, and values of drives by the median of each.
    pub random: (CalibrationInformation, Identification),
}

/// Why no run was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// The start posture is too near to something.
    #[error(
        "in the start posture, {}, clearance {least_mm:.1} mm required (including a reserve of 3 mm)",
        distance_in_words(.a, .b, *.distance_mm)
    )]
    Start {
        /// One solid.
        a: String,
        /// The other one.
        b: String,
        /// Their distance, mm.
        distance_mm: f64,
        /// The required clearance, reserve included, mm.
        least_mm: f64,
    },
    /// Too few postures keep the clearances.
    #[error(
        "{free} of {drawn} sampled postures satisfy the clearances, including the motion from the \
         start posture: too few for a run of {wanted}"
    )]
    Postures {
        /// Postures that were drawn.
        drawn: u32,
        /// Those that are free.
        free: usize,
        /// What is wished for.
        wanted: usize,
    },
    /// A joint has no room to sweep.
    #[error("no posture has space for a sweep of {joint} by {by_deg:.0} deg")]
    Sweep {
        /// The joint's label.
        joint: &'static str,
        /// The shortest that was tried, deg.
        by_deg: f64,
    },
}

/// Finds the postures and sweeps of a run in a scenario's cell; `wanted` has everything else of it.
///
/// The same scenario and options give the same run.
///
/// # Errors
/// [`SearchError`].
pub fn search(
    resolved: &ResolvedScenario,
    wanted: &ExcitationProtocol,
    model: &ClearanceModel,
    options: SearchOptions,
) -> Result<FoundRun, SearchError> {
    let search = Search::new(resolved, wanted, model);
    search.check_start()?;
    let (candidates, drawn) = search.candidates(options)?;
    let chosen = search.chosen(&candidates, options.postures);
    let chosen: Vec<Joints> = chosen.into_iter().map(|at| candidates[at]).collect();
    let (postures, detours) = search.tour(&chosen);
    let mut protocol = ExcitationProtocol {
        postures,
        ..wanted.clone()
    };
    protocol.sweeps = search.sweeps(&protocol)?;
    let elsewhere: Vec<Joints> = candidates
        .iter()
        .filter(|q| !chosen.contains(q))
        .take(ELSEWHERE)
        .copied()
        .collect();
    let elsewhere = if elsewhere.is_empty() {
        &chosen
    } else {
        &elsewhere
    };
    let tells = search.tells(&protocol, &chosen, elsewhere);
    let random = search.random(&candidates, options, elsewhere);
    Ok(FoundRun {
        protocol,
        detours,
        candidates: candidates.len(),
        drawn,
        tells,
        random,
    })
}

/// What is looked for, and where.
struct Search<'a> {
    resolved: &'a ResolvedScenario,
    wanted: &'a ExcitationProtocol,
    checker: MotionChecker<'a>,
    least_m: ByClass,
    /// The arm without its tool.
    arm: Dynamics,
    /// What is at the flange, run by run.
    tools: Vec<Body>,
    /// The arm with the heaviest of them.
    heaviest: Dynamics,
}

impl<'a> Search<'a> {
    fn new(
        resolved: &'a ResolvedScenario,
        wanted: &'a ExcitationProtocol,
        model: &'a ClearanceModel,
    ) -> Self {
        let cell = &resolved.cell;
        let tools: Vec<Body> = wanted
            .loads
            .iter()
            .map(|load: &Load| load.with_tool(&cell.tool))
            .collect();
        let arm = Dynamics {
            bodies: cell.robot.bodies,
            ..cell.dynamics()
        };
        let heaviest = tools.iter().max_by(|a, b| a.mass_kg.total_cmp(&b.mass_kg));
        let mut carrying = arm;
        if let Some(tool) = heaviest {
            let last = &mut carrying.bodies[JOINT_COUNT - 1];
            *last = last.combined_with(&tool.transformed(&cell.robot.chain.wrist_3_from_flange));
        }
        Self {
            resolved,
            wanted,
            checker: MotionChecker::new(
                cell,
                model,
                ClassLimits::of(&resolved.scenario),
                &resolved.scenario.planning,
            ),
            least_m: ByClass::of(|class| least_m(wanted, class) + RESERVE_M),
            arm,
            tools,
            heaviest: carrying,
        }
    }

    fn start(&self) -> &Joints {
        &self.resolved.start
    }

    /// The start posture itself keeps the clearances.
    fn check_start(&self) -> Result<(), SearchError> {
        let limit_m = |class: ClearanceClass| self.least_m.get(class);
        let below: Option<PairClearance> = self.checker.model.first_below(self.start(), limit_m);
        let Some(pair) = below else {
            return Ok(());
        };
        let [a, b] = pair.in_words(&self.resolved.cell).map(Cow::into_owned);
        Err(SearchError::Start {
            a,
            b,
            distance_mm: pair.separation.distance_m * 1e3,
            least_mm: limit_m(pair.class) * 1e3,
        })
    }

    /// Whether a posture can be held and keeps the clearances.
    fn is_free(&self, q: &Joints, nearby: &mut Nearby) -> bool {
        let limits = &self.resolved.cell.robot.limits;
        let holding = self.heaviest.gravity_torque(q);
        limits.first_violation(q).is_none()
            && holding
                .iter()
                .zip(&limits.efforts_nm())
                .all(|(torque, limit)| torque.abs() <= HOLDING_SHARE * limit)
            && self
                .checker
                .is_free(q, nearby, |class| self.least_m.get(class))
    }

    fn keeps(&self, from: &Joints, to: &Joints) -> bool {
        self.checker.keeps_straight(from, to, &self.least_m).0
    }

    /// Free postures that the start reaches, and how many were drawn.
    fn candidates(&self, options: SearchOptions) -> Result<(Vec<Joints>, u32), SearchError> {
        let limits = &self.resolved.cell.robot.limits;
        let mut sequence = Kronecker::new(options.seed);
        let mut nearby = Nearby::default();
        let mut found: Vec<Joints> = Vec::new();
        let enough = ENOUGH.max(4 * options.postures);
        let mut drawn = 0;
        while found.len() < enough && drawn < MOST_DRAWS {
            drawn += 1;
            let share = sequence.next();
            let q = Joints::from_fn(|i, _| {
                let limit = limits.0[i];
                let (start, half) = (self.start()[i], HALF_RANGE_RAD[i]);
                let lower = (limit.lower_rad + END_RAD).max(start - half);
                let upper = (limit.upper_rad - END_RAD).min(start + half);
                lower + share[i] * (upper - lower)
            });
            if self.is_free(&q, &mut nearby) && self.keeps(self.start(), &q) {
                found.push(q);
            }
        }
        if found.len() < options.postures {
            return Err(SearchError::Postures {
                drawn,
                free: found.len(),
                wanted: options.postures,
            });
        }
        Ok((found, drawn))
    }

    /// The candidates that tell most together, by their indices.
    fn chosen(&self, candidates: &[Joints], count: usize) -> Vec<usize> {
        let chain = &self.resolved.cell.robot.chain;
        let mut chosen: Vec<usize> = Vec::new();
        let mut known = Telling::new(chain, &self.heaviest);
        for _ in 0..count {
            let best = best_of(candidates, &chosen, &known);
            known.add(&candidates[best]);
            chosen.push(best);
        }
        for _ in 0..EXCHANGES {
            let mut is_better = false;
            for place in 0..chosen.len() {
                let mut known = Telling::new(chain, &self.heaviest);
                for (other, &at) in chosen.iter().enumerate() {
                    if other != place {
                        known.add(&candidates[at]);
                    }
                }
                let others: Vec<usize> = chosen
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != place)
                    .map(|(_, &at)| at)
                    .collect();
                let best = best_of(candidates, &others, &known);
                let before = known.gain(&candidates[chosen[place]]);
                // Differences below this are rounding.
                if known.gain(&candidates[best]) > before + 1e-9 {
                    chosen[place] = best;
                    is_better = true;
                }
            }
            if !is_better {
                break;
            }
        }
        chosen
    }

    /// The postures in an order of short motions from the start and back to it, over the start where the direct way
    /// is not free; and how often that is.
    fn tour(&self, chosen: &[Joints]) -> (Vec<Joints>, usize) {
        let count = chosen.len();
        // The start is the last one.
        let at = |index: usize| chosen.get(index).unwrap_or(self.start());
        let way = |a: usize, b: usize| (at(a) - at(b)).amax();
        let mut free: BTreeMap<(usize, usize), bool> = BTreeMap::new();
        let mut is_free = |a: usize, b: usize| {
            // Candidates are those that the start reaches.
            a == count || b == count || {
                let pair = (a.min(b), a.max(b));
                *free
                    .entry(pair)
                    .or_insert_with(|| self.keeps(at(pair.0), at(pair.1)))
            }
        };
        let mut cost = |a: usize, b: usize| {
            if is_free(a, b) {
                way(a, b)
            } else {
                way(a, count) + way(count, b)
            }
        };
        // Nearest first, then parts of the order are turned round as long as that shortens it.
        let mut order: Vec<usize> = Vec::new();
        let mut left: Vec<usize> = (0..count).collect();
        let mut here = count;
        while !left.is_empty() {
            let costs: Vec<f64> = left.iter().map(|&next| cost(here, next)).collect();
            let best = (0..left.len())
                .min_by(|&a, &b| costs[a].total_cmp(&costs[b]))
                .unwrap_or(0);
            here = left.remove(best);
            order.push(here);
        }
        loop {
            let mut is_shorter = false;
            for first in 0..count {
                for last in first + 1..count {
                    let before = if first == 0 { count } else { order[first - 1] };
                    let after = order.get(last + 1).copied().unwrap_or(count);
                    let now = cost(before, order[first]) + cost(order[last], after);
                    let turned = cost(before, order[last]) + cost(order[first], after);
                    if turned < now - 1e-9 {
                        order[first..=last].reverse();
                        is_shorter = true;
                    }
                }
            }
            if !is_shorter {
                break;
            }
        }
        let (mut postures, mut detours) = (Vec::new(), 0);
        let mut here = count;
        for next in order {
            if !is_free(here, next) {
                postures.push(*self.start());
                detours += 1;
            }
            postures.push(*at(next));
            here = next;
        }
        (postures, detours)
    }

    /// A sweep of each joint: the longest that is free at any posture, there where gravity changes most by it.
    fn sweeps(&self, protocol: &ExcitationProtocol) -> Result<Vec<Sweep>, SearchError> {
        let count = protocol.postures.len();
        (0..JOINT_COUNT)
            .map(|joint| {
                let found = SWEEPS_RAD.into_iter().find_map(|by_rad| {
                    let tries = (0..=count).flat_map(|posture| {
                        [by_rad, -by_rad].map(|by_rad| Sweep {
                            joint,
                            posture,
                            by_rad,
                        })
                    });
                    let mut tries: Vec<(f64, Sweep)> = tries
                        .map(|sweep| (self.gravity_change_nm(protocol, &sweep), sweep))
                        .collect();
                    tries.sort_by(|a, b| b.0.total_cmp(&a.0));
                    let is_free = |sweep: &Sweep| {
                        let here = protocol.posture(sweep.posture, self.start());
                        let end = protocol.sweep_end(sweep, self.start());
                        self.is_free(&end, &mut Nearby::default()) && self.keeps(&here, &end)
                    };
                    tries
                        .into_iter()
                        .map(|(_, sweep)| sweep)
                        .find(|sweep| is_free(sweep))
                });
                found.ok_or(SearchError::Sweep {
                    joint: JOINT_LABELS[joint],
                    by_deg: SWEEPS_RAD[SWEEPS_RAD.len() - 1].to_degrees(),
                })
            })
            .collect()
    }

    /// By how much the torque of gravity at a joint changes over its sweep, N m, to a tenth; so that joints that
    /// gravity does not load are not chosen by rounding.
    fn gravity_change_nm(&self, protocol: &ExcitationProtocol, sweep: &Sweep) -> f64 {
        let here = protocol.posture(sweep.posture, self.start());
        let end = protocol.sweep_end(sweep, self.start());
        let [here, end] = [here, end].map(|q| self.heaviest.gravity_torque(&q)[sweep.joint]);
        ((end - here).abs() * 10.0).round() / 10.0
    }

    fn constants(&self) -> Option<&[f64; JOINT_COUNT]> {
        let used = self.resolved.robot_description.arm.as_ref()?;
        let motors = used.arm.data.motors.as_ref()?;
        Some(&motors.torque_constant_nm_a)
    }

    /// What a run tells. Passing through the start once more tells a calibration nothing that is counted.
    fn tells(
        &self,
        protocol: &ExcitationProtocol,
        postures: &[Joints],
        elsewhere: &[Joints],
    ) -> (CalibrationInformation, Identification) {
        let robot = &self.resolved.cell.robot;
        let calibration = Calibration::of(&robot.chain, postures).summary(elsewhere);
        let (trajectory, _): (_, Vec<Leg>) = legs(protocol, self.start(), &self.resolved.motion);
        let flange = &robot.chain.wrist_3_from_flange;
        let found = Identification::of(
            &self.arm,
            &self.tools,
            flange,
            &trajectory,
            self.constants(),
        );
        (calibration, found)
    }

    /// The same of runs with random free postures, without sweeps: medians.
    fn random(
        &self,
        candidates: &[Joints],
        options: SearchOptions,
        elsewhere: &[Joints],
    ) -> (CalibrationInformation, Identification) {
        let runs: Vec<(CalibrationInformation, Identification)> = (0..RANDOM_RUNS)
            .map(|run| {
                let mut random = SplitMix64::new(options.seed ^ (run + 1));
                let mut left: Vec<usize> = (0..candidates.len()).collect();
                let postures: Vec<Joints> = (0..options.postures)
                    .map(|_| {
                        let bound = u32::try_from(left.len()).expect("some hundreds");
                        candidates[left.swap_remove(random.below(bound) as usize)]
                    })
                    .collect();
                let protocol = ExcitationProtocol {
                    postures: postures.clone(),
                    sweeps: Vec::new(),
                    ..self.wanted.clone()
                };
                self.tells(&protocol, &postures, elsewhere)
            })
            .collect();
        let of_calibration = |value: fn(&CalibrationInformation) -> f64| {
            median(runs.iter().map(|(found, _)| value(found)))
        };
        let mut typical = runs[0].1.clone();
        let of_payload =
            |value: fn(&Identification) -> f64| median(runs.iter().map(|(_, found)| value(found)));
        typical.payload.mass_kg = of_payload(|found| found.payload.mass_kg);
        typical.payload.centre_m = of_payload(|found| found.payload.centre_m);
        for joint in 0..JOINT_COUNT {
            let all = || runs.iter().map(|(_, found)| &found.joints[joint]);
            let of = |value: fn(&super::JointInformation) -> Option<f64>| {
                let known: Option<Vec<f64>> = all().map(value).collect();
                known.map(|values| median(values.into_iter()))
            };
            let each = &mut typical.joints[joint];
            each.rotor_kgm2 = median(all().map(|found| found.rotor_kgm2));
            each.torque_constant_share = of(|found| found.torque_constant_share);
            each.coulomb_nm = of(|found| found.coulomb_nm);
            each.viscous_nms_rad = of(|found| found.viscous_nms_rad);
            each.gravity_nm = [0, 1].map(|end| median(all().map(|found| found.gravity_nm[end])));
        }
        let condition = of_calibration(|found| found.condition.unwrap_or(f64::INFINITY));
        let calibration = CalibrationInformation {
            condition: condition.is_finite().then_some(condition),
            flange_rms_m: of_calibration(|found| found.flange_rms_m),
            flange_worst_m: of_calibration(|found| found.flange_worst_m),
        };
        (calibration, typical)
    }
}

/// Median; of an even number the upper middle value.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    upper_median(&mut values.collect::<Vec<_>>())
}

/// The candidate that tells most beyond what is known, of those that are not chosen.
fn best_of(candidates: &[Joints], chosen: &[usize], known: &Telling<'_>) -> usize {
    let gains = (0..candidates.len())
        .filter(|at| !chosen.contains(at))
        .map(|at| (at, known.gain(&candidates[at])));
    gains
        .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
        .map_or(0, |(at, _)| at)
}

/// What a set of postures tells.
struct Telling<'a> {
    calibration: Calibration<'a>,
    arm: &'a Dynamics,
    /// By joint: of a torque's scale and of its offset.
    gravity: [Matrix2<f64>; JOINT_COUNT],
}

impl<'a> Telling<'a> {
    fn new(chain: &'a needlebench_kinematics::Chain, arm: &'a Dynamics) -> Self {
        Self {
            calibration: Calibration::new(chain),
            arm,
            gravity: [Matrix2::identity(); JOINT_COUNT],
        }
    }

    /// A posture's torques of gravity, by joint: over the noise, and one.
    fn rows(&self, q: &Joints) -> [Vector2<f64>; JOINT_COUNT] {
        let torque = self.arm.gravity_torque(q);
        std::array::from_fn(|joint| Vector2::new(torque[joint] / GRAVITY_NOISE_NM, 1.0))
    }

    fn gain(&self, q: &Joints) -> f64 {
        let rows = self.rows(q);
        let gravity: f64 = rows
            .iter()
            .zip(&self.gravity)
            .map(|(row, known)| {
                let inverse = known.try_inverse().unwrap_or_else(Matrix2::identity);
                libm::log(1.0 + row.dot(&(inverse * row)))
            })
            .sum();
        self.calibration.gain(q) + gravity
    }

    fn add(&mut self, q: &Joints) {
        self.calibration.add(q);
        let rows = self.rows(q);
        for (known, row) in self.gravity.iter_mut().zip(rows) {
            *known += row * row.transpose();
        }
    }
}

/// The additive recurrence of the generalised golden ratio in six dimensions (Roberts 2018), from a seeded place: evenly
/// spread however many are drawn.
struct Kronecker {
    at: [f64; JOINT_COUNT],
    step: [f64; JOINT_COUNT],
}

impl Kronecker {
    fn new(seed: u64) -> Self {
        // The positive root of x^7 = x + 1.
        const RATIO: f64 = 1.112_775_684_278_705_5;
        let mut random = SplitMix64::new(seed);
        let mut share = 1.0;
        Self {
            at: std::array::from_fn(|_| random.uniform(0.0, 1.0)),
            step: std::array::from_fn(|_| {
                share /= RATIO;
                share
            }),
        }
    }

    fn next(&mut self) -> [f64; JOINT_COUNT] {
        for (at, step) in self.at.iter_mut().zip(self.step) {
            *at = (*at + step).fract();
        }
        self.at
    }
}
