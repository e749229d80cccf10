//! One arm and one patient, as they really are.

use std::ops::Range;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector2, Vector3, Vector6};
use needlebench_cell::{BodyKind, Cell};
use needlebench_engine::{Actuation, CommandTiming, Encoder, JointFriction};
use needlebench_kinematics::registration::RegistrationError;
use needlebench_kinematics::{Body, Chain, Dynamics, JOINT_COUNT, Joints, Pose};
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::imperfections::{
    self, AbsorbedSag, ArmPopulation, Breathing, Cantilever, GearTwist, Imperfections, Markers,
    NeedleBending,
};
use needlebench_scenario::{Goal, PlacedPhantom};
use serde::Serialize;

use crate::bend::DrawnNeedle;
use crate::distribution::{Variable, hypercube};
use crate::fit::{fitted, seen_off_m};

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
    /// Place of the robot's base in terms of what sees the markers.
    HandEye,
    /// Registration of the phantom.
    Registration,
    /// Markers that move with the skin.
    SkinMarkers,
    /// Localisation of the target in the image.
    Imaging,
    /// Bending of the needle in tissue.
    Needle,
    /// Tissue that gives way along the needle.
    Indentation,
    /// Breathing.
    Breathing,
}

/// When a source acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Before the needle goes in.
    BeforeInsertion,
    /// While it goes through tissue.
    InTissue,
    /// With the patient's breath: the target's, and that of markers on the skin.
    Breath,
}

impl Source {
    /// When it acts.
    pub fn stage(self) -> Stage {
        match self {
            Self::Needle | Self::Indentation => Stage::InTissue,
            Self::SkinMarkers | Self::Breathing => Stage::Breath,
            _ => Stage::BeforeInsertion,
        }
    }

    /// All of them, in the order of reports.
    pub const ALL: [Self; 13] = [
        Self::Calibration,
        Self::Encoder,
        Self::Elasticity,
        Self::Payload,
        Self::Friction,
        Self::Guide,
        Self::HandEye,
        Self::Registration,
        Self::SkinMarkers,
        Self::Imaging,
        Self::Needle,
        Self::Indentation,
        Self::Breathing,
    ];

    /// Whether it is there before the needle goes in: what a needle's line is off by in a phantom that
    /// lies still, which robots are measured by without deploying the needle.
    pub fn is_before_insertion(self) -> bool {
        self.stage() == Stage::BeforeInsertion
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration",
            Self::Encoder => "encoder",
            Self::Elasticity => "elasticity",
            Self::Payload => "payload",
            Self::Friction => "friction",
            Self::Guide => "guide",
            Self::HandEye => "hand_eye",
            Self::Registration => "registration",
            Self::SkinMarkers => "skin_markers",
            Self::Imaging => "imaging",
            Self::Needle => "needle",
            Self::Indentation => "indentation",
            Self::Breathing => "breathing",
        }
    }

    /// Whether its size was measured, and not assumed, where it is one that can be measured as a covariance: how well
    /// markers and target are localised.
    pub fn is_measured_in(self, all: &Imperfections) -> Option<bool> {
        match self {
            Self::Registration => all.registration.as_ref().map(Markers::are_measured),
            Self::Imaging => all.imaging.map(|seen| seen.is_measured),
            _ => None,
        }
    }

    /// Whether the imperfections have it.
    pub fn is_in(self, all: &Imperfections) -> bool {
        match self {
            Self::Calibration => all.calibration.is_some(),
            Self::Encoder => all.encoder.is_some(),
            Self::Elasticity => all.elasticity.is_some(),
            Self::Payload => all.payload.is_some(),
            Self::Friction => all.friction.is_some(),
            // In tissue the play is solved with the needle.
            Self::Guide => all.guide_clearance_m.is_some() && all.tissue().is_none(),
            Self::HandEye => all.hand_eye.is_some(),
            Self::Registration => all.registration.is_some(),
            Self::SkinMarkers => all.skin_markers.is_some(),
            Self::Imaging => all.imaging.is_some(),
            Self::Needle => all.needle.is_some(),
            Self::Indentation => all.indentation.is_some(),
            Self::Breathing => all.breathing.is_some(),
        }
    }
}

