//! One arm and one patient, as they really are.

use std::ops::Range;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector2, Vector3, Vector6};
use needlebench_cell::imperfections::{self, ArmPopulation, Breathing, Imperfections};
use needlebench_cell::{BodyKind, Cell, Goal, PlacedPhantom};
use needlebench_engine::{Actuation, CommandTiming, Encoder, JointFriction};
use needlebench_kinematics::random::SplitMix64;
use needlebench_kinematics::registration::{RegistrationError, register};
use needlebench_kinematics::{Body, Chain, Dynamics, JOINT_COUNT, Joints, Pose};
use serde::Serialize;

use crate::distribution::{Variable, hypercube};

/// Least factor on a compliance or a friction: a draw beyond it would turn its sign.
const LEAST_FACTOR: f64 = 0.01;

/// Where an error at the needle's tip comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Joint origins that the controller does not know.
    Calibration,
    /// Zero, rounding and noise of the encoders.
    Encoder,
    /// Elasticity of the gears: sag under the arm's weight.
    Elasticity,
    /// Wrong mass or centre of mass of the tool.
    Payload,
    /// Friction of the joints.
    Friction,
    /// Play of the needle in the guide.
    Guide,
    /// Registration of the phantom.
    Registration,
    /// Breathing.
    Breathing,
}

impl Source {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 8] = [
        Self::Calibration,
        Self::Encoder,
        Self::Elasticity,
        Self::Payload,
        Self::Friction,
        Self::Guide,
        Self::Registration,
        Self::Breathing,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration",
            Self::Encoder => "encoder",
            Self::Elasticity => "elasticity",
            Self::Payload => "payload",
            Self::Friction => "friction",
            Self::Guide => "guide",
            Self::Registration => "registration",
            Self::Breathing => "breathing",
        }
    }

    /// The imperfections with this source alone.
    pub(crate) fn alone(self, all: &Imperfections) -> Imperfections {
        let is = |source| self == source;
        Imperfections {
            budget_samples: all.budget_samples,
            calibration: all.calibration.clone().filter(|_| is(Self::Calibration)),
            encoder: all.encoder.filter(|_| is(Self::Encoder)),
            elasticity: all.elasticity.filter(|_| is(Self::Elasticity)),
            payload: all.payload.filter(|_| is(Self::Payload)),
            friction: all.friction.clone().filter(|_| is(Self::Friction)),
            guide_clearance_m: all.guide_clearance_m.filter(|_| is(Self::Guide)),
            registration: all.registration.clone().filter(|_| is(Self::Registration)),
            breathing: all.breathing.filter(|_| is(Self::Breathing)),
            drive_limit_nm: None,
            control: None,
            sources: Vec::new(),
        }
    }

    /// Whether the imperfections have it.
    pub(crate) fn is_in(self, all: &Imperfections) -> bool {
        match self {
            Self::Calibration => all.calibration.is_some(),
            Self::Encoder => all.encoder.is_some(),
            Self::Elasticity => all.elasticity.is_some(),
            Self::Payload => all.payload.is_some(),
            Self::Friction => all.friction.is_some(),
            Self::Guide => all.guide_clearance_m.is_some(),
            Self::Registration => all.registration.is_some(),
            Self::Breathing => all.breathing.is_some(),
        }
    }
}

/// Values of the standard variables of a [`Layout`].
#[derive(Debug, Clone, PartialEq)]
pub struct Draw(pub Vec<f64>);

/// Which standard variables the imperfections have, in a fixed order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    variables: Vec<Variable>,
    ranges: [Range<usize>; Source::ALL.len()],
}

