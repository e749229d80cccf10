//! Numbers as people read them.

/// A length that may span from picometres to millimetres, with its unit.
pub(crate) fn small_length(metres: f64) -> String {
    let magnitude = metres.abs();
    if magnitude >= 1e-3 {
        format!("{:.2} mm", metres * 1e3)
    } else if magnitude >= 1e-6 {
        format!("{:.2} um", metres * 1e6)
    } else if magnitude >= 1e-9 {
        format!("{:.2} nm", metres * 1e9)
    } else if magnitude >= 1e-12 {
        format!("{:.2} pm", metres * 1e12)
    } else {
        "< 1 pm".to_owned()
    }
}

/// Millimetres with one decimal.
pub(crate) fn millimetres(metres: f64) -> String {
    format!("{:.1}", metres * 1e3)
}

/// A value and its limit, both in the same unit that people use.
pub(crate) fn value_and_limit(value: f64, limit: f64, unit: &str) -> (String, String) {
    let text = |value: f64| match unit {
        // Limits of accuracy are far below those of clearance.
        "m" if limit != 0.0 && limit.abs() < 1e-3 => small_length(value),
        "m" => format!("{:.2} mm", value * 1e3),
        "rad" => format!("{:.4} deg", value.to_degrees()),
        "1" if value.fract() == 0.0 && limit.fract() == 0.0 => format!("{value}"),
        "1" => format!("{value:.4}"),
        unit => format!("{value:.3} {unit}"),
    };
    (text(value), text(limit))
}
