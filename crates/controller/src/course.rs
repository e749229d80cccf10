//! One move from rest to rest: how it goes along its way, and the joints there.

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use needlebench_kinematics::ik::{GaussNewtonOptions, Kinematics};
use needlebench_kinematics::trajectory::{DoubleS, JointState, ProfileLimits};
use needlebench_kinematics::{Joints, Pose, rotation_vector};
use needlebench_urscript::Pace;

/// Ways below this are none: m and rad.
const NO_WAY: f64 = 1e-9;

/// Translations below this lead no move that turns the tool, m.
const NO_TRANSLATION_M: f64 = 1e-6;

/// Largest joint step, rad, that the solution may be off what its neighbour predicts: beyond it is another branch.
const SAME_BRANCH_RAD: f64 = 0.2;

/// Sine of the angle at the begin of a circle below which its places lie on a line.
const LEAST_SINE: f64 = 1e-6;

/// Sums of periods are rounded; a move goes less than 1e-20 m or rad in this time before its end.
const ROUNDING_S: f64 = 1e-9;

/// Longest move, s.
const LONGEST_S: f64 = 86_400.0;

/// Near a solution three steps do; a line that ends shall not take the time of a hundred cycles.
const INVERSE: GaussNewtonOptions = GaussNewtonOptions {
    max_iterations: 30,
    max_time: None,
    tolerance: 1e-9,
    rank_tolerance: 1e-9,
    step: needlebench_kinematics::ik::GaussNewtonStep::Regularised,
};

/// Why a way has no course.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NoCourse {
    /// Begin, place between and end lie on no circle.
    NoCircle,
    /// Acceleration, speed or time are too large or too small.
    Pace,
}

/// No joint positions near the guess have the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NoSolution;

/// A move.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Course {
    way: Way,
    profile: DoubleS,
    /// Length of the profile, rad or m.
    length: f64,
    pub start: Joints,
}

#[derive(Debug, Clone, PartialEq)]
enum Way {
    /// All joints together.
    Joints { delta: Joints },
    /// The tool's point along a line or a circle, turning about one axis.
    Tool(Box<ToolWay>),
}

impl Course {
    /// All joints from one posture to another; none where they are the same.
    pub fn joints(
        start: Joints,
        end: Joints,
        pace: &Pace,
        ramp_s: f64,
    ) -> Result<Option<Self>, NoCourse> {
        let delta = end - start;
        let length = delta.amax();
        if length < NO_WAY {
            return Ok(None);
        }
        Ok(Some(Self {
            way: Way::Joints { delta },
            profile: profile(length, pace, ramp_s)?,
            length,
            start,
        }))
    }

    /// The tool's point along a straight line, or along the circle through a place (in `base_link`), the tool turning
    /// evenly about one axis; none where nothing moves.
    pub fn tool(
        kinematics: &Kinematics,
        (start, flange_from_tcp): (Joints, &Pose),
        base_link_from_end: &Pose,
        via_m: Option<&Vector3<f64>>,
        (pace, ramp_s): (&Pace, f64),
    ) -> Result<Option<Self>, NoCourse> {
        let base_link_from_start = kinematics.base_link_from_flange(&start) * flange_from_tcp;
        let [start_m, end_m] =
            [&base_link_from_start, base_link_from_end].map(|pose| pose.translation.vector);
        let turn = base_link_from_end.rotation * base_link_from_start.rotation.inverse();
        let circle = match via_m {
            Some(via_m) => {
                Some(Circle::through(&start_m, via_m, &end_m).ok_or(NoCourse::NoCircle)?)
            }
            None => None,
        };
        let way = ToolWay {
            base_link_from_start,
            tcp_from_flange: flange_from_tcp.inverse(),
            delta_m: end_m - start_m,
            circle,
            turn_rad: rotation_vector(&turn),
        };
        let length = way.length();
        if length < NO_WAY {
            return Ok(None);
        }
        Ok(Some(Self {
            profile: profile(length, pace, ramp_s)?,
            way: Way::Tool(Box::new(way)),
            length,
            start,
        }))
    }

    /// From rest to rest, s.
    pub fn duration_s(&self) -> f64 {
        self.profile.duration_s()
    }

    /// Whether it stands from a time on.
    pub fn is_over(&self, time_s: f64) -> bool {
        time_s >= self.duration_s() - ROUNDING_S
    }

    /// Its highest acceleration over its highest speed, 1/s.
    pub fn quickness_per_s(&self) -> f64 {
        let (speed, acceleration) = self.profile.peaks();
        acceleration / speed
    }