impl Layout {
    /// Variables of the imperfections.
    pub fn new(imperfections: &Imperfections) -> Self {
        let mut variables = Vec::new();
        let ranges = Source::ALL.map(|source| {
            let start = variables.len();
            let mut add =
                |count: usize, variable| variables.extend(std::iter::repeat_n(variable, count));
            if source.is_in(imperfections) {
                match source {
                    Source::Calibration => {
                        let arms = imperfections.calibration.as_ref();
                        add(arms.map_or(0, |arms| arms.modes.len()), Variable::Normal);
                    }
                    Source::Encoder => {
                        add(JOINT_COUNT, Variable::Normal);
                        add(JOINT_COUNT, Variable::Uniform);
                    }
                    Source::Elasticity | Source::Friction => add(JOINT_COUNT, Variable::Normal),
                    Source::Payload => add(4, Variable::Normal),
                    Source::Guide => add(4, Variable::Uniform),
                    Source::Registration => {
                        let markers = imperfections.registration.as_ref();
                        add(markers.map_or(0, |(at, _)| 3 * at.len()), Variable::Normal);
                    }
                    Source::Breathing => {
                        let free = imperfections
                            .breathing
                            .is_some_and(|breathing| breathing.phase_spread.is_none());
                        add(
                            1,
                            if free {
                                Variable::Uniform
                            } else {
                                Variable::Normal
                            },
                        );
                    }
                }
            }
            start..variables.len()
        });
        Self { variables, ranges }
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// Whether nothing varies.
    pub fn is_empty(&self) -> bool {
        self.variables.is_empty()
    }

    /// One draw.
    pub fn draw(&self, random: &mut SplitMix64) -> Draw {
        Draw(
            self.variables
                .iter()
                .map(|each| each.draw(random))
                .collect(),
        )
    }

    /// Draws that are stratified in every variable and come in mirrored pairs.
    pub fn hypercube(&self, rows: usize, random: &mut SplitMix64) -> Vec<Draw> {
        let rows = hypercube(&self.variables, rows, random);
        rows.into_iter().map(Draw).collect()
    }

    fn of<'d>(&self, source: Source, draw: &'d Draw) -> &'d [f64] {
        let index = Source::ALL.iter().position(|each| *each == source);
        &draw.0[self.ranges[index.expect("all sources are listed")].clone()]
    }
}

/// One arm and one patient.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// The real arm's joints.
    pub chain: Chain,
    /// The real tool, flange frame.
    pub tool_body: Body,
    /// The drives.
    pub actuation: Actuation,
    /// The real phantom's place in terms of the planned one: `p_real = shift * p_planned`, world.
    pub shift: Pose,
    /// Displacement of skin and target by breathing, world, m.
    pub breath_m: [Vector3<f64>; 2],
    /// How far the skin may come nearer in another phase of the breath, m.
    pub breath_allowance_m: f64,
    /// Place of the needle's axis in the guide: at its entry and at its exit, guide frame, m.
    pub needle_m: [Vector2<f64>; 2],
}

