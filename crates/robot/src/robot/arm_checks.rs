//! What the numbers of an arm's moving joints and links can be.

use needlebench_input::Finding;
use needlebench_input::schema::written;
use needlebench_kinematics::{Body, JointLimit};

use super::urdf::{JointKind, Urdf, UrdfJoint, UrdfLink};

/// Longest way from one joint of an arm to the next, m: 0.86 m in a UR20.
const LONGEST_LINK_M: f64 = 1.25;
/// Largest mass of a moving link, kg: a UR20 weighs 64 kg as a whole.
const LARGEST_MASS_KG: f64 = 100.0;
/// Least mass of a moving link, kg.
const LEAST_MASS_KG: f64 = 1e-3;
/// Least radius of gyration of a moving link, m: that of a ball of 0.3 mm.
const LEAST_GYRATION_M: f64 = 1e-4;
/// Largest distance of a link's centre of mass from its joint, m.
const FARTHEST_CENTRE_M: f64 = 1.5;
/// Torques that an arm's drive can have, N m: 738 in a UR20.
const EFFORTS_NM: [f64; 2] = [0.1, 2000.0];
/// Speeds that an arm's joint can have, rad/s: 2 pi in a UR3's wrist.
const VELOCITIES_RAD_S: [f64; 2] = [1e-3, 20.0];

/// Refuses a joint of the arm that is farther from the one before than any arm's.
pub(super) fn check_origin(urdf: &Urdf, joint: &UrdfJoint) -> Result<(), Finding> {
    let length_m = joint.parent_from_joint.translation.vector.norm();
    if length_m <= LONGEST_LINK_M {
        return Ok(());
    }
    let message = format!(
        "the origin of joint '{}' is {length_m:.3} m from its parent's, more than {LONGEST_LINK_M} m",
        joint.name
    );
    Err(urdf
        .finding(&joint.origin_span, message)
        .key(format!("joint '{}'", joint.name))
        .hint("lengths of a URDF are in metres: did you give millimetres or centimetres?"))
}

/// The limits of a joint of the arm.
pub(super) fn joint_limit(urdf: &Urdf, joint: &UrdfJoint) -> Result<JointLimit, Finding> {
    let name = &joint.name;
    let refuse = |message: String| {
        urdf.finding(&joint.limit_span, message)
            .key(format!("joint '{name}'"))
    };
    let Some(limit) = joint.limit else {
        return Err(refuse(format!("joint '{name}' has no <limit>")).hint(
            "it needs effort (N m), velocity (rad/s) and, if revolute, lower and upper (rad)",
        ));
    };
    let (lower_rad, upper_rad) = if joint.kind == JointKind::Continuous {
        (f64::NEG_INFINITY, f64::INFINITY)
    } else {
        for (key, is_given) in ["lower", "upper"].into_iter().zip(limit.has_range) {
            if !is_given {
                return Err(
                    refuse(format!("the <limit> of joint '{name}' has no `{key}`"))
                        .hint("a revolute joint needs lower and upper, in radians"),
                );
            }
        }
        (limit.lower, limit.upper)
    };
    // The controller lets the joint go no farther.
    let [soft_lower, soft_upper] = joint.soft.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let (lower_rad, upper_rad) = (lower_rad.max(soft_lower), upper_rad.min(soft_upper));
    for (key, value, [least, most], unit, hint) in [
        (
            "velocity",
            limit.velocity,
            VELOCITIES_RAD_S,
            "rad/s",
            "speeds of a URDF are in rad/s: did you give degrees?",
        ),
        (
            "effort",
            limit.effort,
            EFFORTS_NM,
            "N m",
            "torques of a URDF are in N m: 28 to 56 in a UR3",
        ),
    ] {
        if !(least..=most).contains(&value) {
            let message = format!(
                "the {key} limit of joint '{name}' is {} {unit}, outside {} to {}",
                written(value),
                written(least),
                written(most)
            );
            return Err(refuse(message).hint(hint));
        }
    }
    if lower_rad >= upper_rad {
        return Err(refuse(format!(
            "the limits of joint '{name}' are not a range: {} to {} rad",
            written(lower_rad),
            written(upper_rad)
        )));
    }
    Ok(JointLimit {
        lower_rad,
        upper_rad,
        velocity_rad_s: limit.velocity,
        effort_nm: limit.effort,
    })
}

/// Refuses a moving link whose mass no arm's link has; `members` are the links of the file that it is
/// made of, and `body` all of them together.
pub(super) fn check_body(
    urdf: &Urdf,
    label: &str,
    members: &[&UrdfLink],
    body: &Body,
) -> Result<(), Finding> {
    let mass_of = |link: &UrdfLink| link.inertial.map_or(0.0, |body| body.mass_kg);
    let heaviest = members
        .iter()
        .max_by(|a, b| mass_of(a).total_cmp(&mass_of(b)));
    let Some(heaviest) = heaviest else {
        return Ok(());
    };
    let mass_kg = body.mass_kg;
    let smallest = body.inertia_kgm2.symmetric_eigenvalues().min();
    let gyration_m = (smallest / mass_kg).max(0.0).sqrt();
    let centre_m = body.com_m.norm();
    let (message, hint) = if !(LEAST_MASS_KG..=LARGEST_MASS_KG).contains(&mass_kg) {
        (
            format!(
                "{label} weighs {} kg, outside {} to {LARGEST_MASS_KG}",
                written(mass_kg),
                written(LEAST_MASS_KG)
            ),
            "masses of a URDF are in kilograms; a UR20 weighs 64 kg as a whole",
        )
    } else if gyration_m < LEAST_GYRATION_M {
        (
            format!(
                "{label} has {mass_kg:.3} kg with a moment of inertia of {smallest:.1e} kg m^2 only: a body \
                 thinner than {:.1} mm",
                LEAST_GYRATION_M * 1e3
            ),
            "moments of inertia of a URDF are in kg m^2",
        )
    } else if centre_m > FARTHEST_CENTRE_M {
        (
            format!(
                "the centre of mass of {label} is {centre_m:.3} m from its joint, more than \
                 {FARTHEST_CENTRE_M} m"
            ),
            "lengths of a URDF are in metres: did you give millimetres?",
        )
    } else {
        return Ok(());
    };
    Err(urdf
        .finding(&heaviest.mass_span, message)
        .key(format!("link '{}'", heaviest.name))
        .hint(hint))
}
