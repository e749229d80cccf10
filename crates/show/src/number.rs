//! Numbers as people read them, in tables, pages and charts alike.

use needlebench_input::digits_apart;

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthUnit {
    /// Its name.
    pub name: &'static str,
    /// How long it is, m.
    pub length_m: f64,
    /// How many make a metre.
    pub per_metre: f64,
}

/// From the picometre to the metre.
const LENGTHS: [LengthUnit; 5] = [
    unit("pm", 1e-12, 1e12),
    unit("nm", 1e-9, 1e9),
    unit("um", 1e-6, 1e6),
    unit("mm", 1e-3, 1e3),
    unit("m", 1.0, 1.0),
];

const fn unit(name: &'static str, length_m: f64, per_metre: f64) -> LengthUnit {
    LengthUnit {
        name,
        length_m,
        per_metre,
    }
}

/// The unit in which lengths up to `largest_m` are read best. Never metres: an arm's lengths are read
/// in millimetres.
pub fn unit_of_length(largest_m: f64) -> LengthUnit {
    let magnitude = largest_m.abs();
    LENGTHS[..4]
        .iter()
        .rev()
        .find(|unit| magnitude >= unit.length_m)
        .copied()
        .unwrap_or(LENGTHS[0])
}

/// A length that may span from picometres to millimetres, with its unit.
pub fn small_length(metres: f64) -> String {
    let unit = unit_of_length(metres);
    if metres.abs() < unit.length_m {
        return format!("< 1 {}", unit.name);
    }
    format!("{:.2} {}", metres * unit.per_metre, unit.name)
}

/// The same; 0 where it is none at all.
pub fn small_length_or_zero(metres: f64) -> String {
    if metres == 0.0 {
        "0".to_owned()
    } else {
        small_length(metres)
    }
}

/// A power of ten of metres, `1 nm` to `100 m`, without decimals.
pub fn decade_of_length(power: i32) -> String {
    let unit = usize::try_from((power + 12).div_euclid(3)).map_or(0, |unit| unit.min(4));
    let unit = LENGTHS[unit];
    let count = 10_f64.powi(power) * unit.per_metre;
    format!("{} {}", rounded(count, 4), unit.name)
}

/// Millimetres with one decimal.
pub fn millimetres(metres: f64) -> String {
    format!("{:.1}", metres * 1e3)
}

/// A value and its limit, both in the same unit that people use; the value with as many digits as show on
/// which side of its limit it is.
pub fn value_and_limit(value: f64, limit: f64, unit: &str) -> (String, String) {
    let text = |value: f64| match unit {
        // Limits of accuracy are far below those of clearance.
        "m" if limit != 0.0 && limit.abs() < 1e-3 => small_length(value),
        "m" => format!("{:.2} mm", value * 1e3),
        "rad" => format!("{:.4} deg", value.to_degrees()),
        "1" if value.fract() == 0.0 && limit.fract() == 0.0 => format!("{value}"),
        "1" => format!("{value:.4}"),
        unit => format!("{value:.3} {unit}"),
    };
    let (shown, bound) = (text(value), text(limit));
    // A limit that reads the same would hide that it is missed.
    if shown == bound && value.partial_cmp(&limit) != Some(std::cmp::Ordering::Equal) {
        let (factor, unit) = match unit {
            "m" => (1e3, " mm".to_owned()),
            "rad" => (1.0_f64.to_degrees(), " deg".to_owned()),
            "1" => (1.0, String::new()),
            unit => (1.0, format!(" {unit}")),
        };
        let digits = digits_apart(value * factor, limit * factor);
        let bound = digits_apart(limit * factor, value * factor);
        return (format!("{digits}{unit}"), format!("{bound}{unit}"));
    }
    (shown, bound)
}

/// At most so many decimals, without trailing zeros and without a minus before zero.
pub fn rounded(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if text == "-0" { "0" } else { text }.to_owned()
}

/// A value of an axis whose ticks are `step` apart, with the decimals that tell them apart.
pub fn tick(value: f64, step: f64) -> String {
    // Rounding leaves something of a zero.
    let value = if value.abs() < 1e-9 * step {
        0.0
    } else {
        value
    };
    if !(1e-6..1e7).contains(&step) {
        return format!("{value:e}");
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 6: the step's decade is bounded above"
    )]
    let decimals = (-libm::log10(step * 1.000_001).floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// `10` with the power as superscript characters.
pub fn power_of_ten(power: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = power.unsigned_abs().to_string();
    let digits = digits
        .bytes()
        .map(|digit| RAISED[usize::from(digit - b'0')]);
    let sign = (power < 0).then_some('⁻');
    "10".chars().chain(sign).chain(digits).collect()
}

/// A number of any size in few characters.
pub fn short(value: f64) -> String {
    if value.is_nan() {
        "-".to_owned()
    } else if value == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e3).contains(&value.abs()) {
        format!("{value:.3}")
    } else {
        format!("{value:.1e}")
    }
}

/// A share in per cent; one that is nearly none or nearly all is not rounded to that.
pub fn percent(share: f64) -> String {
    if share.is_nan() {
        "-".to_owned()
    } else if share == 0.0 || share == 1.0 {
        format!("{:.0} %", share * 100.0)
    } else if share > 0.9995 {
        "> 99.9 %".to_owned()
    } else if share < 0.0005 {
        "< 0.1 %".to_owned()
    } else {
        format!("{:.1} %", share * 100.0)
    }
}

