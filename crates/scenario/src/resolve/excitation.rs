//! An excitation run, in SI units.

use nalgebra::{Matrix3, Vector3};
use needlebench_cell::Tool;
use needlebench_geometry::{Shape, Solid};
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::{Body, JOINT_LABELS, Joints, Pose};
use needlebench_robot::LoadedRobot;

use crate::scenario::{PayloadSection, Scenario};

pub use crate::scenario::{ExcitationSection, SweepSection};

/// Fewest postures of which a calibration is worth anything: twice as many equations as its 30 unknowns.
pub const FEWEST_POSTURES: usize = 10;

/// Density of a payload without a given size: steel, kg/m^3.
const DENSITY_KG_M3: f64 = 7850.0;

/// The run in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcitationProtocol {
    /// Postures in the order in which they are visited, rad.
    pub postures: Vec<Joints>,
    /// Stand at each, s.
    pub dwell_s: f64,
    /// Speeds of the leading joint between postures, in turn, rad/s.
    pub speeds_rad_s: Vec<f64>,
    /// Motions of one joint alone.
    pub sweeps: Vec<Sweep>,
    /// Their speeds, rad/s.
    pub sweep_speeds_rad_s: Vec<f64>,
    /// What the whole run is made with, one after the other.
    pub loads: Vec<Load>,
    /// Time between two rows of the log, s.
    pub period_s: f64,
    /// Least proven clearance from everything else, m.
    pub clearance_m: f64,
    /// Least proven clearance from itself, m.
    pub self_clearance_m: f64,
}

/// A motion of one joint away from a posture and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// The joint, from 0.
    pub joint: usize,
    /// The posture, from 1; 0 for the start.
    pub posture: usize,
    /// By how much it moves, rad.
    pub by_rad: f64,
}

/// What is mounted at the flange besides the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Mass and centre in the flange frame.
    pub body: Body,
    /// Edges of the box around it along the axes of the flange, m; none without mass.
    pub size_m: Option<Vector3<f64>>,
}

impl Load {
    /// A load as a section has it, with what the section leaves out.
    pub fn of(section: &PayloadSection) -> Self {
        let mass_kg = section.mass_kg;
        if mass_kg == 0.0 {
            return Self {
                body: Body::massless(),
                size_m: None,
            };
        }
        let size_m = section.size_mm.map_or_else(
            || Vector3::repeat(libm::cbrt(mass_kg / DENSITY_KG_M3)),
            |mm| Vector3::from(mm) * 1e-3,
        );
        let com_m = section
            .centre_mm
            .map_or(Vector3::z() * 0.5 * size_m.z, |mm| Vector3::from(mm) * 1e-3);
        let squares = size_m.component_mul(&size_m);
        let about = Vector3::new(
            squares.y + squares.z,
            squares.x + squares.z,
            squares.x + squares.y,
        );
        Self {
            body: Body {
                mass_kg,
                com_m,
                inertia_kgm2: Matrix3::from_diagonal(&(about * (mass_kg / 12.0))),
            },
            size_m: Some(size_m),
        }
    }

    /// The tool with this load, in the flange frame.
    pub fn with_tool(&self, tool: &Tool) -> Body {
        if self.body.mass_kg == 0.0 {
            tool.body
        } else {
            tool.body.combined_with(&self.body)
        }
    }
}