/// The imperfections with some sources alone.
pub(crate) fn only(all: &Imperfections, wanted: impl Fn(Source) -> bool) -> Imperfections {
    Imperfections {
        budget_samples: all.budget_samples,
        calibration: all
            .calibration
            .clone()
            .filter(|_| wanted(Source::Calibration)),
        encoder: all.encoder.filter(|_| wanted(Source::Encoder)),
        elasticity: all
            .elasticity
            .clone()
            .filter(|_| wanted(Source::Elasticity)),
        payload: all.payload.filter(|_| wanted(Source::Payload)),
        friction: all.friction.clone().filter(|_| wanted(Source::Friction)),
        guide_clearance_m: all.guide_clearance_m.filter(|_| wanted(Source::Guide)),
        hand_eye: all.hand_eye.filter(|_| wanted(Source::HandEye)),
        registration: all
            .registration
            .clone()
            .filter(|_| wanted(Source::Registration)),
        skin_markers: all
            .skin_markers
            .clone()
            .filter(|_| wanted(Source::SkinMarkers)),
        imaging: all.imaging.filter(|_| wanted(Source::Imaging)),
        needle: all.needle.clone().filter(|_| wanted(Source::Needle)),
        indentation: all.indentation.filter(|_| wanted(Source::Indentation)),
        breathing: all.breathing.filter(|_| wanted(Source::Breathing)),
        drive_limit_nm: None,
        control: None,
        sources: Vec::new(),
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
                    Source::Elasticity => {
                        let elasticity = imperfections.elasticity.as_ref();
                        let absorbed = elasticity.and_then(|each| each.absorbed.as_ref());
                        let modes = absorbed.map_or(0, |_| AbsorbedSag::MODES);
                        add(JOINT_COUNT + modes, Variable::Normal);
                    }
                    Source::Friction => add(JOINT_COUNT, Variable::Normal),
                    Source::Payload => add(4, Variable::Normal),
                    Source::Guide => add(4, Variable::Uniform),
                    Source::HandEye => add(6, Variable::Normal),
                    Source::Registration => {
                        let markers = imperfections.registration.as_ref();
                        add(
                            markers.map_or(0, |each| 3 * each.places_m.len()),
                            Variable::Normal,
                        );
                    }
                    Source::SkinMarkers => {
                        let markers = imperfections.skin_markers.as_ref();
                        add(
                            markers.map_or(0, |each| 3 * each.markers.places_m.len()),
                            Variable::Normal,
                        );
                        add(1, Variable::Normal);
                        add(2, Variable::Uniform);
                    }
                    Source::Imaging => add(3, Variable::Normal),
                    Source::Needle if imperfections.tissue().is_some() => {
                        add(DrawnNeedle::NORMALS, Variable::Normal);
                        add(1, Variable::Uniform);
                    }
                    Source::Needle | Source::Indentation => add(2, Variable::Normal),
                    Source::Breathing => {
                        add(1, Variable::Normal);
                        add(2, Variable::Uniform);
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

    /// Draws that are stratified in every variable.
    pub fn hypercube(&self, rows: usize, random: &mut SplitMix64) -> Vec<Draw> {
        let rows = hypercube(&self.variables, rows, random);
        rows.into_iter().map(Draw).collect()
    }

    pub(crate) fn of<'d>(&self, source: Source, draw: &'d Draw) -> &'d [f64] {
        let index = Source::ALL.iter().position(|each| *each == source);
        &draw.0[self.ranges[index.expect("all sources are listed")].clone()]
    }
}