/// A share in per cent with so many decimals.
pub fn percent_with(share: f64, decimals: usize) -> String {
    format!("{:.decimals$} %", 100.0 * share)
}

/// How many per cent a share is, with three digits or fewer.
pub fn in_percent(share: f64) -> String {
    let value = 100.0 * share;
    if value != 0.0 && value.abs() < 1.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.1}")
    }
}

/// A length in mm, or another number, with two or three digits and no power of ten.
pub fn three_digits(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-4 {
        "< 0.0001".to_owned()
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 0.1 {
        format!("{value:.2}")
    } else if size >= 0.01 {
        format!("{value:.3}")
    } else {
        format!("{value:.4}")
    }
}

/// A value with its unit, as people read it; lengths below a hundredth of a millimetre in the unit that
/// suits them.
pub fn measured(value: f64, unit: &str) -> String {
    match unit {
        "mm" if value != 0.0 && value.abs() < 0.01 => small_length(value * 1e-3),
        "" | "1" => three_digits(value),
        unit => format!("{} {unit}", three_digits(value)),
    }
}

/// A time from nanoseconds to seconds.
pub fn duration(seconds: f64) -> String {
    if seconds < 1e-6 {
        format!("{:.0} ns", seconds * 1e9)
    } else if seconds < 1e-3 {
        format!("{:.1} µs", seconds * 1e6)
    } else {
        format!("{:.0} ms", seconds * 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_beyond_its_limit_does_not_read_like_it() {
        let apart = |value: f64, limit: f64, unit: &str| value_and_limit(value, limit, unit);
        assert_eq!(
            apart(2.704_3e-3, 2.7e-3, "m"),
            ("2.704 mm".to_owned(), "2.7 mm".to_owned())
        );
        assert_eq!(
            apart(3e-3, 2.7e-3, "m"),
            ("3.00 mm".to_owned(), "2.70 mm".to_owned())
        );
        assert_eq!(
            apart(2.7e-3, 2.7e-3, "m"),
            ("2.70 mm".to_owned(), "2.70 mm".to_owned())
        );
    }

    #[test]
    fn lengths_are_in_the_unit_that_shows_them() {
        for (metres, text) in [
            (0.0215, "21.50 mm"),
            (-1e-3, "-1.00 mm"),
            (9.999e-4, "999.90 um"),
            (3.21e-9, "3.21 nm"),
            (2e-12, "2.00 pm"),
            (9e-13, "< 1 pm"),
        ] {
            assert_eq!(small_length(metres), text);
        }
        assert_eq!(small_length_or_zero(0.0), "0");
        assert_eq!(unit_of_length(4e-5).name, "um");
    }

    #[test]
    fn decades_of_length_are_whole() {
        let names = [-13, -9, -8, -4, -1, 0, 2].map(decade_of_length);
        assert_eq!(
            names,
            [
                "0.1 pm", "1 nm", "10 nm", "100 um", "100 mm", "1 m", "100 m"
            ]
        );
    }

    #[test]
    fn ticks_have_the_decimals_of_their_step() {
        for (value, step, text) in [
            (0.6000000000000001, 0.2, "0.6"),
            (1.0, 0.2, "1.0"),
            (-1e-17, 0.2, "0.0"),
            (20.0, 10.0, "20"),
            (0.02, 0.005, "0.020"),
            (2.5e-8, 5e-9, "2.5e-8"),
        ] {
            assert_eq!(tick(value, step), text);
        }
    }

    #[test]
    fn rounding_leaves_no_trailing_zeros() {
        for (value, text) in [
            (1.5, "1.5"),
            (100.0, "100"),
            (-0.00001, "0"),
            (0.25, "0.25"),
        ] {
            assert_eq!(rounded(value, 4), text);
        }
        assert_eq!(rounded(100.0, 0), "100");
    }

    #[test]
    fn powers_are_raised() {
        assert_eq!([-16, 0, 9].map(power_of_ten), ["10⁻¹⁶", "10⁰", "10⁹"]);
    }

    #[test]
    fn shares_are_never_rounded_to_none_or_all() {
        let texts = [0.0, 1e-5, 0.123, 0.9999, 1.0].map(percent);
        assert_eq!(texts, ["0 %", "< 0.1 %", "12.3 %", "> 99.9 %", "100 %"]);
        assert_eq!(percent_with(0.123_456, 2), "12.35 %");
        assert_eq!([0.0, 0.0012, 0.5].map(in_percent), ["0.0", "0.12", "50.0"]);
    }

    #[test]
    fn three_digits_are_enough_at_every_size() {
        let texts = [0.0, 1e-9, 1e-5, 0.001_23, 0.0123, 0.123, 12.34, 1234.5].map(three_digits);
        assert_eq!(
            texts,
            [
                "0", "< 0.0001", "< 0.0001", "0.0012", "0.012", "0.12", "12.3", "1234"
            ]
        );
    }

    #[test]
    fn lengths_take_the_unit_that_suits_them() {
        let texts = [0.0, 2.243e-13, 0.0012, 12.34].map(|value| measured(value, "mm"));
        assert_eq!(texts, ["0 mm", "< 1 pm", "1.20 um", "12.3 mm"]);
        assert_eq!(measured(0.84, "mm/mrad"), "0.84 mm/mrad");
    }
}
