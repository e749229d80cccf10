//! An excitation run: its motions, their certified clearances, the search for its postures, and what can be identified
//! from its log.

mod information;
mod search;

use needlebench_cell::{Cell, ClearanceClass};
use needlebench_clearance::{CertificateOptions, ClearanceModel, MotionCertificate, certify};
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase};
use needlebench_kinematics::{JOINT_LABELS, Joints};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::excitation::ExcitationProtocol;
use std::borrow::Cow;

use crate::rejection::distance_in_words;

pub use information::{
    CalibrationInformation, IDENTIFIED_SHARE, Identification, JointInformation, NOISE, Noise,
    PayloadInformation,
};
pub use search::{FoundRun, SearchError, SearchOptions, search};

/// Time for which a joint stands where a sweep turns, s. Assumed: a few rows of any log.
pub(crate) const TURN_S: f64 = 0.3;

/// What a motion of the run leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// A posture, counted from 1.
    Posture(usize),
    /// The start posture, at the end.
    Start,
    /// Where a sweep turns: the joint and its posture.
    Turn {
        /// The joint, from 0.
        joint: usize,
        /// The posture that it is swept at.
        posture: usize,
    },
    /// Back from there.
    Back {
        /// The joint, from 0.
        joint: usize,
        /// The posture that it is swept at.
        posture: usize,
    },
}

impl Aim {
    /// In words, for reports.
    pub fn in_words(self) -> String {
        let place = |posture: usize| match posture {
            0 => "start".to_owned(),
            number => number.to_string(),
        };
        match self {
            Self::Posture(number) => format!("to posture {number}"),
            Self::Start => "back to start".to_owned(),
            Self::Turn { joint, posture } => {
                format!("{} sweep at {}", JOINT_LABELS[joint], place(posture))
            }
            Self::Back { joint, posture } => {
                format!("{} back at {}", JOINT_LABELS[joint], place(posture))
            }
        }
    }
}

/// One joint-space line and the stand after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// What it leads to.
    pub aim: Aim,
    /// Where it starts, rad.
    pub from: Joints,
    /// Where it ends, rad.
    pub to: Joints,
    /// Speed of the leading joint, rad/s.
    pub speed_rad_s: f64,
    /// When it starts, s.
    pub departure_s: f64,
    /// When it ends, s.
    pub arrival_s: f64,
    /// Stand after it, s.
    pub stand_s: f64,
}

/// A motion with its certified clearances.
#[derive(Debug, Clone, PartialEq)]
pub struct CertifiedMotion {
    /// Which: a sweep once for all its speeds and both ways, since the path is the same.
    pub aim: Aim,
    /// Least clearances by class.
    pub certificate: MotionCertificate,
}

/// The run as a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcitationPlan {
    /// From the start posture to the start posture.
    pub trajectory: JointTrajectory,
    /// Its motions, in the order of time.
    pub legs: Vec<Leg>,
    /// The different paths of its motions, certified.
    pub motions: Vec<CertifiedMotion>,
    /// All of them together.
    pub certificate: MotionCertificate,
}

/// Why a run cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExcitationError {
    /// A motion comes nearer to something than the section allows.
    #[error(
        "{motion}: {} (certified {proven_mm:.1} mm), clearance {limit_mm:.1} mm required",
        distance_in_words(.a, .b, *.distance_mm)
    )]
    Clearance {
        /// The motion.
        motion: String,
        /// Number of the posture that it leads to or is made at; 0 for the start posture.
        posture: usize,
        /// One solid.
        a: String,
        /// The other one.
        b: String,
        /// Their least distance that was found, mm; negative inside.
        distance_mm: f64,
        /// Certified lower bound, mm.
        proven_mm: f64,
        /// Least that is allowed, mm.
        limit_mm: f64,
    },
}

impl ExcitationError {
    /// How the scenario can be mended.
    pub fn hint(&self) -> &'static str {
        "change, reorder or remove the posture, lower `clearance_mm` or `self_clearance_mm`, or \
         plan postures with `needlebench record-plan`"
    }

    /// The key that it is about.
    pub fn key(&self) -> String {
        match self {
            Self::Clearance { posture: 0, .. } => "excitation.postures_deg".to_owned(),
            Self::Clearance { posture, .. } => {
                format!("excitation.postures_deg[{}]", posture - 1)
            }
        }
    }
}

/// Required clearance of a class in a run, m.
pub fn least_m(protocol: &ExcitationProtocol, class: ClearanceClass) -> f64 {
    match class {
        ClearanceClass::SelfCollision => protocol.self_clearance_m,
        _ if class.is_physical() => protocol.clearance_m,
        _ => f64::NEG_INFINITY,
    }
}

/// Plans and certifies the run of a scenario.
///
/// # Errors
/// The first motion whose certified clearance is below the required one.
pub fn plan_excitation(
    resolved: &ResolvedScenario,
    protocol: &ExcitationProtocol,
    model: &ClearanceModel,
) -> Result<ExcitationPlan, ExcitationError> {
    let (trajectory, legs) = legs(protocol, &resolved.start, &resolved.motion);
    let tolerance_m = resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
    let mut motions: Vec<CertifiedMotion> = Vec::new();
    for leg in &legs {
        // Back along a path that is certified, and once more at another speed.
        let is_known = match leg.aim {
            Aim::Back { .. } => true,
            Aim::Turn { .. } => legs
                .iter()
                .take_while(|other| other.departure_s < leg.departure_s)
                .any(|other| other.aim == leg.aim && other.to == leg.to),
            Aim::Posture(_) | Aim::Start => false,
        };
        if is_known {
            continue;
        }
        let certificate = certified(model, &leg.from, &leg.to, tolerance_m);
        check(&resolved.cell, protocol, leg, &certificate)?;
        motions.push(CertifiedMotion {
            aim: leg.aim,
            certificate: certificate.later_by(leg.departure_s),
        });
    }
    let mut all = motions.iter().map(|motion| motion.certificate.clone());
    let first = all.next().expect("a run has the motion back to its start");
    Ok(ExcitationPlan {
        trajectory,
        legs,
        certificate: all.fold(first, |whole, each| whole.and(&each)),
        motions,
    })
}

