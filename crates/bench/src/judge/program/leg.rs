//! One move of a program from rest to rest.

use nalgebra::{Rotation3, UnitQuaternion, Vector3, Vector6};
use needlebench_kinematics::ik::{GaussNewtonOptions, Kinematics};
use needlebench_kinematics::trajectory::{DoubleS, JointState, ProfileLimits};
use needlebench_kinematics::{Joints, Pose, rotation_vector};
use needlebench_urscript::Pace;

/// Time in which the controller reaches a full acceleration, s: of a UR3e's `movej` in a recorded run 0.12 to 0.16 s.
pub(super) const RAMP_S: f64 = 0.14;

/// Ways below this are none: m and rad.
const NO_WAY: f64 = 1e-9;

/// Translations below this lead no move that turns the tool, m.
pub(super) const NO_TRANSLATION_M: f64 = 1e-6;

/// Places at which a tool line is solved beforehand: so far apart at most (m, rad), and so many at least.
const STEP_M: f64 = 5e-3;
const STEP_RAD: f64 = 0.03;
const LEAST_STEPS: f64 = 32.0;

/// Most of these places: what needs more is longer than any arm.
const MOST_STEPS: f64 = 4000.0;

/// Smallest singular value of the flange Jacobian (lengths over 0.5 m) that a tool line may pass.
const LEAST_SINGULAR_VALUE: f64 = 1e-4;

/// Largest joint step, rad, that the solution may be off what its neighbour predicts: beyond it is another branch.
const SAME_BRANCH_RAD: f64 = 0.2;

/// A move.
#[derive(Debug)]
pub(super) struct Leg {
    way: Way,
    profile: DoubleS,
    /// Length of the profile, rad or m; the way's fraction is that of it.
    length: f64,
    pub start: Joints,
    pub end: Joints,
}

#[derive(Debug)]
enum Way {
    /// All joints together.
    Joints { delta: Joints },
    /// The tool's point along a line, turning about one axis.
    Tool(Box<ToolLine>),
}

/// Why a tool line has no joint motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum NoLine {
    /// The pose at a share of the way is out of reach.
    OutOfReach(f64),
    /// The joints would have to jump to another branch there, or pass a singularity.
    Jump(f64),
    /// Begin, place between and end lie on no circle.
    NoCircle,
    /// Acceleration, speed or time are too large or too small for a course.
    Pace,
}

impl Leg {
    /// All joints from one posture to another; none where they are the same.
    ///
    /// # Errors
    /// [`NoLine::Pace`].
    pub fn joints(start: Joints, end: Joints, pace: &Pace) -> Result<Option<Self>, NoLine> {
        let delta = end - start;
        let length = delta.amax();
        if length < NO_WAY {
            return Ok(None);
        }
        Ok(Some(Self {
            way: Way::Joints { delta },
            profile: profile(length, pace)?,
            length,
            start,
            end,
        }))
    }

    /// The tool's point along a straight line, or along the circle through a place (in `base_link`), the tool turning
    /// evenly about one axis; none where nothing moves.
    ///
    /// # Errors
    /// [`NoLine`].
    pub fn line(
        kinematics: &Kinematics,
        start: Joints,
        flange_from_tcp: &Pose,
        base_link_from_end: &Pose,
        via_m: Option<&Vector3<f64>>,
        pace: &Pace,
    ) -> Result<Option<Self>, NoLine> {
        let mut line = ToolLine::new(kinematics, &start, flange_from_tcp, base_link_from_end);
        if let Some(via_m) = via_m {
            let start_m = line.base_link_from_start.translation.vector;
            let end_m = base_link_from_end.translation.vector;
            line.circle = Some(Circle::through(&start_m, via_m, &end_m).ok_or(NoLine::NoCircle)?);
        }
        let length = line.length();
        if length < NO_WAY {
            return Ok(None);
        }
        let profile = profile(length, pace)?;
        let line = line.solved(kinematics, &start)?;
        let end = line.solutions.last().map_or(start, |last| last.joints);
        Ok(Some(Self {
            way: Way::Tool(Box::new(line)),
            profile,
            length,
            start,
            end,
        }))
    }

