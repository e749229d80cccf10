//! Imperfections of a scenario: those that are simulated, and those that the RMS tip error is predicted from.

use std::path::Path;

use nalgebra::Vector3;
use needlebench_cell::Tool;
use needlebench_input::{Finding, TomlText};
use needlebench_robot::LoadedRobot;

use super::arm_values::gear_twist;
use super::gravity::makers_gravity;
use super::imperfections::{Elasticity, Given, Imperfections, resolve_imperfections};
use super::library::ModelLibrary;
use crate::scenario::{ArmClass, BreathState, IN_EXPECTED, ImperfectionsSection, Scenario};

/// The arm and patient population of the RMS tip error.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// The class of arm; none where the scenario's own `[imperfections]` say it all.
    pub class: Option<ArmClass>,
    /// Whether the breath is held.
    pub breath: BreathState,
    /// Their deviations from the controller's model.
    pub imperfections: Imperfections,
}

/// What imperfections are resolved with.
pub(crate) struct RealThings<'a> {
    pub toml: &'a TomlText<'a>,
    pub library: &'a ModelLibrary,
    pub robot: &'a LoadedRobot,
    pub tool: &'a Tool,
    pub base: &'a Path,
    pub timestep_ms: f64,
    /// Of the world.
    pub gravity_m_s2: f64,
    /// No needle is expected anywhere, now or later.
    pub has_no_goals: bool,
}

impl RealThings<'_> {
    /// The imperfections of a section whose needle's block stands at a place.
    pub fn resolve(
        &self,
        section: &ImperfectionsSection,
        needle_place: &str,
        notes: &mut Vec<String>,
    ) -> Result<Imperfections, Finding> {
        let block = section.calibration.as_ref();
        let arms = block.map(|block| {
            self.library
                .real_arms(self.toml, block, self.robot, self.base)
        });
        let arms = arms.transpose()?;
        let elasticity = section.elasticity.as_ref().map(|elastic| {
            let gears = gear_twist(self.toml, elastic, self.robot)?;
            let measured = block.filter(|block| block.measured_under_gravity);
            Ok(Elasticity {
                absorbed: measured.map(|block| {
                    let carried = block.class() == ArmClass::CalibratedHere;
                    let tool = carried.then_some(self.tool);
                    // Makers measure their arms upright; one that is measured here stands or hangs as it
                    // does here.
                    let gravity_m_s2 = if carried {
                        let here = Vector3::new(0.0, 0.0, -self.gravity_m_s2);
                        self.robot.world_from_base_link.rotation.inverse() * here
                    } else {
                        makers_gravity()
                    };
                    self.library
                        .absorbed_sag(self.robot, tool, &gears, gravity_m_s2)
                }),
                gears,
                spread: elastic.spread,
            })
        });
        let breathing = section.breathing.as_ref();
        let files = breathing.and_then(|block| block.recordings.as_deref());
        let recorded = files.map(|files| self.library.recorded_breath(self.toml, files, self.base));
        let recorded = recorded.transpose()?;
        let given = Given {
            toml: self.toml,
            needle_place,
            base: self.base,
            robot: self.robot,
            tool: self.tool,
            timestep_ms: self.timestep_ms,
            arms: arms.as_deref(),
            recorded: recorded.as_deref(),
        };
        let resolved = resolve_imperfections(&given, section, elasticity.transpose()?, notes)?;
        notes.extend(arms.iter().flat_map(|arms| arms.notes.iter().cloned()));
        Ok(resolved)
    }

    /// What the RMS tip error of a scenario is predicted from: its own imperfections, else those of its class of
    /// arm.
    pub fn expected(
        &self,
        scenario: &Scenario,
        own: Option<&Imperfections>,
        notes: &mut Vec<String>,
    ) -> Result<Option<Expected>, Finding> {
        let section = &scenario.expected;
        let is_calibrated = self.robot.description.calibration.is_some();
        if section.arm == Some(ArmClass::CalibratedHere) && !is_calibrated {
            let finding = self
                .toml
                .finding("expected.arm", "the scenario has no calibration");
            return Err(finding.hint(
                "`calibration` under [robot] or `--calibration FILE`; `factory_calibrated` is an arm \
                 with the manufacturer's calibration",
            ));
        }
        if let Some(own) = own {
            if section.arm.is_some() {
                let finding = self
                    .toml
                    .finding("expected.arm", "`arm` contradicts [imperfections]");
                return Err(finding.hint(
                    "the RMS tip error is computed from [imperfections]: set `class` under \
                     [imperfections.calibration] instead",
                ));
            }
            let free = own
                .breathing
                .is_some_and(|each| each.phase_spread.is_none());
            return Ok(Some(Expected {
                class: None,
                breath: if free {
                    BreathState::Free
                } else {
                    BreathState::Hold
                },
                imperfections: own.clone(),
            }));
        }
        if self.has_no_goals {
            return Ok(None);
        }
        let class = section.arm.unwrap_or(if is_calibrated {
            ArmClass::CalibratedHere
        } else {
            ArmClass::FactoryCalibrated
        });
        let mut blocks = ImperfectionsSection::of_class(class, section.breath);
        if let Some(registration) = &section.registration {
            blocks.registration = Some(registration.clone());
            if registration.covariance_mm2.is_some() {
                blocks.hand_eye = None;
            }
        }
        if let Some(imaging) = &section.imaging {
            blocks.imaging = Some(imaging.clone());
        }
        if let Some(needle) = &section.needle {
            blocks.needle = Some(needle.clone());
        }
        match self.resolve(&blocks, IN_EXPECTED, notes) {
            Ok(imperfections) => Ok(Some(Expected {
                class: Some(class),
                breath: section.breath,
                imperfections,
            })),
            // What the scenario itself requires must be possible.
            Err(finding) if section.arm.is_some() || section.needle.is_some() => Err(finding),
            Err(finding) => {
                notes.push(format!("no RMS tip error: {}", finding.message));
                Ok(None)
            }
        }
    }
}