    /// Joint positions at the end, where they are known before it is reached: rad.
    pub fn end(&self) -> Option<Joints> {
        match &self.way {
            Way::Joints { delta } => Some(self.start + delta),
            Way::Tool(_) => None,
        }
    }

    fn share(&self, time_s: f64) -> f64 {
        (self.profile.sample(time_s).position / self.length).clamp(0.0, 1.0)
    }

    /// The tool's point at a time of the move, in `base_link`, m.
    pub fn tcp_m(
        &self,
        kinematics: &Kinematics,
        flange_from_tcp: &Pose,
        time_s: f64,
    ) -> Vector3<f64> {
        let share = self.share(time_s);
        match &self.way {
            Way::Joints { delta } => {
                let flange = kinematics.base_link_from_flange(&(self.start + delta * share));
                (flange * flange_from_tcp).translation.vector
            }
            Way::Tool(way) => way.place(share)[0],
        }
    }

    /// State at a time of the move, at rest outside it. Of a tool's way the joints nearest to a guess.
    pub fn state(
        &self,
        kinematics: &Kinematics,
        time_s: f64,
        guess: &Joints,
    ) -> Result<JointState, NoSolution> {
        if time_s <= 0.0 {
            return Ok(JointState::at_rest(self.start));
        }
        let along = self.profile.sample(time_s);
        let share = (along.position / self.length).clamp(0.0, 1.0);
        let is_over = self.is_over(time_s);
        let [share, speed, acceleration] = if is_over {
            [1.0, 0.0, 0.0]
        } else {
            [
                share,
                along.velocity / self.length,
                along.acceleration / self.length,
            ]
        };
        match &self.way {
            Way::Joints { delta } => Ok(JointState {
                position: self.start + delta * share,
                velocity: delta * speed,
                acceleration: delta * acceleration,
            }),
            Way::Tool(way) => {
                let flange = way.base_link_from_tcp(share) * way.tcp_from_flange;
                let joints = joints_near(kinematics, &flange, guess)?;
                if is_over {
                    return Ok(JointState::at_rest(joints));
                }
                let [_, along, curving] = way.place(share);
                let lever_m = flange.translation.vector - way.place(share)[0];
                let [first, second] = joint_rates(
                    kinematics,
                    &joints,
                    &lever_m,
                    &stacked(&along, &way.turn_rad),
                    &stacked(&curving, &Vector3::zeros()),
                )?;
                Ok(JointState {
                    position: joints,
                    velocity: first * speed,
                    acceleration: second * speed.powi(2) + first * acceleration,
                })
            }
        }
    }
}

/// Joint positions near a guess that bring the flange to a pose in `base_link`.
pub(crate) fn joints_near(
    kinematics: &Kinematics,
    base_link_from_flange: &Pose,
    guess: &Joints,
) -> Result<Joints, NoSolution> {
    let numerical = kinematics.numerical();
    let solved = numerical.gauss_newton(base_link_from_flange, guess, &INVERSE);
    if solved.converged && (solved.joints - guess).amax() <= SAME_BRANCH_RAD {
        Ok(solved.joints)
    } else {
        Err(NoSolution)
    }
}

/// Joint velocities and accelerations for the velocity of the tool's point and the tool's rotation, and for their
/// change; `lever_m` leads from the tool's point to the flange. All in `base_link`.
///
/// The flange is at `p + R c` with `c` fixed in the tool: `x' = p' + w x l`, `x'' = p'' + w' x l + w x (w x l)`, and
/// `x'' = J q'' + J' q'`.
pub(crate) fn joint_rates(
    kinematics: &Kinematics,
    joints: &Joints,
    lever_m: &Vector3<f64>,
    twist: &Vector6<f64>,
    twist_rate: &Vector6<f64>,
) -> Result<[Joints; 2], NoSolution> {
    let chain = &kinematics.chain;
    let [turning, turning_rate] =
        [twist, twist_rate].map(|twist| twist.fixed_rows::<3>(3).into_owned());
    let swing = turning.cross(lever_m);
    let mut of_flange = *twist;
    let mut linear = of_flange.fixed_rows_mut::<3>(0);
    linear += swing;
    let mut rate_of_flange = *twist_rate;
    let mut linear = rate_of_flange.fixed_rows_mut::<3>(0);
    linear += turning_rate.cross(lever_m) + turning.cross(&swing);
    let lu = chain.jacobian(joints).lu();
    let first = lu.solve(&of_flange).ok_or(NoSolution)?;
    let bias = chain.flange_bias_acceleration(joints, &first);
    let second = lu.solve(&(rate_of_flange - bias)).ok_or(NoSolution)?;
    Ok([first, second])
}