/// The certified clearances of the joint-space line between two postures. They are those of the path, at any speed
/// along it.
fn certified(
    model: &ClearanceModel,
    from: &Joints,
    to: &Joints,
    tolerance_m: f64,
) -> MotionCertificate {
    // Any limits do.
    const UNIT: f64 = 1.0;
    let limits = MotionLimits {
        velocity: Joints::repeat(UNIT),
        acceleration: Joints::repeat(UNIT),
        jerk: Joints::repeat(UNIT),
        line: needlebench_kinematics::trajectory::ProfileLimits {
            velocity: UNIT,
            acceleration: UNIT,
            jerk: UNIT,
        },
    };
    let motion =
        JointTrajectory::starting_at(*from).then_straight_to(Phase::Transfer, *to, &limits);
    let motion = if motion.duration_s() > 0.0 {
        motion
    } else {
        motion.then_hold(Phase::Transfer, UNIT)
    };
    let options = CertificateOptions {
        tolerance_m,
        ..CertificateOptions::default()
    };
    certify(model, &motion, &options)
}

fn check(
    cell: &Cell,
    protocol: &ExcitationProtocol,
    leg: &Leg,
    certificate: &MotionCertificate,
) -> Result<(), ExcitationError> {
    let lacking = certificate
        .iter()
        .map(|(class, found)| (found, least_m(protocol, class)))
        .filter(|(found, least_m)| found.lower_bound_m < *least_m)
        .min_by(|a, b| (a.0.lower_bound_m - a.1).total_cmp(&(b.0.lower_bound_m - b.1)));
    let Some((found, least_m)) = lacking else {
        return Ok(());
    };
    let [a, b] = found.attained.in_words(cell).map(Cow::into_owned);
    Err(ExcitationError::Clearance {
        motion: leg.aim.in_words(),
        posture: match leg.aim {
            Aim::Posture(number) => number,
            Aim::Start => protocol.postures.len(),
            Aim::Turn { posture, .. } | Aim::Back { posture, .. } => posture,
        },
        a,
        b,
        distance_mm: found.attained.separation.distance_m * 1e3,
        proven_mm: found.lower_bound_m * 1e3,
        limit_mm: least_m * 1e3,
    })
}

/// The run's motions in the order of time, and the trajectory that they make.
pub(crate) fn legs(
    protocol: &ExcitationProtocol,
    start: &Joints,
    motion: &MotionLimits,
) -> (JointTrajectory, Vec<Leg>) {
    let mut made = Making {
        trajectory: JointTrajectory::starting_at(*start),
        legs: Vec::new(),
        motion,
    };
    let speeds = &protocol.speeds_rad_s;
    made.sweeps(protocol, 0, start);
    for (index, posture) in protocol.postures.iter().enumerate() {
        let aim = Aim::Posture(index + 1);
        made.go(
            aim,
            *posture,
            speeds[index % speeds.len()],
            protocol.dwell_s,
        );
        made.sweeps(protocol, index + 1, start);
    }
    let speed = speeds[protocol.postures.len() % speeds.len()];
    made.go(Aim::Start, *start, speed, protocol.dwell_s);
    (made.trajectory, made.legs)
}

/// A run in the making.
struct Making<'a> {
    trajectory: JointTrajectory,
    legs: Vec<Leg>,
    motion: &'a MotionLimits,
}

impl Making<'_> {
    fn go(&mut self, aim: Aim, to: Joints, speed_rad_s: f64, stand_s: f64) {
        let from = self.trajectory.end();
        let departure_s = self.trajectory.duration_s();
        let limits = MotionLimits {
            velocity: Joints::repeat(speed_rad_s),
            ..*self.motion
        };
        let nothing = JointTrajectory::starting_at(from);
        let moved = std::mem::replace(&mut self.trajectory, nothing).then_straight_to(
            Phase::Transfer,
            to,
            &limits,
        );
        let arrival_s = moved.duration_s();
        self.trajectory = moved.then_hold(Phase::Hold, stand_s);
        self.legs.push(Leg {
            aim,
            from,
            to,
            speed_rad_s,
            departure_s,
            arrival_s,
            stand_s,
        });
    }

    /// The sweeps at a posture at which the arm stands.
    fn sweeps(&mut self, protocol: &ExcitationProtocol, posture: usize, start: &Joints) {
        for sweep in protocol
            .sweeps
            .iter()
            .filter(|each| each.posture == posture)
        {
            let here = protocol.posture(posture, start);
            let end = protocol.sweep_end(sweep, start);
            let joint = sweep.joint;
            for &speed in &protocol.sweep_speeds_rad_s {
                self.go(Aim::Turn { joint, posture }, end, speed, TURN_S);
                self.go(Aim::Back { joint, posture }, here, speed, TURN_S);
            }
        }
    }
}
