//! Numbers in another power of ten without rounding: millimetres in files, metres inside.

/// `value * 10^places` as the shortest decimal that reads back as `value` with
/// [`parse_shifted`] and `-places`.
pub(super) fn shifted(value: f64, places: i32) -> String {
    if value == 0.0 {
        return value.to_string(); // `0` or `-0`
    }
    let text = format!("{value:e}");
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return text; // not finite
    };
    let exponent: i32 = exponent.parse().expect("the exponent is a small integer");
    let (sign, mantissa) = match mantissa.strip_prefix('-') {
        Some(rest) => ("-", rest),
        None => ("", mantissa),
    };
    let digits: String = mantissa.chars().filter(char::is_ascii_digit).collect();
    // The number is 0.DIGITS times ten to the power of `point`.
    let point = exponent + places + 1;
    let count = i32::try_from(digits.len()).expect("at most 17 digits");
    if !(-12..=15).contains(&point) {
        return format!("{sign}{mantissa}e{}", exponent + places);
    }
    let zeros = |count: i32| "0".repeat(usize::try_from(count).unwrap_or(0));
    let plain = if point <= 0 {
        format!("0.{}{digits}", zeros(-point))
    } else if point >= count {
        format!("{digits}{}", zeros(point - count))
    } else {
        let (whole, fraction) = digits.split_at(usize::try_from(point).unwrap_or(0));
        format!("{whole}.{fraction}")
    };
    format!("{sign}{plain}")
}

/// The number that is nearest to `text * 10^places`; none if the text is no number.
pub(super) fn parse_shifted(text: &str, places: i32) -> Option<f64> {
    let plain: f64 = text.parse().ok()?;
    if !plain.is_finite() || places == 0 {
        return Some(plain);
    }
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let exponent: i32 = exponent.parse().ok()?;
    format!("{mantissa}e{}", exponent.checked_add(places)?)
        .parse()
        .ok()
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    #[test]
    fn numbers_are_written_as_people_write_them() {
        for (value, text) in [
            (0.1942, "194.2"),
            (-0.3593, "-359.3"),
            (0.0, "0"),
            (1.0, "1000"),
            (0.000_001, "0.001"),
            (1.5e-9, "0.0000015"),
            (-2.0e-20, "-2e-17"),
        ] {
            assert_eq!(shifted(value, 3), text);
        }
        assert_eq!(parse_shifted("194.2", -3), Some(0.1942));
        assert_eq!(parse_shifted("1.5E+2", -3), Some(0.15));
        assert_eq!(parse_shifted("12a", -3), None);
    }

    #[test]
    fn what_is_written_reads_back_to_the_same_bits() {
        let mut random = SplitMix64::new(11);
        for _ in 0..20_000 {
            let value = f64::from_bits(random.next_u64());
            let small = random.uniform(-1.0, 1.0);
            for value in [value, small].into_iter().filter(|value| {
                // Shifting the largest and smallest ones would leave the range of doubles.
                value.is_finite() && (1e-290..1e290).contains(&value.abs())
            }) {
                let read = parse_shifted(&shifted(value, 3), -3).unwrap();
                assert_eq!(read.to_bits(), value.to_bits());
            }
        }
    }
}
