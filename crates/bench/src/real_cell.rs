//! The cell as it really is in a run: the nominal one, or one draw of the scenario's imperfections.

use nalgebra::Point3;
use needlebench_cell::{Cell, ClearanceClass};
use needlebench_clearance::ClearanceModel;
use needlebench_engine::Actuation;
use needlebench_evaluation::report::TruthReport;
use needlebench_evaluation::{ClearanceSeries, NeedleMeasurement, measure_needle};
use needlebench_kinematics::registration::RegistrationError;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{Joints, rotation_vector};
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::{Goal, PlacedPhantom, ResolvedScenario};
use needlebench_uncertainty::{Layout, Settled, Truth, servo_of, settle_after};

/// Keeps the draw of imperfections apart from the other things that a scenario's seed decides.
const STREAM: u64 = 0x7472_7574_6821;

/// What the engines simulate and the measurements are compared with.
pub struct RealCell<'a> {
    resolved: &'a ResolvedScenario,
    nominal: &'a ClearanceModel,
    ideal: Actuation,
    imperfect: Option<Imperfect>,
}

struct Imperfect {
    truth: Truth,
    cell: Cell,
    model: ClearanceModel,
    goals: Vec<Goal>,
    phantom: Option<PlacedPhantom>,
}

impl<'a> RealCell<'a> {
    /// Draws the scenario's imperfections, if it has any, from its seed.
    ///
    /// # Errors
    /// [`RegistrationError`] for markers that determine no pose.
    pub fn new(
        resolved: &'a ResolvedScenario,
        nominal: &'a ClearanceModel,
    ) -> Result<Self, RegistrationError> {
        let imperfect = drawn_truth(resolved)
            .map(|truth| {
                let truth = truth?;
                let cell = truth.cell(&resolved.cell);
                Ok(Imperfect {
                    model: ClearanceModel::new(&cell),
                    cell,
                    goals: resolved.goals.iter().map(|goal| truth.goal(goal)).collect(),
                    phantom: resolved.phantom.as_ref().map(|each| truth.phantom(each)),
                    truth,
                })
            })
            .transpose()?;
        Ok(Self {
            resolved,
            nominal,
            ideal: Actuation::default(),
            imperfect,
        })
    }

    /// The real cell.
    pub fn cell(&self) -> &Cell {
        self.imperfect
            .as_ref()
            .map_or(&self.resolved.cell, |each| &each.cell)
    }

    /// Clearances of the real cell.
    pub fn model(&self) -> &ClearanceModel {
        self.imperfect
            .as_ref()
            .map_or(self.nominal, |each| &each.model)
    }

    /// A goal with its real target and entry point.
    pub fn goal(&self, index: usize) -> &Goal {
        let goals = self.imperfect.as_ref().map(|each| &each.goals);
        &goals.unwrap_or(&self.resolved.goals)[index]
    }

    /// The phantom where it really is.
    pub fn phantom(&self) -> Option<&PlacedPhantom> {
        match &self.imperfect {
            Some(each) => each.phantom.as_ref(),
            None => self.resolved.phantom.as_ref(),
        }
    }

    /// The drives.
    pub fn actuation(&self) -> &Actuation {
        self.imperfect
            .as_ref()
            .map_or(&self.ideal, |each| &each.truth.actuation)
    }

    /// Whether anything is imperfect.
    pub(crate) fn is_imperfect(&self) -> bool {
        self.imperfect.is_some()
    }

    /// What was drawn.
    pub fn report(&self) -> Option<TruthReport> {
        let Imperfect { truth, cell, .. } = self.imperfect.as_ref()?;
        let nominal = &self.resolved.cell;
        let joints = |values: Joints| values.into();
        Some(TruthReport {
            seed: self.resolved.scenario.seed,
            flange_offset_m: {
                let q = self.resolved.start;
                let [real, believed] =
                    [cell, nominal].map(|cell| cell.robot.world_from_flange(&q).translation.vector);
                (real - believed).into()
            },
            tool_mass_error_kg: truth.tool_body.mass_kg - nominal.tool.body.mass_kg,
            tool_com_error_m: (truth.tool_body.com_m - nominal.tool.body.com_m).into(),
            encoder_offset_rad: truth.actuation.encoder.map(|each| joints(each.offset_rad)),
            compliance_rad_per_nm: joints(truth.actuation.gears.compliance_rad_per_nm[0]),
            friction_true_over_nominal: truth
                .actuation
                .friction
                .map(|each| joints(each.true_over_nominal)),
            phantom_shift_m: truth.shift.translation.vector.into(),
            phantom_turn_rad: rotation_vector(&truth.shift.rotation).into(),
            breath_skin_m: truth.breath_m[0].into(),
            breath_target_m: truth.breath_m[1].into(),
            needle_in_guide_m: truth.needle_m.map(Into::into),
        })
    }

    /// Subtracts from the certified bounds what the skin may approach in another breathing phase.
    pub(crate) fn allow_for_breath(&self, series: &mut ClearanceSeries) {
        let Some(Imperfect { truth, .. }) = &self.imperfect else {
            return;
        };
        for (class, found) in &mut series.minima {
            let touches_skin = matches!(
                class,
                ClearanceClass::RobotPhantom
                    | ClearanceClass::ToolPhantom
                    | ClearanceClass::GuideStandoff
                    | ClearanceClass::NeedleCorridor
            );
            if touches_skin && let Some(bound_m) = &mut found.certified_lower_bound_m {
                *bound_m -= truth.breath_allowance_m;
                let breathes = truth.breath_allowance_m > 0.0;
                found.breath_allowance_m = breathes.then_some(truth.breath_allowance_m);
            }
        }
    }

    /// Static equilibrium at the end of a motion, without any engine; none for the nominal robot, and where a drive is
    /// too weak.
    pub fn predicted(&self, goal: usize, trajectory: &JointTrajectory) -> Option<PredictedNeedle> {
        let Imperfect { truth, cell, .. } = self.imperfect.as_ref()?;
        let nominal = &self.resolved.cell;
        let servo = servo_of(self.resolved);
        let settled = settle_after(&servo, &truth.dynamics(nominal), truth, trajectory);
        let Settled { position, .. } = settled.ok()?;
        let flange = cell.robot.world_from_flange(&position);
        let depth_m = self.resolved.goals[goal].insertion_length_m;
        Some(PredictedNeedle {
            tip_m: truth.needle_points(nominal, &position, [0.0, depth_m])[1],
            needle: measure_needle(cell, self.phantom(), self.goal(goal), &flange),
        })
    }
}

/// Where the needle is predicted to come to rest.
pub struct PredictedNeedle {
    /// Its tip, world.
    pub tip_m: Point3<f64>,
    /// What would be measured of it.
    pub needle: NeedleMeasurement,
}

/// One draw of the scenario's imperfections, from its seed; none without any.
///
/// # Errors
/// [`RegistrationError`] for markers that determine no pose.
pub(crate) fn drawn_truth(resolved: &ResolvedScenario) -> Option<Result<Truth, RegistrationError>> {
    let imperfections = resolved.imperfections.as_ref()?;
    let mut random = SplitMix64::new(resolved.scenario.seed ^ STREAM);
    let layout = Layout::new(imperfections);
    let draw = layout.draw(&mut random);
    let place = resolved
        .phantom
        .as_ref()
        .map(|each| &each.world_from_phantom);
    let noise_seed = random.next_u64();
    let cell = &resolved.cell;
    Some(Truth::new(
        cell,
        place,
        imperfections,
        &layout,
        &draw,
        noise_seed,
    ))
}