/// What bends a needle.
#[derive(Debug, Clone, PartialEq)]
pub enum Bending {
    /// Nothing.
    None,
    /// A lateral force at the tip, guide frame, N, and the needle in air.
    Force(Vector2<f64>, Cantilever),
    /// Tissue.
    Tissue(Box<DrawnNeedle>),
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
    /// Where the target really is beside where the image shows it, world, m.
    pub unseen_m: Vector3<f64>,
    /// What bends the needle.
    pub bending: Bending,
    /// Motion of skin and target along the insertion, m.
    pub indented_m: [f64; 2],
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
        let elasticity = imperfections.elasticity.as_ref();
        let softness =
            elasticity.map(|elasticity| factors(of(Source::Elasticity), elasticity.spread));
        let gears = elasticity.zip(softness);
        let gears = gears.map_or_else(GearTwist::default, |(elasticity, softness)| {
            elasticity.gears.scaled(&softness)
        });
        let calibrated = imperfections.calibration.as_ref();
        let mut deviations = calibrated.map(|arms| arms.deviations(of(Source::Calibration)));
        if let Some((absorbed, softness)) = elasticity
            .and_then(|each| each.absorbed.as_ref())
            .zip(softness)
        {
            // What a calibration has taken for geometry is not there: the gears do it.
            let deviations = deviations.get_or_insert([Vector6::zeros(); JOINT_COUNT]);
            let taken = absorbed.taken(&softness, &of(Source::Elasticity)[JOINT_COUNT..]);
            for (deviation, taken) in deviations.iter_mut().zip(taken) {
                *deviation -= taken;
            }
        }
        let chain = deviations.map_or(cell.robot.chain, |deviations| {
            ArmPopulation::moved(&cell.robot.chain, &deviations)
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
        let loose = imperfections
            .guide_clearance_m
            .filter(|_| Source::Guide.is_in(imperfections));
        let needle_m = loose.map_or_else(
            || [Vector2::zeros(); 2],
            |clearance_m| {
                let values = of(Source::Guide);
                [0, 2].map(|at| disc(values[at], values[at + 1]) * (0.5 * clearance_m))
            },
        );
        let place = place.copied().unwrap_or_else(Pose::identity);
        let shift = registered(
            imperfections,
            of(Source::Registration),
            of(Source::SkinMarkers),
        )?;
        let hand_eye = imperfections.hand_eye.map_or_else(Pose::identity, |error| {
            let values = of(Source::HandEye);
            let vector = |at: usize| Vector3::new(values[at], values[at + 1], values[at + 2]);
            // About the phantom's origin, by axes of the world.
            let centre = Translation3::from(place.translation.vector);
            let turned = Pose::from_parts(
                Translation3::from(vector(0) * error.translation_m),
                UnitQuaternion::new(vector(3) * error.rotation_rad),
            );
            centre * turned * centre.inverse()
        });
        let shift = hand_eye * (place * shift * place.inverse());
        let (breath_m, breath_allowance_m) = imperfections.breathing.map_or_else(
            || ([Vector3::zeros(); 2], 0.0),
            |breathing| {
                let values = of(Source::Breathing);
                let share = breath(phase(&breathing, values));
                let displaced = share_displaced(&breathing, values);
                let in_world = |moved_m: Vector3<f64>| shift.rotation * (place.rotation * moved_m);
                let mut moved_m = [breathing.skin_m, breathing.target_m]
                    .map(|amplitude| in_world(amplitude) * displaced);
                for (moved_m, drift_m) in moved_m.iter_mut().zip(breathing.drift_m.iter().flatten())
                {
                    *moved_m += in_world(*drift_m);
                }
                // In another phase the breath is at the same level.
                let allowance_m = breathing.skin_m.norm() * share.max(1.0 - share);
                (moved_m, allowance_m)
            },
        );
        let unseen_m = imperfections.imaging.map_or_else(Vector3::zeros, |seen| {
            let values = Vector3::from_column_slice(of(Source::Imaging));
            shift.rotation * (place.rotation * (seen.root_m * values))
        });
        let bending = match &imperfections.needle {
            None => Bending::None,
            Some(NeedleBending::Cantilever(needle)) => {
                let values = of(Source::Needle);
                // Equal and independent along both axes: any direction, and this root mean square.
                let force_n = Vector2::new(values[0], values[1])
                    * (needle.side_force_n * std::f64::consts::FRAC_1_SQRT_2);
                Bending::Force(force_n, *needle)
            }
            Some(NeedleBending::Tissue(needle)) => {
                Bending::Tissue(Box::new(DrawnNeedle::new(needle, of(Source::Needle))))
            }
        };
        let indented_m = imperfections.indentation.map_or([0.0; 2], |indentation| {
            let values = of(Source::Indentation);
            std::array::from_fn(|at| indentation.mean_m[at] + indentation.spread_m[at] * values[at])
        });
        Ok(Self {
            chain,
            tool_body,
            actuation: Actuation {
                commands: imperfections
                    .control
                    .map(|[period_s, delay_s, _]| CommandTiming { period_s, delay_s }),
                encoder,
                gears,
                friction,
                drive_limit_nm: imperfections.drive_limit_nm,
                torque_delay_s: imperfections.control.map_or(0.0, |[_, _, delay_s]| delay_s),
                seed,
            },
            shift,
            breath_m,
            breath_allowance_m,
            needle_m,
            unseen_m,
            bending,
            indented_m,
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
        for solid in &mut real.behind_cuts {
            solid.parent_from_shape = moved * solid.parent_from_shape;
        }
        real
    }

    /// The real phantom's place: registration error and the skin's breath.
    pub fn phantom(&self, planned: &PlacedPhantom) -> PlacedPhantom {
        PlacedPhantom {
            phantom: planned.phantom.clone(),
            limbs: planned.limbs.clone(),
            world_from_phantom: Translation3::from(self.breath_m[0])
                * self.shift
                * planned.world_from_phantom,
        }
    }

    /// Where the needle's points at the skin and at the target should be, from where they are planned,
    /// world: the real phantom's, as the straight needle sees them.
    ///
    /// What bends the needle off its line counts as a motion of skin and target the other way.
    pub fn wanted(&self, goal: &Goal, planned: &[Point3<f64>; 2]) -> [Point3<f64>; 2] {
        self.wanted_beside(goal, planned, &self.bent_m(goal))
    }

    fn wanted_beside(
        &self,
        goal: &Goal,
        planned: &[Point3<f64>; 2],
        bent_m: &[Vector3<f64>; 2],
    ) -> [Point3<f64>; 2] {
        let unseen_m = [Vector3::zeros(), self.unseen_m];
        std::array::from_fn(|at| {
            self.at_insertion(goal, at, self.shift * planned[at], unseen_m[at], bent_m)
        })
    }

    /// How far the needle is off its line at skin and target, world, m: its bend, and how far the line is aimed off the target.
    fn bent_m(&self, goal: &Goal) -> [Vector3<f64>; 2] {
        let across = match &self.bending {
            Bending::None => return [Vector3::zeros(); 2],
            Bending::Force(force_n, needle) => {
                let length_m = goal.insertion_length_m;
                let depths_m = [goal.standoff_m.unwrap_or(0.0), length_m];
                depths_m.map(|depth_m| force_n * needle.compliance_m_per_n(depth_m, length_m))
            }
            Bending::Tissue(needle) => needle.bent_m(goal),
        };
        let turn = goal.world_from_guide_exit.rotation;
        let [at_skin, at_tip] = across.map(|across| turn * Vector3::new(across.x, across.y, 0.0));
        [at_skin, at_tip + goal.aim_m]
    }

    /// Where skin (0) or target (1) is when the needle is in, as the straight needle sees it, world: from where it
    /// lies before, and how far that is beside where it is seen.
    fn at_insertion(
        &self,
        goal: &Goal,
        at: usize,
        before: Point3<f64>,
        unseen_m: Vector3<f64>,
        bent_m: &[Vector3<f64>; 2],
    ) -> Point3<f64> {
        let pushed_m = goal.axis.into_inner() * self.indented_m[at];
        before + self.breath_m[at] + unseen_m + pushed_m - bent_m[at]
    }

    /// The goal with its target and entry point where they really are, as [`Truth::wanted`] has them; the
    /// plan's guide pose stays.
    ///
    /// A true target is where it is, whatever registration and image say of it: breathing and tissue alone move it.
    pub fn goal(&self, planned: &Goal) -> Goal {
        let aimed_m = planned.aimed_m();
        let entry_m = planned.entry_m.unwrap_or(aimed_m);
        let bent_m = self.bent_m(planned);
        let [entry_m, target_m] = self.wanted_beside(planned, &[entry_m, aimed_m], &bent_m);
        let known = planned.true_target_m.map(|at| at + planned.aim_m);
        Goal {
            target_m,
            true_target_m: known
                .map(|at| self.at_insertion(planned, 1, at, Vector3::zeros(), &bent_m)),
            entry_m: planned.entry_m.map(|_| entry_m),
            // That is part of where the target is to a straight needle.
            aim_m: Vector3::zeros(),
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
    libm::sin(std::f64::consts::PI * phase).powi(4)
}

/// Share of the amplitudes that skin and target are displaced by, from the values of [`phase`].
///
/// Beside a level the phase has no spread, so that the normal value is the level's.
pub(crate) fn share_displaced(breathing: &Breathing, values: &[f64]) -> f64 {
    let shape = breath(phase(breathing, values));
    breathing
        .level_sd
        .map_or(shape, |level_sd| level_sd * values[0] + shape)
}

/// Phase from a normal value, one that says whether the hold fails, and one for the phase if it does.
pub(crate) fn phase(breathing: &Breathing, values: &[f64]) -> f64 {
    let share = |value: f64| 0.5 * (value + 1.0);
    match breathing.phase_spread {
        Some(spread) if share(values[1]) >= breathing.hold_failure => {
            breathing.phase + spread * values[0]
        }
        _ => share(values[2]),
    }
}

/// Where the phantom really is in terms of where markers that are seen with an error, and have moved with
/// the skin, say it is; phantom frame.
fn registered(
    imperfections: &Imperfections,
    seen: &[f64],
    moved: &[f64],
) -> Result<Pose, RegistrationError> {
    let registration = imperfections.registration.as_ref();
    let skin = imperfections.skin_markers.as_ref();
    let Some(markers) = registration.or(skin.map(|skin| &skin.markers)) else {
        return Ok(Pose::identity());
    };
    let mut places_m = markers.places_m.clone();
    let mut moved_by = |off_m: Vec<Vector3<f64>>| {
        for (place, off_m) in places_m.iter_mut().zip(off_m) {
            *place += off_m;
        }
    };
    if let Some(markers) = registration {
        moved_by(seen_off_m(markers, seen));
    }
    if let Some(skin) = skin {
        let (shifts, breathing) = moved.split_at(3 * skin.markers.places_m.len());
        let shifts = shifts.chunks_exact(3).map(Vector3::from_column_slice);
        moved_by(shifts.map(|each| each * skin.shift_m).collect());
        let risen = skin.breathing.skin_m * breath(phase(&skin.breathing, breathing));
        moved_by(vec![risen; markers.places_m.len()]);
    }
    // The plan believes in a phantom fitted to what was seen of markers that are really elsewhere.
    Ok(fitted(markers, &places_m)?.inverse())
}

/// Uniform point of the unit disc from two uniform numbers in (-1, 1): concentric squares to
/// concentric circles (Shirley and Chiu, J. Graphics Tools 2(3), 1997). Odd: mirrored numbers give
/// the mirrored point.
pub(crate) fn disc(x: f64, y: f64) -> Vector2<f64> {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    if x == 0.0 && y == 0.0 {
        return Vector2::zeros();
    }
    let (radius, angle) = if x.abs() > y.abs() {
        (x, FRAC_PI_4 * y / x)
    } else {
        (y, FRAC_PI_2 - FRAC_PI_4 * x / y)
    };
    Vector2::new(radius * libm::cos(angle), radius * libm::sin(angle))
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
