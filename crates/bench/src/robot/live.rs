//! The cycles of a program on the controller, with an arm in an engine that follows.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_cell::{Cell, pair_in_words};
use needlebench_controller::{ArmData, Command, Controller, Measured, NotAnArm, SetPoints};
use needlebench_engine::{LiveArm, PlantState, Reference};
use needlebench_evaluation::judged::ProgramEnd;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{Joints, Pose};
use needlebench_urscript::{Belief, End, Place, Program, Progress, Run, ScriptError};

use super::host::RobotHost;
use super::log::Log;

/// A stop takes less than this, s.
const LONGEST_STOP_S: f64 = 10.0;

/// Until when a program is run.
pub(super) struct Bounds<'a> {
    /// The longest time, s.
    pub longest_s: f64,
    /// What the end is then.
    pub end: ProgramEnd,
    /// Once the set-point has stood for this time, s, it is asked whether that is at a goal, if the run ends there.
    pub hold_s: Option<f64>,
    /// Whether the set-point is at a goal.
    pub is_at_goal: &'a dyn Fn(&Joints) -> bool,
    /// Set once the run is to be interrupted.
    pub cancel: &'a AtomicBool,
}

/// What a program left.
pub(super) struct Ran {
    pub set_points: SetPoints,
    /// Line of the move of each set-point.
    pub lines: Vec<usize>,
    pub belief: Belief,
    pub end: ProgramEnd,
    /// The end in words.
    pub detail: String,
    pub ended_s: f64,
    pub log: Log,
}

/// The record as what engines follow.
pub(super) struct Followed<'a>(pub &'a SetPoints);

impl Reference for Followed<'_> {
    fn sample(&self, time_s: f64) -> JointState {
        self.0.sample(time_s)
    }
}

/// A program on its way.
struct Running<'a> {
    cell: &'a Cell,
    controller: Controller,
    host: RobotHost,
    set_points: SetPoints,
    lines: Vec<usize>,
    touched: BTreeSet<(u32, u32)>,
    /// Cycles for which the set-point has stood.
    still: u64,
}

