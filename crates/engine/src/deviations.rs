//! Where the engines are known to depart from the physics that they stand for.

/// A departure of an engine from the physics, with the law that its size follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownDeviation {
    /// Name of the test that measures it, in `tests/benchmarks/deviations.rs`.
    pub key: &'static str,
    /// `rapier`, `mujoco` or `both`.
    pub engine: &'static str,
    /// What happens, and what needlebench does about it.
    pub description: &'static str,
    /// How large it has to be: the law by which the test computes it, or the word that there is none.
    pub law: &'static str,
    /// How far the measured size may be from that, as a share of it.
    pub tolerance: f64,
}

/// All known deviations. Each has a test that fails when its size is not the one of its law: when a new
/// version of an engine mends one, its entry goes, and with it what was done against it.
pub const KNOWN_DEVIATIONS: [KnownDeviation; 6] = [
    KnownDeviation {
        key: "engines_run_half_a_step_early",
        engine: "both",
        description: "semi-implicit Euler gives an arm that starts under an acceleration a whole \
                      step's velocity in the first half step: from then on it is half a step ahead. \
                      Planned motions start without acceleration, and the servo takes its velocity \
                      reference half a step earlier.",
        law: "h^2 a (1 + 2 + .. + n) is a t^2 / 2 + a t h / 2: half a step, but for the change of a pendulum's \
              acceleration",
        tolerance: 1e-3,
    },
    KnownDeviation {
        key: "engines_lead_in_velocity_dependent_forces",
        engine: "both",
        description: "rapier, and MuJoCo's integrator `implicit`, take Coriolis and centrifugal forces with \
                      their slope in the velocity over a whole step, so they are those of half a step later, \
                      which makes both engines of first order in the step. 0.6 um at the tip of a fast motion \
                      at 1 ms; smaller steps help.",
        law: "the reference integrator with these forces half a step ahead: M a = torque - b(q, v + \
             h a / 2); other first-order terms in the step are 4 % of the peak",
        tolerance: 0.06,
    },
    KnownDeviation {
        key: "mujoco_euler_has_other_coriolis_forces_than_rapier",
        engine: "mujoco",
        description: "MuJoCo's default integrator takes the Coriolis forces of half a step earlier: the tips of a \
                      fast motion differ by 1.2 um from rapier's at 1 ms. needlebench runs MuJoCo with \
                      `implicit`, which leaves 0.09 um.",
        law: "the reference integrator with these forces half a step behind, compared with them \
             half a step ahead",
        tolerance: 0.06,
    },
    KnownDeviation {
        key: "rapier_sinks_into_a_contact",
        engine: "rapier",
        description: "a contact is a spring: a ball of 2 kg rests at 0.5 um penetration at the default \
             stiffness, although its force is exact.",
        law: "F / (m w^2): m the inertia that the contact meets along its normal, w the contact's natural \
              frequency",
        tolerance: 1e-3,
    },
    KnownDeviation {
        key: "mujoco_sinks_into_a_contact",
        engine: "mujoco",
        description: "as in rapier: 0.3 um for a ball of 2 kg at the default stiffness.",
        law: "F W (1 - d) / k: impedance d, stiffness k, and MuJoCo's own estimate W of the inverse inertia at the \
              contact, the mean over three directions of which one cannot move",
        tolerance: 1e-3,
    },
    KnownDeviation {
        key: "rapier_loses_friction_where_the_point_cannot_yield",
        engine: "rapier",
        description: "a ball on a lever that sweeps it over a table has 0.52 of Coulomb's friction \
                      while it speeds up: the friction along the lever, where nothing can move, \
                      takes its share of the limit. Friction is off by default.",
        law: "none: 0.524 was measured with version 0.36; the test only detects changes",
        tolerance: 0.01,
    },
];
