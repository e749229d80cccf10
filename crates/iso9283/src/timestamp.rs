//! Dates with times of day, to seconds.

/// Seconds since 1970 of `2026-01-31T12:00:00.5` or with a blank for the `T`, without regard to
/// time zones; none for anything else. Other orders of day and month are ambiguous.
pub(super) fn seconds_of(text: &str) -> Option<f64> {
    let (date, time) = text.trim().trim_end_matches('Z').split_once(['T', ' '])?;
    let mut date = date.split('-').map(str::parse::<i64>);
    let (year, month, day) = (date.next()?.ok()?, date.next()?.ok()?, date.next()?.ok()?);
    let mut time = time.trim().split(':');
    let hour: f64 = time.next()?.parse().ok()?;
    let minute: f64 = time.next()?.parse().ok()?;
    let second: f64 = time.next()?.parse().ok()?;
    let sensible = year > 1900
        && (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && (0.0..24.0).contains(&hour)
        && (0.0..60.0).contains(&minute)
        && (0.0..61.0).contains(&second);
    sensible.then(|| {
        days_since_1970(year, month, day) as f64 * 86_400.0 + hour * 3600.0 + minute * 60.0 + second
    })
}

/// Hinnant, *chrono-compatible low-level date algorithms*: `days_from_civil`.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    era * 146_097 + day_of_era - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_seconds_since_1970() {
        assert_eq!(seconds_of("1970-01-01T00:00:00"), Some(0.0));
        // `date -u -d '2024-02-29 12:34:56.25' +%s`.
        assert_eq!(seconds_of("2024-02-29 12:34:56.25"), Some(1_709_210_096.25));
        assert_eq!(seconds_of("05/28/19 18:01:15"), None);
        assert_eq!(seconds_of("2024-13-01T00:00:00"), None);
    }
}
