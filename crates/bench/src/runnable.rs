//! A scenario that is fit to be run, or why it is not.

use needlebench_clearance::ClearanceModel;
use needlebench_input::Finding;
use needlebench_planning::excitation::{ExcitationError, ExcitationPlan, plan_excitation};
use needlebench_planning::iso9283::{ProtocolError, ProtocolPlan, plan_protocol};
use needlebench_scenario::ResolvedScenario;

/// A scenario, with the plan of its test by ISO 9283 or of its excitation if it has one: a plan that cannot be made is
/// found before anything long begins, and it is not made again.
#[derive(Debug, Clone)]
pub struct Runnable {
    resolved: ResolvedScenario,
    protocol: Option<Result<ProtocolPlan, ProtocolError>>,
    excitation: Option<Result<ExcitationPlan, ExcitationError>>,
}

impl Runnable {
    /// Plans the scenario's protocol, if it has one.
    pub fn new(resolved: ResolvedScenario) -> Self {
        let protocol = resolved.iso9283.as_ref().map(|protocol| {
            let model = ClearanceModel::new(&resolved.cell);
            plan_protocol(&resolved, protocol, &model)
        });
        let excitation = resolved.excitation.as_ref().map(|protocol| {
            let model = ClearanceModel::new(&resolved.cell);
            plan_excitation(&resolved, protocol, &model)
        });
        Self {
            resolved,
            protocol,
            excitation,
        }
    }

    /// The same for a scenario of which nothing is wrong.
    ///
    /// # Errors
    /// A start posture that collides, or a protocol that cannot be carried out.
    pub fn checked(resolved: ResolvedScenario) -> Result<Self, Finding> {
        let runnable = Self::new(resolved);
        match runnable.obstacle() {
            Some(finding) => Err(finding),
            None => Ok(runnable),
        }
    }

    /// The scenario.
    pub fn scenario(&self) -> &ResolvedScenario {
        &self.resolved
    }

    /// The scenario by itself.
    pub fn into_scenario(self) -> ResolvedScenario {
        self.resolved
    }

    /// The plan of its protocol, if it has one.
    pub(crate) fn protocol(&self) -> Option<&Result<ProtocolPlan, ProtocolError>> {
        self.protocol.as_ref()
    }

    /// The plan of the excitation run, if it has one.
    pub fn excitation(&self) -> Option<&Result<ExcitationPlan, ExcitationError>> {
        self.excitation.as_ref()
    }

    fn obstacle(&self) -> Option<Finding> {
        let file = &self.resolved.source.file;
        if let Some(protocol) = &self.protocol {
            // It does not start from the start posture.
            let error = protocol.as_ref().err()?;
            let finding = Finding::new(file, error.to_string());
            return Some(finding.key("iso9283").hint(error.hint()));
        }
        if let Some(Err(error)) = &self.excitation {
            let finding = Finding::new(file, error.to_string());
            return Some(finding.key(error.key()).hint(error.hint()));
        }
        let cell = &self.resolved.cell;
        let model = ClearanceModel::new(cell);
        let pair = model.first_below(&self.resolved.start, |_| 0.0)?;
        let [a, b] = pair.in_words(cell);
        let depth_mm = -pair.separation.distance_m * 1e3;
        let finding = Finding::new(
            file,
            format!("the start posture collides: {a} penetrates {b} by {depth_mm:.1} mm"),
        );
        Some(
            finding
                .key("start.joints_deg")
                .hint("choose another start posture, or move the obstacle"),
        )
    }
}