    /// From rest to rest, s.
    pub fn duration_s(&self) -> f64 {
        self.profile.duration_s()
    }

    /// State at a time of the move; at rest outside it.
    ///
    /// # Errors
    /// [`NoLine`].
    pub fn state(&self, kinematics: &Kinematics, time_s: f64) -> Result<JointState, NoLine> {
        if time_s <= 0.0 {
            return Ok(JointState::at_rest(self.start));
        }
        if time_s >= self.duration_s() {
            return Ok(JointState::at_rest(self.end));
        }
        let along = self.profile.sample(time_s);
        let share = (along.position / self.length).clamp(0.0, 1.0);
        let (speed, acceleration) = (
            along.velocity / self.length,
            along.acceleration / self.length,
        );
        Ok(match &self.way {
            Way::Joints { delta } => JointState {
                position: self.start + delta * share,
                velocity: delta * speed,
                acceleration: delta * acceleration,
            },
            Way::Tool(line) => {
                let solution = line.solve_near(kinematics, share)?;
                JointState {
                    position: solution.joints,
                    velocity: solution.first * speed,
                    acceleration: solution.second * speed.powi(2) + solution.first * acceleration,
                }
            }
        })
    }
}

/// The course over a length: ramped up to the acceleration, and down again. With a time, a third of it each for
/// acceleration, constant speed and deceleration (assumed).
fn profile(length: f64, pace: &Pace) -> Result<DoubleS, NoLine> {
    let limits = match pace.time_s {
        None => ProfileLimits {
            velocity: pace.speed,
            acceleration: pace.acceleration,
            jerk: pace.acceleration / RAMP_S,
        },
        Some(time_s) => {
            let accelerating_s = time_s / 3.0;
            let ramp_s = RAMP_S.min(0.5 * accelerating_s);
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
    if duration_s.is_finite() && duration_s > 0.0 {
        Ok(found)
    } else {
        Err(NoLine::Pace)
    }
}

/// A circle's arc: `centre + u cos(angle share) + w sin(angle share)`.
#[derive(Debug)]
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

/// Sine of the angle at the begin of a circle below which its places lie on a line.
const LEAST_SINE: f64 = 1e-6;

/// The tool's point along a straight line, or a circle.
#[derive(Debug)]
struct ToolLine {
    /// In `base_link`.
    base_link_from_start: Pose,
    tcp_from_flange: Pose,
    /// From start to end, m.
    delta_m: Vector3<f64>,
    circle: Option<Circle>,
    /// Axis times angle, in `base_link`, rad.
    turn_rad: Vector3<f64>,
    /// At even shares of the way.
    solutions: Vec<OnLine>,
}

/// Joint positions at a share of a way, with their derivatives by it.
#[derive(Debug, Clone, Copy)]
struct OnLine {
    joints: Joints,
    first: Joints,
    second: Joints,
}

impl ToolLine {
    fn new(
        kinematics: &Kinematics,
        start: &Joints,
        flange_from_tcp: &Pose,
        base_link_from_end: &Pose,
    ) -> Self {
        let base_link_from_start = kinematics.base_link_from_flange(start) * flange_from_tcp;
        let turn = base_link_from_end.rotation * base_link_from_start.rotation.inverse();
        Self {
            base_link_from_start,
            tcp_from_flange: flange_from_tcp.inverse(),
            delta_m: base_link_from_end.translation.vector
                - base_link_from_start.translation.vector,
            circle: None,
            turn_rad: rotation_vector(&turn),
            solutions: Vec::new(),
        }
    }

    /// What leads: the translation, or the rotation where there is none.
    fn length(&self) -> f64 {
        let way_m = self.way_m();
        if way_m >= NO_TRANSLATION_M {
            way_m
        } else {
            self.turn_rad.norm()
        }
    }

    fn way_m(&self) -> f64 {
        match &self.circle {
            Some(circle) => circle.angle_rad * circle.u_m.norm(),
            None => self.delta_m.norm(),
        }
    }

    fn solved(mut self, kinematics: &Kinematics, start: &Joints) -> Result<Self, NoLine> {
        let steps = (self.way_m() / STEP_M).max(self.turn_rad.norm() / STEP_RAD);
        let steps = steps.ceil().max(LEAST_STEPS);
        if steps.is_nan() || steps > MOST_STEPS {
            return Err(NoLine::OutOfReach(0.0));
        }
        let mut last = self.derivatives(kinematics, start, 0.0)?;
        self.solutions.push(last);
        let mut step = 1.0;
        while step <= steps {
            let share = step / steps;
            let guess = last.joints + last.first / steps + last.second * (0.5 / steps.powi(2));
            last = self.solve(kinematics, &guess, share)?;
            self.solutions.push(last);
            step += 1.0;
        }
        Ok(self)
    }

    fn solve_near(&self, kinematics: &Kinematics, share: f64) -> Result<OnLine, NoLine> {
        let intervals = (self.solutions.len() - 1) as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share from 0 to 1 of some thousand places"
        )]
        let index = ((share * intervals).round() as usize).min(self.solutions.len() - 1);
        let near = &self.solutions[index];
        let ahead = share - index as f64 / intervals;
        let guess = near.joints + near.first * ahead + near.second * (0.5 * ahead * ahead);
        self.solve(kinematics, &guess, share)
    }

    fn solve(&self, kinematics: &Kinematics, guess: &Joints, share: f64) -> Result<OnLine, NoLine> {
        let flange = self.base_link_from_tcp(share) * self.tcp_from_flange;
        let options = GaussNewtonOptions::default();
        let solved = kinematics
            .numerical()
            .gauss_newton(&flange, guess, &options);
        if !solved.converged {
            return Err(NoLine::OutOfReach(share));
        }
        if (solved.joints - guess).amax() > SAME_BRANCH_RAD {
            return Err(NoLine::Jump(share));
        }
        self.derivatives(kinematics, &solved.joints, share)
    }

    fn base_link_from_tcp(&self, share: f64) -> Pose {
        let start = &self.base_link_from_start;
        let turn = UnitQuaternion::from_scaled_axis(self.turn_rad * share);
        let [place, ..] = self.place(share);
        Pose::from_parts(place.into(), turn * start.rotation)
    }

    /// Place of the tool's point at a share of the way, with its first and second derivative by it.
    fn place(&self, share: f64) -> [Vector3<f64>; 3] {
        if let Some(circle) = &self.circle {
            return circle.at(share);
        }
        let start = self.base_link_from_start.translation.vector;
        [start + self.delta_m * share, self.delta_m, Vector3::zeros()]
    }

    /// The flange is at `p + R c`, with `c` fixed in the tool and `R` turning about a fixed axis.
    fn derivatives(
        &self,
        kinematics: &Kinematics,
        joints: &Joints,
        share: f64,
    ) -> Result<OnLine, NoLine> {
        const CHARACTERISTIC_LENGTH_M: f64 = 0.5;
        let rotation: Rotation3<f64> = self.base_link_from_tcp(share).rotation.into();
        let lever_m = rotation * self.tcp_from_flange.translation.vector;
        let turning = self.turn_rad.cross(&lever_m);
        let [_, along, curving] = self.place(share);
        let linear = along + turning;
        let twist = stacked(&linear, &self.turn_rad);
        let bending = stacked(
            &(curving + self.turn_rad.cross(&turning)),
            &Vector3::zeros(),
        );

        let chain = &kinematics.chain;
        let jacobian = chain.jacobian(joints);
        let mut scaled = jacobian;
        scaled
            .fixed_rows_mut::<3>(0)
            .scale_mut(1.0 / CHARACTERISTIC_LENGTH_M);
        if scaled.singular_values().min() < LEAST_SINGULAR_VALUE {
            return Err(NoLine::Jump(share));
        }
        let lu = jacobian.lu();
        let solved = lu.solve(&twist).and_then(|first| {
            let bias = chain.flange_bias_acceleration(joints, &first);
            let second = lu.solve(&(bending - bias))?;
            Some(OnLine {
                joints: *joints,
                first,
                second,
            })
        });
        solved.ok_or(NoLine::Jump(share))
    }
}