pub(crate) fn stacked(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

/// The course over a length: ramped up to the acceleration, and down again. With a time, a third of it each for
/// acceleration, constant speed and deceleration (assumed).
fn profile(length: f64, pace: &Pace, ramp_s: f64) -> Result<DoubleS, NoCourse> {
    let limits = match pace.time_s {
        None => ProfileLimits {
            velocity: pace.speed,
            acceleration: pace.acceleration,
            jerk: pace.acceleration / ramp_s,
        },
        Some(time_s) => {
            let accelerating_s = time_s / 3.0;
            let ramp_s = ramp_s.min(0.5 * accelerating_s);
            let velocity = length / (time_s - accelerating_s);
            let acceleration = velocity / (accelerating_s - ramp_s);
            ProfileLimits {
                velocity,
                acceleration,
                jerk: acceleration / ramp_s,
            }
        }
    };
    let found = DoubleS::new(length, &limits);
    let duration_s = found.duration_s();
    if duration_s > 0.0 && duration_s <= LONGEST_S {
        Ok(found)
    } else {
        Err(NoCourse::Pace)
    }
}

/// The tool's point along a straight line, or a circle.
#[derive(Debug, Clone, PartialEq)]
struct ToolWay {
    base_link_from_start: Pose,
    tcp_from_flange: Pose,
    /// From start to end, m.
    delta_m: Vector3<f64>,
    circle: Option<Circle>,
    /// Axis times angle, in `base_link`, rad.
    turn_rad: Vector3<f64>,
}

impl ToolWay {
    /// What leads: the translation, or the rotation where there is none.
    fn length(&self) -> f64 {
        let way_m = match &self.circle {
            Some(circle) => circle.angle_rad * circle.u_m.norm(),
            None => self.delta_m.norm(),
        };
        if way_m >= NO_TRANSLATION_M {
            way_m
        } else {
            self.turn_rad.norm()
        }
    }

    fn base_link_from_tcp(&self, share: f64) -> Pose {
        let turn = UnitQuaternion::from_scaled_axis(self.turn_rad * share);
        let [place, ..] = self.place(share);
        Pose::from_parts(place.into(), turn * self.base_link_from_start.rotation)
    }

    /// Place of the tool's point at a share of the way, with its first and second derivative by it.
    fn place(&self, share: f64) -> [Vector3<f64>; 3] {
        if let Some(circle) = &self.circle {
            return circle.at(share);
        }
        let start = self.base_link_from_start.translation.vector;
        [start + self.delta_m * share, self.delta_m, Vector3::zeros()]
    }
}

/// A circle's arc: `centre + u cos(angle share) + w sin(angle share)`.
#[derive(Debug, Clone, PartialEq)]
struct Circle {
    centre_m: Vector3<f64>,
    u_m: Vector3<f64>,
    w_m: Vector3<f64>,
    angle_rad: f64,
}

impl Circle {
    /// The arc from one place through another to a third; none where they lie on a line.
    fn through(start: &Vector3<f64>, via: &Vector3<f64>, end: &Vector3<f64>) -> Option<Self> {
        // The centre of the circle about a triangle, from one of its corners.
        let (a, b) = (via - start, end - start);
        let normal = a.cross(&b);
        let doubled = normal.norm_squared();
        let sine = normal.norm() / (a.norm() * b.norm());
        if sine.is_nan() || sine < LEAST_SINE {
            return None;
        }
        let to_centre =
            (b * a.norm_squared() - a * b.norm_squared()).cross(&normal) / (2.0 * doubled);
        let centre_m = start + to_centre;
        let u_m = -to_centre;
        let w_m = normal.normalize().cross(&u_m);
        let at_end = end - centre_m;
        let angle = libm::atan2(at_end.dot(&w_m), at_end.dot(&u_m));
        Some(Self {
            centre_m,
            u_m,
            w_m,
            angle_rad: angle.rem_euclid(std::f64::consts::TAU),
        })
    }

    /// Place at a share of the arc, with its first and second derivative by it.
    fn at(&self, share: f64) -> [Vector3<f64>; 3] {
        let (sin, cos) = libm::sincos(self.angle_rad * share);
        let from_centre = self.u_m * cos + self.w_m * sin;
        let along = self.w_m * cos - self.u_m * sin;
        [
            self.centre_m + from_centre,
            along * self.angle_rad,
            from_centre * -self.angle_rad.powi(2),
        ]
    }
}