impl Truth {
    /// The arm and the patient that a draw stands for. `place` is the phantom's planned pose, if
    /// there is a phantom; `seed` that of the encoders' noise.
    ///
    /// # Errors
    /// [`RegistrationError`] for markers that determine no pose.
    pub fn new(
        cell: &Cell,
        place: Option<&Pose>,
        imperfections: &Imperfections,
        layout: &Layout,
        draw: &Draw,
        seed: u64,
    ) -> Result<Self, RegistrationError> {
        let of = |source| layout.of(source, draw);
        let chain = imperfections
            .calibration
            .as_ref()
            .map_or(cell.robot.chain, |arms| {
                let deviations = arms.deviations(of(Source::Calibration));
                ArmPopulation::moved(&cell.robot.chain, &deviations)
            });
        let factors = |values: &[f64], spread: f64| {
            Joints::from_fn(|i, _| (1.0 + spread * values[i]).max(LEAST_FACTOR))
        };
        let encoder = imperfections.encoder.map(|encoder| {
            let (zeros, rounding) = of(Source::Encoder).split_at(JOINT_COUNT);
            Encoder {
                resolution_rad: encoder.resolution_rad,
                noise_rad: encoder.noise_rad,
                offset_rad: Joints::from_fn(|i, _| encoder.zero_spread_rad[i] * zeros[i]),
                resting_rounding_rad: Joints::from_fn(|i, _| {
                    0.5 * encoder.resolution_rad[i] * rounding[i]
                }),
            }
        });
        let compliance_rad_per_nm =
            imperfections
                .elasticity
                .map_or_else(Joints::zeros, |(compliance, spread)| {
                    compliance.component_mul(&factors(of(Source::Elasticity), spread))
                });
        let tool_body = imperfections.payload.map_or(cell.tool.body, |payload| {
            let values = of(Source::Payload);
            let mass_kg =
                cell.tool.body.mass_kg + payload.mass_error_kg + payload.mass_spread_kg * values[0];
            let off = Vector3::new(values[1], values[2], values[3]) * payload.com_spread_m;
            Body {
                mass_kg: mass_kg.max(LEAST_FACTOR * cell.tool.body.mass_kg),
                com_m: cell.tool.body.com_m + payload.com_error_m + off,
                inertia_kgm2: cell.tool.body.inertia_kgm2,
            }
        });
        let friction = imperfections
            .friction
            .as_ref()
            .map(|block| joint_friction(block, factors(of(Source::Friction), block.spread)));
        let needle_m = imperfections.guide_clearance_m.map_or_else(
            || [Vector2::zeros(); 2],
            |clearance_m| {
                let values = of(Source::Guide);
                [0, 2].map(|at| disc(values[at], values[at + 1]) * (0.5 * clearance_m))
            },
        );
        let place = place.copied().unwrap_or_else(Pose::identity);
        let shift = imperfections
            .registration
            .as_ref()
            .map(|(markers, fle_rms_m)| {
                let sigma_m = fle_rms_m / 3.0_f64.sqrt();
                let seen: Vec<Point3<f64>> = markers
                    .iter()
                    .zip(of(Source::Registration).chunks_exact(3))
                    .map(|(at, off)| at + Vector3::new(off[0], off[1], off[2]) * sigma_m)
                    .collect();
                // The plan believes in `place`, fitted to what was seen of markers that are really
                // at `place * fitted^-1`.
                let fitted = register(markers, &seen)?;
                Ok(place * fitted.inverse() * place.inverse())
            })
            .transpose()?
            .unwrap_or_else(Pose::identity);
        let (breath_m, breath_allowance_m) = imperfections.breathing.map_or_else(
            || ([Vector3::zeros(); 2], 0.0),
            |breathing| {
                let share = breath(phase(&breathing, of(Source::Breathing)[0]));
                let moved = [breathing.skin_m, breathing.target_m]
                    .map(|amplitude| shift.rotation * (place.rotation * amplitude) * share);
                let allowance_m = breathing.skin_m.norm() * share.max(1.0 - share);
                (moved, allowance_m)
            },
        );
        Ok(Self {
            chain,
            tool_body,
            actuation: Actuation {
                commands: imperfections
                    .control
                    .map(|[period_s, delay_s, _]| CommandTiming { period_s, delay_s }),
                encoder,
                compliance_rad_per_nm,
                friction,
                drive_limit_nm: imperfections.drive_limit_nm,
                torque_delay_s: imperfections.control.map_or(0.0, |[_, _, delay_s]| delay_s),
                seed,
            },
            shift,
            breath_m,
            breath_allowance_m,
            needle_m,
        })
    }