/// The run of a checked section; gives the tool the boxes around its payloads.
pub(crate) fn resolve_excitation(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    section: &ExcitationSection,
    robot: &LoadedRobot,
    tool: &mut Tool,
    notes: &mut Vec<String>,
) -> Result<ExcitationProtocol, Finding> {
    let postures: Vec<Joints> = section
        .postures_deg
        .iter()
        .map(|deg| Joints::from(deg.map(f64::to_radians)))
        .collect();
    for (index, posture) in postures.iter().enumerate() {
        let key = format!("excitation.postures_deg[{index}]");
        inside(
            toml,
            robot,
            posture,
            &key,
            &format!("at posture {}", index + 1),
        )?;
    }
    for (list, speeds) in [
        ("speeds_deg_s", &section.speeds_deg_s),
        ("sweep_speeds_deg_s", &section.sweep_speeds_deg_s),
    ] {
        let slowest_deg_s = robot.limits.velocities_rad_s().min().to_degrees();
        if let Some(at) = speeds.iter().position(|&speed| speed > slowest_deg_s) {
            let message = format!(
                "{} deg/s is above the limit of {slowest_deg_s:.0} deg/s of a joint of this arm",
                speeds[at]
            );
            return Err(toml
                .finding(&format!("excitation.{list}[{at}]"), message)
                .hint("any of the six joints may be the leading one"));
        }
    }
    let loads: Vec<Load> = section.payloads.iter().map(Load::of).collect();
    let rated = robot
        .description
        .arm
        .as_ref()
        .and_then(|used| used.arm.data.payload.as_ref());
    for (index, load) in loads.iter().enumerate() {
        let whole_kg = load.with_tool(tool).mass_kg;
        if let Some(rated) = rated.filter(|rated| whole_kg > rated.kg) {
            let message = format!(
                "{} kg with the tool's {:.3} kg is {whole_kg:.3} kg, above the arm's rated load of {} kg",
                load.body.mass_kg, tool.body.mass_kg, rated.kg
            );
            return Err(toml
                .finding(&format!("excitation.payloads[{index}].mass_kg"), message)
                .hint("the payload excludes the tool"));
        }
    }
    if rated.is_none() {
        notes.push("payloads are not checked: the arm data give no rated load".to_owned());
    }
    if postures.len() < FEWEST_POSTURES {
        notes.push(format!(
            "{} postures: a calibration with fewer than {FEWEST_POSTURES} may reduce the accuracy",
            postures.len()
        ));
    }
    let known = robot
        .description
        .arm
        .as_ref()
        .and_then(|used| used.arm.data.control.as_ref());
    let period_ms = section
        .period_ms
        .or(known.map(|control| control.period_ms))
        .ok_or_else(|| {
            toml.finding(
                "excitation.period_ms",
                "`period_ms` is required: the arm data give no controller period",
            )
            .hint("8 ms suits every controller")
        })?;
    let timestep_ms = scenario.engines.timestep_ms;
    if period_ms < timestep_ms {
        let message = format!(
            "the sampling period of {period_ms} ms is below the time step of {timestep_ms} ms"
        );
        return Err(toml
            .finding("excitation.period_ms", message)
            .hint("use at least `timestep_ms` under [engines]"));
    }
    let sweeps: Vec<Sweep> = section
        .sweeps
        .iter()
        .map(|sweep| Sweep {
            joint: JOINT_LABELS
                .iter()
                .position(|label| *label == sweep.joint)
                .expect("the schema has the six joints"),
            posture: sweep.posture,
            by_rad: sweep.by_deg.to_radians(),
        })
        .collect();
    for (index, load) in loads.iter().enumerate() {
        if let Some(size_m) = load.size_m {
            tool.solids.push(Solid {
                name: format!("payload_{}", index + 1),
                shape: Shape::Cuboid {
                    half_extents_m: 0.5 * size_m,
                },
                parent_from_shape: Pose::from(load.body.com_m),
            });
        }
    }
    if loads.iter().filter(|load| load.size_m.is_some()).count() > 0 && loads.len() > 1 {
        notes.push(
            "clearances are of arm, tool and the boxes around all payloads, whichever is mounted"
                .to_owned(),
        );
    }
    Ok(ExcitationProtocol {
        postures,
        dwell_s: section.dwell_s,
        speeds_rad_s: section
            .speeds_deg_s
            .iter()
            .map(|deg| deg.to_radians())
            .collect(),
        sweeps,
        sweep_speeds_rad_s: section
            .sweep_speeds_deg_s
            .iter()
            .map(|deg| deg.to_radians())
            .collect(),
        loads,
        period_s: period_ms * 1e-3,
        clearance_m: section.clearance_mm * 1e-3,
        self_clearance_m: section.self_clearance_mm * 1e-3,
    })
}

/// Refuses a sweep that leaves the joints' ranges; the start posture is known only when the arm is placed.
pub(crate) fn check_sweeps(
    toml: &TomlText<'_>,
    protocol: &ExcitationProtocol,
    robot: &LoadedRobot,
    start: &Joints,
) -> Result<(), Finding> {
    for (index, sweep) in protocol.sweeps.iter().enumerate() {
        let key = format!("excitation.sweeps[{index}].by_deg");
        let end = protocol.sweep_end(sweep, start);
        inside(toml, robot, &end, &key, "at its end")?;
    }
    Ok(())
}

impl ExcitationProtocol {
    /// A posture by its number, 0 for the start.
    pub fn posture(&self, number: usize, start: &Joints) -> Joints {
        match number.checked_sub(1) {
            None => *start,
            Some(index) => self.postures[index],
        }
    }

    /// Where a sweep turns.
    pub fn sweep_end(&self, sweep: &Sweep, start: &Joints) -> Joints {
        let mut end = self.posture(sweep.posture, start);
        end[sweep.joint] += sweep.by_rad;
        end
    }
}

fn inside(
    toml: &TomlText<'_>,
    robot: &LoadedRobot,
    posture: &Joints,
    key: &str,
    place: &str,
) -> Result<(), Finding> {
    let Some(joint) = robot.limits.first_violation(posture) else {
        return Ok(());
    };
    let limit = robot.limits.0[joint];
    let message = format!(
        "{} is at {:.1} deg {place}, outside {:.1} to {:.1} deg",
        JOINT_LABELS[joint],
        posture[joint].to_degrees(),
        limit.lower_rad.to_degrees(),
        limit.upper_rad.to_degrees()
    );
    Err(toml
        .finding(key, message)
        .hint("this is the arm's joint range: see `needlebench servo SCENARIO` and its URDF"))
}