fn stacked(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

#[cfg(test)]
mod tests {
    use needlebench_kinematics::{UrModel, rotation_angle_between};

    use super::*;

    fn kinematics() -> Kinematics {
        Kinematics::new(UrModel::Ur3e.geometry().chain()).unwrap()
    }

    fn start() -> Joints {
        Joints::from([0.1, -1.5, 1.2, -1.3, -1.4, 0.2])
    }

    fn pace(acceleration: f64, speed: f64) -> Pace {
        Pace {
            acceleration,
            speed,
            time_s: None,
        }
    }

    /// A hundred roundings of times of some seconds.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn durations_are_those_of_ramped_trapezoids() {
        let mut end = start();
        end[0] += 2.0;
        end[3] -= 0.7;
        // Way over speed, one acceleration, one ramp.
        let leg = Leg::joints(start(), end, &pace(1.4, 1.05))
            .unwrap()
            .unwrap();
        assert!((leg.duration_s() - (2.0 / 1.05 + 1.05 / 1.4 + RAMP_S)).abs() < ROUNDING);
        // Below full speed: the way is the acceleration times t (t - ramp), half of it each way.
        end = start();
        end[5] += 0.3;
        let leg = Leg::joints(start(), end, &pace(1.4, 1.05))
            .unwrap()
            .unwrap();
        let half_s = 0.5 * leg.duration_s();
        assert!((1.4 * half_s * (half_s - RAMP_S) - 0.3).abs() < ROUNDING);
        let timed = Pace {
            time_s: Some(2.5),
            ..pace(0.0, 0.0)
        };
        let leg = Leg::joints(start(), end, &timed).unwrap().unwrap();
        assert!((leg.duration_s() - 2.5).abs() < ROUNDING);
    }

    #[test]
    fn all_joints_go_together_and_the_leading_one_is_as_fast_as_it_may_be() {
        let mut end = start();
        end[0] += 2.0;
        end[3] -= 0.5;
        let leg = Leg::joints(start(), end, &pace(1.4, 1.05))
            .unwrap()
            .unwrap();
        let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
        for step in 0..=1000 {
            let time_s = leg.duration_s() * f64::from(step) / 1000.0;
            let state = leg.state(&kinematics(), time_s).unwrap();
            let [lead, other] = [0, 3].map(|joint| state.position[joint] - start()[joint]);
            assert!((other + 0.25 * lead).abs() < ROUNDING);
            fastest = fastest.max(state.velocity.amax());
            hardest = hardest.max(state.acceleration.amax());
        }
        assert!((fastest - 1.05).abs() < ROUNDING, "{fastest}");
        assert!((hardest - 1.4).abs() < ROUNDING, "{hardest}");
    }

    fn line(turn: Vector3<f64>, delta_m: Vector3<f64>) -> (Leg, Pose, Pose, Pose) {
        let kinematics = kinematics();
        let flange_from_tcp = Pose::new(
            Vector3::new(0.02, -0.03, 0.12),
            Vector3::new(0.3, 0.1, -0.2),
        );
        let from = kinematics.base_link_from_flange(&start()) * flange_from_tcp;
        let to = Pose::from_parts(
            (from.translation.vector + delta_m).into(),
            UnitQuaternion::from_scaled_axis(turn) * from.rotation,
        );
        let leg = Leg::line(
            &kinematics,
            start(),
            &flange_from_tcp,
            &to,
            None,
            &pace(1.2, 0.25),
        );
        (leg.unwrap().unwrap(), flange_from_tcp, from, to)
    }

    #[test]
    fn the_tools_point_goes_straight_at_its_speed_and_turns_about_one_axis() {
        let turn = Vector3::new(0.2, -0.3, 0.4);
        let delta_m = Vector3::new(0.05, -0.12, 0.06);
        let (leg, flange_from_tcp, from, to) = line(turn, delta_m);
        let kinematics = kinematics();
        let length_m = delta_m.norm();
        assert!((leg.duration_s() - (length_m / 0.25 + 0.25 / 1.2 + RAMP_S)).abs() < ROUNDING);
        let mut fastest = 0.0_f64;
        for step in 0..=200 {
            let time_s = leg.duration_s() * f64::from(step) / 200.0;
            let state = leg.state(&kinematics, time_s).unwrap();
            let found = kinematics.base_link_from_flange(&state.position) * flange_from_tcp;
            let way = found.translation.vector - from.translation.vector;
            let share = way.dot(&delta_m) / length_m.powi(2);
            // The residual of the solver, at the length of the tool.
            assert!((way - delta_m * share).norm() < 1e-10, "{way}");
            let expected = UnitQuaternion::from_scaled_axis(turn * share) * from.rotation;
            assert!(rotation_angle_between(&found.rotation, &expected) < 1e-9);
            let twist = kinematics
                .chain
                .jacobian_at(&state.position, &flange_from_tcp.translation.vector);
            let speed = (twist * state.velocity).fixed_rows::<3>(0).norm();
            fastest = fastest.max(speed);
        }
        assert!((fastest - 0.25).abs() < 1e-9, "{fastest}");
        let end = kinematics.base_link_from_flange(&leg.end) * flange_from_tcp;
        assert!((end.translation.vector - to.translation.vector).norm() < 1e-10);
    }

    /// Step of central differences, s: their truncation and the solver's residual over it are far below the bounds.
    const STEP_S: f64 = 1e-4;

    #[test]
    fn velocities_and_accelerations_are_the_derivatives_of_positions() {
        let (leg, ..) = line(
            Vector3::new(0.2, -0.3, 0.4),
            Vector3::new(0.05, -0.12, 0.06),
        );
        let kinematics = kinematics();
        for step in 1..40 {
            let time_s = leg.duration_s() * f64::from(step) / 40.0;
            let at = |offset_s: f64| leg.state(&kinematics, time_s + offset_s).unwrap();
            let (before, here, after) = (at(-STEP_S), at(0.0), at(STEP_S));
            let velocity = (after.position - before.position) / (2.0 * STEP_S);
            let acceleration = (after.velocity - before.velocity) / (2.0 * STEP_S);
            assert!((velocity - here.velocity).amax() < 1e-6);
            // The jerk jumps where a ramp ends.
            assert!((acceleration - here.acceleration).amax() < 5e-3, "{time_s}");
        }
    }

    #[test]
    fn pure_rotations_turn_about_the_tools_point() {
        let (leg, flange_from_tcp, from, _) = line(Vector3::new(0.0, 0.0, 0.3), Vector3::zeros());
        let kinematics = kinematics();
        for step in 0..=50 {
            let time_s = leg.duration_s() * f64::from(step) / 50.0;
            let state = leg.state(&kinematics, time_s).unwrap();
            let found = kinematics.base_link_from_flange(&state.position) * flange_from_tcp;
            assert!((found.translation.vector - from.translation.vector).norm() < 1e-10);
        }
    }

    #[test]
    fn lines_out_of_reach_or_through_singularities_are_no_lines() {
        let kinematics = kinematics();
        let tcp = Pose::identity();
        let from = kinematics.base_link_from_flange(&start());
        let mut to = from;
        to.translation.vector.x += 3.0;
        let found = Leg::line(&kinematics, start(), &tcp, &to, None, &pace(1.2, 0.25));
        assert!(
            matches!(found, Err(NoLine::OutOfReach(share)) if share < 0.5),
            "{found:?}"
        );
        // Through the axis of the shoulder, which the wrist's centre cannot pass.
        let mut to = from;
        to.translation.vector.x = -from.translation.vector.x;
        to.translation.vector.y = -from.translation.vector.y;
        let found = Leg::line(&kinematics, start(), &tcp, &to, None, &pace(1.2, 0.25));
        assert!(found.is_err());
    }
}
