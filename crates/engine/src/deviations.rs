//! Where the engines are known to depart from the physics that they stand for.

/// A departure of an engine from the physics, measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownDeviation {
    /// Name of the test that measures it, in `tests/benchmarks/deviations.rs`.
    pub key: &'static str,
    /// `rapier`, `mujoco` or `both`.
    pub engine: &'static str,
    /// What happens, and what needlebench does about it.
    pub description: &'static str,
    /// The measured value lies between these two; below the first, the deviation is gone.
    pub range: [f64; 2],
    /// Unit of the value.
    pub unit: &'static str,
}

/// All known deviations. Each has a test that fails when the value leaves its range: when a new
/// version of an engine mends one, its entry goes, and with it what was done against it.
pub const KNOWN_DEVIATIONS: [KnownDeviation; 6] = [
    KnownDeviation {
        key: "engines_run_half_a_step_early",
        engine: "both",
        description: "semi-implicit Euler gives an arm that starts under an acceleration a whole \
                      step's velocity in the first half step: from then on it is half a step ahead. \
                      Planned motions start without acceleration, and the servo takes its velocity \
                      reference half a step earlier.",
        range: [0.49, 0.51],
        unit: "steps",
    },
    KnownDeviation {
        key: "engines_lag_in_velocity_dependent_forces",
        engine: "both",
        description: "Coriolis and centrifugal forces are those of the velocity half a step \
                      earlier, which makes both engines of first order in the step. 0.6 um at the \
                      tip of a fast motion at 1 ms; smaller steps help.",
        range: [0.3e-6, 1.0e-6],
        unit: "m",
    },
    KnownDeviation {
        key: "mujoco_euler_has_other_coriolis_forces_than_rapier",
        engine: "mujoco",
        description: "MuJoCo's default integrator takes the Coriolis forces explicitly, rapier \
                      with their velocity derivative in the mass matrix: the tips of a fast motion \
                      differ by 1.2 um at 1 ms. needlebench runs MuJoCo with `implicit`, which \
                      leaves 0.09 um.",
        range: [0.6e-6, 2.5e-6],
        unit: "m",
    },
    KnownDeviation {
        key: "rapier_sinks_into_a_contact",
        engine: "rapier",
        description: "a contact is a spring: a ball of 2 kg rests 0.5 um deep at the default \
                      stiffness, although its force is exact.",
        range: [0.3e-6, 0.8e-6],
        unit: "m",
    },
    KnownDeviation {
        key: "mujoco_sinks_into_a_contact",
        engine: "mujoco",
        description: "as in rapier: 0.3 um for a ball of 2 kg at the default stiffness.",
        range: [0.2e-6, 0.5e-6],
        unit: "m",
    },
    KnownDeviation {
        key: "rapier_loses_friction_where_the_point_cannot_yield",
        engine: "rapier",
        description: "a ball on a lever that sweeps it over a table has 0.52 of Coulomb's friction \
                      while it speeds up: the friction along the lever, where nothing can move, \
                      takes its share of the limit. Friction is off by default.",
        range: [0.4, 0.65],
        unit: "of Coulomb's",
    },
];