/// Runs a program on an arm in an engine that makes `steps` steps in each cycle.
///
/// # Errors
/// [`NotAnArm`] for a start outside the limits.
pub(super) fn run_program(
    program: Program,
    arm: &ArmData,
    (start, flange_from_tcp): (&Joints, Option<Pose>),
    (live, steps): (&mut LiveArm<'_>, usize),
    cell: &Cell,
    bounds: &Bounds<'_>,
) -> Result<Ran, NotAnArm> {
    let controller = Controller::new(arm, *start, true)?;
    let set_points = SetPoints::new(arm.period_s, *controller.set_point());
    let mut running = Running {
        cell,
        controller,
        host: RobotHost::new(arm, start, flange_from_tcp),
        set_points,
        lines: vec![1],
        touched: BTreeSet::new(),
        still: 0,
    };
    let (end, why) = running.run(Run::new(program), live, steps, bounds);
    let ended_s = running.controller.time_s();
    let line = why.as_ref().map_or(running.host.place, |why| why.0).line;
    let detail = end_in_words(end, why.as_ref());
    running.host.log.add(ended_s, Some(line), "end", &detail);
    if end != ProgramEnd::EngineFailed {
        running.come_to_rest(live, steps);
    }
    Ok(Ran {
        set_points: running.set_points,
        lines: running.lines,
        belief: running.host.belief,
        end,
        detail,
        ended_s,
        log: running.host.log,
    })
}

/// The end in words, with the reason and its place in the program.
fn end_in_words(end: ProgramEnd, why: Option<&(Place, String)>) -> String {
    let what = match end {
        ProgramEnd::Finished => "the program came to its end",
        ProgramEnd::Halted => "the program halted",
        ProgramEnd::AsAsked => "the program was ended as asked",
        ProgramEnd::Exception => "runtime exception",
        ProgramEnd::ProtectiveStop => "protective stop",
        ProgramEnd::TimeLimit => "the program had not ended",
        ProgramEnd::EngineFailed => "the engine could not carry on",
        ProgramEnd::Interrupted => "the run was interrupted",
    };
    match (end, why) {
        (_, None) => what.to_owned(),
        (ProgramEnd::AsAsked | ProgramEnd::TimeLimit, Some((_, why))) => format!("{what} {why}"),
        (_, Some((place, why))) => format!("{what} at {place}: {why}"),
    }
}

type Why = Option<(Place, String)>;

impl Running<'_> {
    fn run(
        &mut self,
        mut run: Run,
        live: &mut LiveArm<'_>,
        steps: usize,
        bounds: &Bounds<'_>,
    ) -> (ProgramEnd, Why) {
        let period_s = self.set_points.period_s();
        self.host.ask(Command::Play);
        loop {
            self.host.see(live.state(), &self.controller);
            let ended = match run.step(&mut self.host) {
                Progress::Running => None,
                Progress::Ended(end) => Some(end),
            };
            let tripped = match self.cycle(live, steps) {
                Ok(tripped) => tripped,
                Err(why) => return (ProgramEnd::EngineFailed, Some((self.host.place, why))),
            };
            if let Some(end) = ended.or(tripped) {
                return self.ended(end);
            }
            if bounds.cancel.load(Ordering::Relaxed) {
                return (ProgramEnd::Interrupted, None);
            }
            if let Some(hold_s) = bounds.hold_s {
                let has_stood = self.still as f64 * period_s >= hold_s;
                let at = self.controller.set_point().position;
                if has_stood && (bounds.is_at_goal)(&at) {
                    return (ProgramEnd::AsAsked, None);
                }
                if has_stood {
                    // Asked once for each stand.
                    self.still = 0;
                }
            }
            if self.set_points.end_s() >= bounds.longest_s {
                let why = format!("after {} s", bounds.longest_s);
                return (bounds.end, Some((self.host.place, why)));
            }
        }
    }

    fn ended(&self, end: End) -> (ProgramEnd, Why) {
        match end {
            End::Finished => (ProgramEnd::Finished, None),
            End::Halted => (ProgramEnd::Halted, None),
            End::ProtectiveStop(why) => (ProgramEnd::ProtectiveStop, Some((self.host.place, why))),
            End::Exception(ScriptError { place, message, .. }) => {
                (ProgramEnd::Exception, Some((place, message)))
            }
        }
    }

    /// One cycle of the controller, and the steps of the engine in it. Gives how the controller ended the program, if it
    /// did.
    fn cycle(&mut self, live: &mut LiveArm<'_>, steps: usize) -> Result<Option<End>, String> {
        let measured = Measured {
            position: live.state().position,
            wall_s: f64::NAN,
        };
        let requests = std::mem::take(&mut self.host.requests);
        let before = self.set_points.end_s();
        let cycle = self.controller.cycle(&measured, &requests);
        self.set_points.push(cycle.set_point);
        self.lines.push(self.host.place.line);
        let stands = self.controller.is_steady();
        self.still = if stands { self.still + 1 } else { 0 };
        let ended = self.host.hear(&cycle.events, before);
        for _ in 0..steps {
            let state = live
                .step(&Followed(&self.set_points))
                .map_err(|error| error.to_string())?;
            touch(self.cell, state, &mut self.touched, &mut self.host, before);
        }
        Ok(ended)
    }

    /// The program has ended: the controller stops what still moves.
    fn come_to_rest(&mut self, live: &mut LiveArm<'_>, steps: usize) {
        let until_s = self.set_points.end_s() + LONGEST_STOP_S;
        self.host.requests.clear();
        self.host.ask(Command::Stop);
        loop {
            // Whether the engine carries on is of no further use to the program.
            let _ = self.cycle(live, steps);
            if self.controller.is_steady() || self.set_points.end_s() >= until_s {
                return;
            }
        }
    }
}

/// Notes the first contact of two bodies.
fn touch(
    cell: &Cell,
    state: &PlantState,
    touched: &mut BTreeSet<(u32, u32)>,
    host: &mut RobotHost,
    time_s: f64,
) {
    let Some(pair) = state.contact.pair.filter(|_| state.contact.count > 0) else {
        return;
    };
    if !touched.insert(pair) {
        return;
    }
    let name = |index: u32| {
        let body = cell.bodies.get(index as usize);
        body.map_or(String::new(), |body| body.name.clone())
    };
    let text = pair_in_words(&[name(pair.0), name(pair.1)]);
    host.log
        .add(time_s, Some(host.place.line), "contact", &text);
}
