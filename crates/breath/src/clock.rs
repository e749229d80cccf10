//! The clock of a recording.

use needlebench_input::Finding;

use crate::samples::Samples;

/// Unit of times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeUnit {
    Second,
    Millisecond,
}

impl TimeUnit {
    pub fn to_s(self) -> f64 {
        match self {
            Self::Second => 1.0,
            Self::Millisecond => 1e-3,
        }
    }

    pub fn label(self) -> &'static str {
        match self {
            Self::Second => "s",
            Self::Millisecond => "ms",
        }
    }

    /// That of a clock with this median step: a marker that is seen once in more than a second shows no breath.
    fn of_step(step: f64) -> Self {
        if step > 1.0 {
            Self::Millisecond
        } else {
            Self::Second
        }
    }
}

/// Longest time between two samples that a line joins, s.
pub(crate) const LONGEST_STEP_S: f64 = 0.5;

/// So many rows in a row may have a time that does not fit between those before and after them.
const MOST_ASTRAY: usize = 3;

/// Share of such rows in a file at most.
const MOST_ASTRAY_SHARE: f64 = 0.01;

const JUMP_HINT: &str = "times must rise from row to row; if the clock starts anew, the file has several recordings: \
                         split it there";

/// Brings times to s and removes rows whose time is astray; how many those were, and the unit of the file.
///
/// Loggers write a single wrong time now and then. Where the clock is right again within three rows these rows are
/// lost samples. A clock that does not come back is refused.
pub(crate) fn checked(
    file: &str,
    named: Option<TimeUnit>,
    samples: &mut Samples,
) -> Result<(usize, TimeUnit), Finding> {
    let mut steps: Vec<f64> = samples
        .times_s
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .collect();
    let step = needlebench_numerics::order::upper_median(&mut steps);
    let (unit, word) = (TimeUnit::of_step(step), TimeUnit::label);
    if let Some(named) = named.filter(|named| *named != unit) {
        let message = format!(
            "the time column is in {}, and its median step is {step}: {} by that",
            word(named),
            word(unit)
        );
        let hint = "steps are at most 1 s, and above 1 ms: correct the name of the column";
        return Err(Finding::new(file, message).hint(hint));
    }
    for time in &mut samples.times_s {
        *time *= unit.to_s();
    }
    let step_s = step * unit.to_s();
    if !(step_s > 0.0 && step_s <= LONGEST_STEP_S) {
        let message = format!(
            "the median step of the clock is {step_s} s (times taken as {})",
            word(unit)
        );
        let hint = format!(
            "times are in s or ms, and a recording of breath has a sample in each {LONGEST_STEP_S} s at least"
        );
        return Err(Finding::new(file, message).hint(hint));
    }
    let astray = remove_astray(file, samples)?;
    if astray > MOST_ASTRAY && astray as f64 > MOST_ASTRAY_SHARE * samples.times_s.len() as f64 {
        let message = format!("{astray} rows have a time that is not after those before them");
        return Err(Finding::new(file, message).hint(JUMP_HINT));
    }
    Ok((astray, unit))
}

fn remove_astray(file: &str, samples: &mut Samples) -> Result<usize, Finding> {
    let times_s = &samples.times_s;
    let mut kept: Vec<usize> = Vec::with_capacity(times_s.len());
    // How many rows in a row were left out.
    let mut run = 0;
    for (row, &time_s) in times_s.iter().enumerate() {
        let after = kept.partition_point(|&at| times_s[at] < time_s);
        let ahead = kept.len() - after;
        if ahead == 0 {
            kept.push(row);
            run = 0;
            continue;
        }
        // Those before may be astray: too late, and this one follows what was before them.
        let follows = after
            .checked_sub(1)
            .is_some_and(|at| time_s - times_s[kept[at]] <= LONGEST_STEP_S);
        let jumped = after
            .checked_sub(1)
            .is_some_and(|at| times_s[kept[after]] - times_s[kept[at]] > LONGEST_STEP_S);
        if ahead <= MOST_ASTRAY && follows && jumped {
            kept.truncate(after);
            kept.push(row);
            run = 0;
            continue;
        }
        run += 1;
        if run > MOST_ASTRAY {
            let first = row + 1 - run;
            let before_s = times_s[first - 1];
            let message = format!(
                "the clock jumps from {before_s:.3} s to {:.3} s and does not come back",
                times_s[first]
            );
            return Err(samples
                .at(first, Finding::new(file, message))
                .hint(JUMP_HINT));
        }
    }
    let astray = times_s.len() - kept.len();
    if astray > 0 {
        samples.keep(&kept);
    }
    Ok(astray)
}