    /// The needle's axis in the guide: the pose of the guide's exit as the needle lies in it.
    fn needle_in_guide(&self, guide_length_m: f64) -> Pose {
        let [entry, exit] = self.needle_m;
        if self.needle_m == [Vector2::zeros(); 2] {
            return Pose::identity();
        }
        let along = Vector3::new(exit.x - entry.x, exit.y - entry.y, guide_length_m);
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along)
            .unwrap_or_else(UnitQuaternion::identity);
        Pose::from_parts(Translation3::new(exit.x, exit.y, 0.0), turn)
    }

    /// The real cell: arm, tool and phantom as they are. What stands at the guide's exit is the
    /// needle's axis, play included.
    pub fn cell(&self, nominal: &Cell) -> Cell {
        let mut real = nominal.clone();
        real.robot.chain = self.chain;
        real.tool.body = self.tool_body;
        real.tool.flange_from_guide_exit *= self.needle_in_guide(nominal.tool.guide_length_m());
        let moved = Translation3::from(self.breath_m[0]) * self.shift;
        for body in &mut real.bodies {
            if body.kind == BodyKind::Phantom {
                for solid in &mut body.solids {
                    solid.parent_from_shape = moved * solid.parent_from_shape;
                }
            }
        }
        real
    }

    /// The real phantom's place: registration error and the skin's breath.
    pub fn phantom(&self, planned: &PlacedPhantom) -> PlacedPhantom {
        PlacedPhantom {
            phantom: planned.phantom.clone(),
            world_from_phantom: Translation3::from(self.breath_m[0])
                * self.shift
                * planned.world_from_phantom,
        }
    }

    /// Where a planned target really is, world.
    pub fn target(&self, planned: &Point3<f64>) -> Point3<f64> {
        self.shift * planned + self.breath_m[1]
    }

    /// Where a planned entry point really is, world.
    pub fn entry(&self, planned: &Point3<f64>) -> Point3<f64> {
        self.shift * planned + self.breath_m[0]
    }

    /// The goal with its target and entry point where they really are; the plan's guide pose stays.
    pub fn goal(&self, planned: &Goal) -> Goal {
        Goal {
            target_m: self.target(&planned.target_m),
            entry_m: planned.entry_m.map(|entry| self.entry(&entry)),
            ..planned.clone()
        }
    }

    /// Dynamics of the real arm.
    pub fn dynamics(&self, nominal: &Cell) -> Dynamics {
        let mut real = nominal.dynamics();
        real.chain = self.chain;
        let last = JOINT_COUNT - 1;
        real.bodies[last] = nominal.robot.bodies[last]
            .combined_with(&self.tool_body.transformed(&self.chain.wrist_3_from_flange));
        real
    }

    /// Pose of the needle's axis at the guide's exit for a posture of the real arm, world.
    pub fn world_from_guide_exit(&self, nominal: &Cell, q: &Joints) -> Pose {
        nominal.robot.world_from_base_link
            * self.chain.base_link_from_flange(q)
            * nominal.tool.flange_from_guide_exit
            * self.needle_in_guide(nominal.tool.guide_length_m())
    }

    /// Entry-depth point and tip of the needle for a posture of the real arm, world; `depths_m`
    /// from the guide's exit along the needle.
    pub fn needle_points(
        &self,
        nominal: &Cell,
        q: &Joints,
        depths_m: [f64; 2],
    ) -> [Point3<f64>; 2] {
        let exit = self.world_from_guide_exit(nominal, q);
        depths_m.map(|depth_m| exit * Point3::new(0.0, 0.0, depth_m))
    }
}

/// Friction of the joints, SI; `true_over_nominal` is how much more there is than believed.
pub(crate) fn joint_friction(
    block: &imperfections::JointFriction,
    true_over_nominal: Joints,
) -> JointFriction {
    JointFriction {
        coulomb_nm: Joints::from(block.coulomb_nm),
        stiction_nm: Joints::from(block.stiction_nm),
        stribeck_rad_s: Joints::from(block.stribeck_deg_s.map(f64::to_radians)),
        viscous_nms_per_rad: Joints::from(block.viscous_nms_rad),
        bristle_stiffness_nm_per_rad: Joints::from(block.bristle_stiffness_nm_rad),
        bristle_damping_nms_per_rad: Joints::from(block.bristle_damping_nms_rad),
        compensation: block.compensation,
        true_over_nominal,
    }
}

/// Share of the breath's amplitude at a phase.
pub(crate) fn breath(phase: f64) -> f64 {
    (std::f64::consts::PI * phase).sin().powi(4)
}

fn phase(breathing: &Breathing, value: f64) -> f64 {
    breathing
        .phase_spread
        .map_or(0.5 * (value + 1.0), |spread| {
            breathing.phase + spread * value
        })
}

/// Uniform point of the unit disc from two uniform numbers in (-1, 1): concentric squares to
/// concentric circles (Shirley and Chiu, J. Graphics Tools 2(3), 1997). Odd: mirrored numbers give
/// the mirrored point.
fn disc(x: f64, y: f64) -> Vector2<f64> {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    if x == 0.0 && y == 0.0 {
        return Vector2::zeros();
    }
    let (radius, angle) = if x.abs() > y.abs() {
        (x, FRAC_PI_4 * y / x)
    } else {
        (y, FRAC_PI_2 - FRAC_PI_4 * x / y)
    };
    Vector2::new(radius * angle.cos(), radius * angle.sin())
}

/// Deviation of a joint's origin as a displacement of a point beyond it.
pub(crate) fn moved_by(
    origin: &Pose,
    deviation: &Vector6<f64>,
    point: &Point3<f64>,
) -> Vector3<f64> {
    let local = origin.inverse() * point;
    let translation = deviation.fixed_rows::<3>(0).into_owned();
    let rotation = deviation.fixed_rows::<3>(3).into_owned();
    origin.rotation * (translation + rotation.cross(&local.coords))
}
