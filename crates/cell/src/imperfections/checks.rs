//! Ranges of the imperfections, and those that contradict.

use super::ImperfectionsSection;
use crate::Finding;
use crate::toml_text::TomlText;

/// Least number of markers of a registration.
const MARKERS: usize = 3;

/// Values out of range, and blocks that contradict themselves or the time step (ms).
pub(crate) fn check_imperfections(
    toml: &TomlText<'_>,
    section: &ImperfectionsSection,
    timestep_ms: f64,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut range = |key: &str, value: f64, (least, most): (f64, f64), unit: &str| {
        if !(least..=most).contains(&value) {
            let key = format!("imperfections.{key}");
            let finding = toml.finding(
                &key,
                format!("`{key}` is {value} {unit}, outside {least} to {most}"),
            );
            findings.push(finding.hint(format!("the value is in {unit}")));
        }
    };
    let mut each = |key: &str, values: &[f64], limits: (f64, f64), unit: &str| {
        for (i, value) in values.iter().enumerate() {
            range(&format!("{key}[{i}]"), *value, limits, unit);
        }
    };
    if let Some(block) = &section.encoder {
        each(
            "encoder.resolution_deg",
            &block.resolution_deg,
            (0.0, 1.0),
            "deg",
        );
        each("encoder.noise_deg", &block.noise_deg, (0.0, 0.1), "deg");
        each(
            "encoder.zero_spread_deg",
            &block.zero_spread_deg,
            (0.0, 2.0),
            "deg",
        );
    }
    if let Some(block) = &section.elasticity {
        each(
            "elasticity.stiffness_nm_rad",
            &block.stiffness_nm_rad,
            (100.0, 1e9),
            "N m/rad",
        );
        each("elasticity.spread", &[block.spread], (0.0, 0.3), "(share)");
    }
    if let Some(block) = &section.payload {
        each(
            "payload.mass_error_kg",
            &[block.mass_error_kg],
            (-3.0, 3.0),
            "kg",
        );
        each(
            "payload.mass_spread_kg",
            &[block.mass_spread_kg],
            (0.0, 1.0),
            "kg",
        );
        each(
            "payload.com_error_mm",
            &block.com_error_mm,
            (-300.0, 300.0),
            "mm",
        );
        each(
            "payload.com_spread_mm",
            &[block.com_spread_mm],
            (0.0, 100.0),
            "mm",
        );
    }
    if let Some(block) = &section.friction {
        each("friction.coulomb_nm", &block.coulomb_nm, (0.0, 50.0), "N m");
        each(
            "friction.stiction_nm",
            &block.stiction_nm,
            (0.0, 60.0),
            "N m",
        );
        each(
            "friction.stribeck_deg_s",
            &block.stribeck_deg_s,
            (0.01, 100.0),
            "deg/s",
        );
        each(
            "friction.viscous_nms_rad",
            &block.viscous_nms_rad,
            (0.0, 100.0),
            "N m s/rad",
        );
        each(
            "friction.bristle_stiffness_nm_rad",
            &block.bristle_stiffness_nm_rad,
            (100.0, 1e7),
            "N m/rad",
        );
        each(
            "friction.bristle_damping_nms_rad",
            &block.bristle_damping_nms_rad,
            (0.0, 1e4),
            "N m s/rad",
        );
        each(
            "friction.compensation",
            &[block.compensation],
            (0.0, 1.0),
            "(share)",
        );
        each("friction.spread", &[block.spread], (0.0, 0.3), "(share)");
    }
    if let Some(block) = &section.torque_limits {
        each(
            "torque_limits.drive_nm",
            &block.drive_nm,
            (0.1, 1000.0),
            "N m",
        );
    }
    if let Some(block) = &section.control {
        each(
            "control.period_ms",
            &[block.period_ms],
            (0.01, 1000.0),
            "ms",
        );
        each("control.delay_ms", &[block.delay_ms], (0.0, 1000.0), "ms");
        each(
            "control.torque_delay_ms",
            &[block.torque_delay_ms],
            (0.0, 100.0),
            "ms",
        );
    }
    if let Some(clearance_mm) = section
        .guide
        .as_ref()
        .and_then(|each| each.diametral_clearance_mm)
    {
        each(
            "guide.diametral_clearance_mm",
            &[clearance_mm],
            (0.0, 5.0),
            "mm",
        );
    }
    if let Some(block) = &section.registration {
        for (i, marker) in block.markers_mm.iter().enumerate() {
            each(
                &format!("registration.markers_mm[{i}]"),
                marker,
                (-2000.0, 2000.0),
                "mm",
            );
        }
        each(
            "registration.localisation_error_mm",
            &[block.localisation_error_mm],
            (0.0, 20.0),
            "mm",
        );
    }
    if let Some(block) = &section.breathing {
        each("breathing.skin_mm", &block.skin_mm, (-60.0, 60.0), "mm");
        each("breathing.target_mm", &block.target_mm, (-60.0, 60.0), "mm");
        each("breathing.period_s", &[block.period_s], (0.5, 60.0), "s");
        each(
            "breathing.phase",
            &[block.phase],
            (0.0, 1.0),
            "(share of a breath)",
        );
        each(
            "breathing.phase_spread",
            &[block.phase_spread],
            (0.0, 0.5),
            "(share of a breath)",
        );
    }
    if let Some(block) = &section.calibration {
        each("calibration.scale", &[block.scale], (0.0, 10.0), "(factor)");
    }
    if let Some(samples) = section.budget_samples {
        each(
            "budget_samples",
            &[f64::from(samples)],
            (0.0, 1e7),
            "samples",
        );
    }

    if let Some(block) = &section.friction {
        for (i, (stiction, coulomb)) in block.stiction_nm.iter().zip(&block.coulomb_nm).enumerate()
        {
            if stiction < coulomb {
                findings.push(
                    toml.finding(
                        &format!("imperfections.friction.stiction_nm[{i}]"),
                        format!(
                            "the break-away torque of {stiction} N m is below the sliding \
                             friction of {coulomb} N m"
                        ),
                    )
                    .hint("a joint at rest holds at least what it takes to keep it sliding"),
                );
            }
        }
    }
    if let Some(block) = &section.control
        && block.period_ms < timestep_ms
    {
        findings.push(
            toml.finding(
                "imperfections.control.period_ms",
                format!(
                    "set-points every {} ms are closer than the time step of {timestep_ms} ms",
                    block.period_ms
                ),
            )
            .hint("leave the block out for a servo that sees the trajectory in every step"),
        );
    }
    if let Some(block) = &section.registration {
        let key = "imperfections.registration.markers_mm";
        if block.markers_mm.len() < MARKERS {
            findings.push(
                toml.finding(
                    key,
                    format!("{} markers are too few", block.markers_mm.len()),
                )
                .hint("a rigid registration needs three that are not on one line"),
            );
        } else if is_on_a_line(&block.markers_mm) {
            findings.push(
                toml.finding(key, "the markers lie on one line")
                    .hint("the phantom could turn about it: move one of them away"),
            );
        }
    }
    findings
}

/// Sine of the angle between two edges below which markers count as on a line.
const LINE_SINE: f64 = 0.01;

fn is_on_a_line(markers_mm: &[[f64; 3]]) -> bool {
    let points = markers_mm.iter().map(|mm| nalgebra::Vector3::from(*mm));
    let first = nalgebra::Vector3::from(markers_mm[0]);
    let edges: Vec<_> = points.map(|point| point - first).collect();
    let longest = edges
        .iter()
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))
        .copied()
        .unwrap_or_default();
    edges
        .iter()
        .all(|edge| edge.cross(&longest).norm() <= LINE_SINE * longest.norm_squared())
}
