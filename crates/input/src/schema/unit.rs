//! Units, from the ends of keys.

/// Ends of keys, how their units are written, and in words where that is not the same; longer ends
/// first.
const UNITS: [(&str, &str, &str); 21] = [
    ("_mm_s3", "mm/s^3", ""),
    ("_mm_s2", "mm/s^2", ""),
    ("_mm_s", "mm/s", ""),
    ("_deg_s3", "deg/s^3", ""),
    ("_deg_s2", "deg/s^2", ""),
    ("_deg_s", "deg/s", ""),
    ("_nms_rad", "N m s/rad", ""),
    ("_nm_rad", "N m/rad", ""),
    ("_kgm2", "kg m^2", ""),
    ("_per_s2", "1/s^2", ""),
    ("_per_s", "1/s", ""),
    ("_mm2", "mm^2", "square millimetres"),
    ("_mm", "mm", "millimetres"),
    ("_um", "um", "micrometres"),
    ("_deg", "deg", "degrees"),
    ("_rad", "rad", "radians"),
    ("_ms", "ms", "milliseconds"),
    ("_kg", "kg", "kilograms"),
    ("_hz", "Hz", "hertz"),
    ("_nm", "N m", "newton metres"),
    ("_s", "s", "seconds"),
];

/// Ends of keys that count something, and what.
const COUNTS: [(&str, &str); 4] = [
    ("samples", "samples"),
    ("steps", "steps"),
    ("sweeps", "sweeps"),
    ("cycles", "cycles"),
];

/// Unit that a key ends with or is, such as `mm` of `standoff_mm` and `kg`; empty if it has none.
pub fn unit_of(key: &str) -> &'static str {
    let found = (UNITS.iter()).find(|(end, ..)| key.ends_with(end) || end[1..] == *key);
    found.map_or("", |(_, unit, _)| unit)
}

/// A number with all its digits and no more zeros than one can count: 1e308, 0.5, 1e-9.
pub fn written(number: f64) -> String {
    let is_short = number == 0.0 || (1e-4..1e7).contains(&number.abs());
    if is_short || !number.is_finite() {
        number.to_string()
    } else {
        format!("{number:e}")
    }
}

/// Unit or things counted, as messages write it after a number.
pub(super) fn written_after(key: &str) -> &'static str {
    let counts = COUNTS.iter().find(|(end, _)| key.ends_with(end));
    counts.map_or_else(|| unit_of(key), |(_, counted)| counted)
}

/// A unit in words, for those who wonder.
pub(super) fn in_words(unit: &str) -> &str {
    let found = UNITS.iter().find(|(_, written, _)| *written == unit);
    found.map_or(
        unit,
        |(_, _, words)| {
            if words.is_empty() { unit } else { words }
        },
    )
}

/// Key without its unit; keys of one quantity in two units have the same.
pub(super) fn quantity(key: &str) -> &str {
    /// Units that people write besides those that keys have.
    const MORE: [&str; 3] = ["_m", "_cm", "_um"];
    let known = UNITS.iter().map(|(end, ..)| *end);
    known
        .chain(MORE)
        .find_map(|end| key.strip_suffix(end))
        .unwrap_or(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longer_ends_come_before_their_tails() {
        for (index, (end, ..)) in UNITS.iter().enumerate() {
            let earlier = UNITS[..index].iter();
            let hides = earlier.filter(|(other, ..)| end.ends_with(other));
            assert_eq!(hides.count(), 0, "{end}");
        }
        assert_eq!(unit_of("joint_jerk_deg_s3"), "deg/s^3");
        assert_eq!(unit_of("contact_damping_per_s"), "1/s");
        assert_eq!(unit_of("urdf"), "");
        assert_eq!(unit_of("kg"), "kg");
        assert_eq!(unit_of("symptoms"), "");
        assert_eq!(written_after("roll_samples"), "samples");
    }

    #[test]
    fn one_quantity_is_known_in_any_unit() {
        for key in ["standoff_mm", "standoff_m", "standoff_cm", "standoff"] {
            assert_eq!(quantity(key), "standoff");
        }
        assert_ne!(quantity("hold_ss"), quantity("hold_s"));
    }
}
