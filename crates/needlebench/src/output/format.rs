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

/// A value of a rejection or criterion in the unit that people use.
pub(crate) fn value_with_unit(value: f64, unit: &str) -> String {
    match unit {
        "m" if value.abs() < 1e-3 && value != 0.0 => small_length(value),
        "m" => format!("{:.1} mm", value * 1e3),
        "rad" => format!("{:.3} deg", value.to_degrees()),
        "1" => format!("{value:.4}"),
        unit => format!("{value:.3} {unit}"),
    }
}
