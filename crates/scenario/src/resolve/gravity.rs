//! Gravity of the world, and what the controller takes it for.

use nalgebra::Vector3;
use needlebench_cell::STANDARD_GRAVITY_M_S2;
use needlebench_robot::LoadedRobot;
use serde::Serialize;

use crate::scenario::{EnginesSection, Scenario};

/// Gravity anywhere on the surface of the Earth, m/s^2, rounded outwards (Hirt et al., Geophysical Research
/// Letters 40, 2013: 9.7639 to 9.8337).
const ON_EARTH_M_S2: std::ops::RangeInclusive<f64> = 9.76..=9.84;

/// Gravity of the world, and what the controller takes it for, each with where it comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GravitySettings {
    /// What acts on the arm.
    pub world_m_s2: f64,
    /// Where that comes from.
    pub world_source: String,
    /// What the controller's feed-forward has, for arm and tool alike.
    pub believed_m_s2: f64,
    /// Where that comes from.
    pub believed_source: String,
}

impl GravitySettings {
    /// What acts on the arm, world axes, m/s^2.
    pub fn world(&self) -> Vector3<f64> {
        down(self.world_m_s2)
    }

    /// Gravity assumed by the controller, world axes, m/s^2.
    pub fn believed(&self) -> Vector3<f64> {
        down(self.believed_m_s2)
    }

    /// Whether the controller's gravity differs from the world's.
    #[expect(
        clippy::float_cmp,
        reason = "a copy of the world's, unless the scenario says otherwise"
    )]
    pub(crate) fn is_believed_wrongly(&self) -> bool {
        self.believed_m_s2 != self.world_m_s2
    }
}

fn down(gravity_m_s2: f64) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -gravity_m_s2)
}

/// Gravity of a scenario in `file`; a note where the controller's is not the world's, or the world's not the Earth's.
///
/// By default the controller uses the world's gravity, whatever the arm data give for the manufacturer's: without
/// imperfections an arm equals its controller's model and has no deflection.
pub(super) fn gravity_settings(
    file: &str,
    scenario: &Scenario,
    robot: &LoadedRobot,
    notes: &mut Vec<String>,
) -> GravitySettings {
    let world_m_s2 = scenario.engines.gravity_m_s2;
    #[expect(clippy::float_cmp, reason = "the default itself")]
    let is_default = world_m_s2 == EnginesSection::default().gravity_m_s2;
    if !ON_EARTH_M_S2.contains(&world_m_s2) {
        notes.push(format!(
            "gravity is {world_m_s2} m/s^2, outside the range on Earth"
        ));
    }
    let data = robot.description.arm.as_ref().map(|used| &used.arm.data);
    let makers = data.and_then(|data| Some((&data.name, data.gravity.as_ref()?)));
    let given = scenario.controller.gravity_m_s2;
    let (believed_m_s2, believed_source) = if let Some(given) = given {
        (given, format!("{file}: controller"))
    } else {
        let makers = makers.map_or_else(String::new, |(name, known)| {
            format!(
                "; the controller of a {name} uses {} ({})",
                known.believed_m_s2, known.source
            )
        });
        (world_m_s2, format!("the world's{makers}"))
    };
    let settings = GravitySettings {
        world_m_s2,
        world_source: if is_default {
            "standard gravity".to_owned()
        } else {
            format!("{file}: engines")
        },
        believed_m_s2,
        believed_source,
    };
    if settings.is_believed_wrongly() {
        notes.push(format!(
            "the controller assumes a gravity of {believed_m_s2} m/s^2 instead of {world_m_s2} m/s^2: the arm is \
             deflected by the torque difference divided by the position gains"
        ));
    }
    settings
}

/// Gravity in which manufacturers measure their arms, m/s^2: Earth's, whatever a scenario's world has.
pub(super) fn makers_gravity() -> Vector3<f64> {
    down(STANDARD_GRAVITY_M_S2)
}
