//! The shard that a process computes, from the environment variables of schedulers.

use needlebench_input::Finding;
use needlebench_study::Shard;

/// Environment variable: number of shards. It takes precedence over a scheduler's array size, because an array may have
/// only some shards that are repeated.
pub const SHARDS_VARIABLE: &str = "NEEDLEBENCH_SHARDS";

/// Environment variable: the shard, from 1; takes precedence over schedulers.
pub const SHARD_VARIABLE: &str = "NEEDLEBENCH_SHARD";

/// A shard, and what assigned it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// Which one.
    pub shard: Shard,
    /// The scheduler, for people.
    pub by: &'static str,
    /// The variables that assign it, with their values.
    pub from: String,
}

/// What a scheduler tells the tasks of an array.
struct Scheduler {
    name: &'static str,
    /// Variable with the number of the task.
    index: &'static str,
    /// What the first task has, where that is the scheduler's own affair.
    first: u32,
    /// How many tasks there are, if the scheduler says so.
    count: fn(&Variables) -> Result<Option<u32>, Finding>,
}

const SCHEDULERS: [Scheduler; 4] = [
    Scheduler {
        name: "Slurm",
        index: "SLURM_ARRAY_TASK_ID",
        first: 1,
        count: slurm_count,
    },
    Scheduler {
        name: "Kubernetes",
        index: "JOB_COMPLETION_INDEX",
        first: 0,
        count: |_| Ok(None),
    },
    Scheduler {
        name: "PBS",
        index: "PBS_ARRAY_INDEX",
        first: 1,
        count: |_| Ok(None),
    },
    Scheduler {
        name: "AWS Batch",
        index: "AWS_BATCH_JOB_ARRAY_INDEX",
        first: 0,
        count: |variables| variables.number("AWS_BATCH_JOB_ARRAY_SIZE"),
    },
];

/// Environment variables.
struct Variables<'a>(&'a dyn Fn(&str) -> Option<String>);

impl Variables<'_> {
    /// `NAME=value`.
    fn said(&self, name: &str) -> String {
        format!("{name}={}", (self.0)(name).unwrap_or_default())
    }

    fn number(&self, name: &str) -> Result<Option<u32>, Finding> {
        let Some(text) = (self.0)(name) else {
            return Ok(None);
        };
        text.trim().parse().map(Some).map_err(|_| {
            refusal(format!("{name}=\"{text}\" is not a number")).hint(format!(
                "the scheduler sets it; {SHARDS_VARIABLE} and {SHARD_VARIABLE} are set by hand"
            ))
        })
    }
}

fn refusal(message: String) -> Finding {
    Finding::new("--shard auto", message)
}

/// Number of shards, if the environment names it: [`SHARDS_VARIABLE`].
///
/// # Errors
/// A value that is not a number of shards.
pub fn shards_of(variables: &dyn Fn(&str) -> Option<String>) -> Result<Option<u32>, Finding> {
    match Variables(variables).number(SHARDS_VARIABLE)? {
        Some(0) => Err(refusal(format!(
            "{SHARDS_VARIABLE}=0: at least one shard is required"
        ))),
        shards => Ok(shards),
    }
}

/// The shard that a process computes, from its environment variables.
///
/// # Errors
/// No or several schedulers, an unknown number of shards, or a task beyond it.
pub fn assignment(variables: &dyn Fn(&str) -> Option<String>) -> Result<Assignment, Finding> {
    let shards = shards_of(variables)?;
    let variables = Variables(variables);
    let own = Scheduler {
        name: "by hand",
        index: SHARD_VARIABLE,
        first: 1,
        count: |_| Ok(None),
    };
    let is_set = |scheduler: &&Scheduler| (variables.0)(scheduler.index).is_some();
    let there: Vec<&Scheduler> = match Some(&own).filter(is_set) {
        Some(own) => vec![own],
        None => SCHEDULERS.iter().filter(is_set).collect(),
    };
    let scheduler = match there.as_slice() {
        [scheduler] => scheduler,
        [] => {
            let names = SCHEDULERS.map(|each| format!("{} ({})", each.index, each.name));
            return Err(
                refusal("no scheduler assigns a shard".to_owned()).hint(format!(
                    "none of {} is set; without a scheduler set {SHARD_VARIABLE} and {SHARDS_VARIABLE}, or give --shard K/N",
                    names.join(", ")
                )),
            );
        }
        several => {
            let said = several.iter().map(|each| variables.said(each.index));
            return Err(refusal(format!(
                "several schedulers assign a shard: {}",
                said.collect::<Vec<_>>().join(", ")
            ))
            .hint(format!(
                "unset all but one, or set {SHARD_VARIABLE}, which takes precedence"
            )));
        }
    };
    let index = variables
        .number(scheduler.index)?
        .expect("it was found above");
    let counted = if shards.is_none() {
        (scheduler.count)(&variables)?
    } else {
        None
    };
    let Some(parts) = shards.or(counted) else {
        return Err(refusal(format!(
            "{} is set, but the number of shards is not",
            variables.said(scheduler.index)
        ))
        .hint(format!("set {SHARDS_VARIABLE} to the number of shards")));
    };
    let first = first_of(scheduler, shards, &variables)?;
    let from = if shards.is_some() {
        vec![scheduler.index, SHARDS_VARIABLE]
    } else {
        vec![scheduler.index]
    };
    let from: Vec<String> = from.iter().map(|name| variables.said(name)).collect();
    let part = index
        .checked_sub(first)
        .and_then(|from| from.checked_add(1));
    let shard = part
        .and_then(|part| Shard::new(part, parts))
        .ok_or_else(|| {
            let last = u64::from(first) + u64::from(parts) - 1;
            refusal(format!("{}: not one of {parts} shards", from.join(", "))).hint(format!(
                "{} of {} shards runs from {first} to {last}",
                scheduler.index, parts
            ))
        })?;
    Ok(Assignment {
        shard,
        by: scheduler.name,
        from: from.join(", "),
    })
}

/// What the first task of an array has.
fn first_of(
    scheduler: &Scheduler,
    shards: Option<u32>,
    variables: &Variables,
) -> Result<u32, Finding> {
    let least = variables.number("SLURM_ARRAY_TASK_MIN")?;
    match (scheduler.index, shards, least) {
        // An array that counts from 0 and has only some of the shards would be ambiguous.
        ("SLURM_ARRAY_TASK_ID", Some(shards), Some(0)) => Err(refusal(format!(
            "{} counts from 0, and with {SHARDS_VARIABLE}={shards} tasks are shards, from 1",
            variables.said("SLURM_ARRAY_TASK_MIN")
        ))
        .hint(format!("submit it with --array=1-{shards}"))),
        ("SLURM_ARRAY_TASK_ID", None, Some(least)) => Ok(least),
        _ => Ok(scheduler.first),
    }
}

/// Number of tasks of a Slurm array, which must be complete.
fn slurm_count(variables: &Variables) -> Result<Option<u32>, Finding> {
    const NAMES: [&str; 3] = [
        "SLURM_ARRAY_TASK_MIN",
        "SLURM_ARRAY_TASK_MAX",
        "SLURM_ARRAY_TASK_COUNT",
    ];
    let mut numbers = [0; 3];
    for (number, name) in numbers.iter_mut().zip(NAMES) {
        match variables.number(name)? {
            Some(value) => *number = value,
            None => return Ok(None),
        }
    }
    let [least, most, count] = numbers;
    if least > 1 || most.checked_sub(least).and_then(|span| span.checked_add(1)) != Some(count) {
        let said = NAMES.map(|name| variables.said(name)).join(", ");
        return Err(
            refusal(format!("{said}: the array does not have all shards")).hint(format!(
                "set {SHARDS_VARIABLE} to the number of all shards; it takes precedence over Slurm's numbers"
            )),
        );
    }
    Ok(Some(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assigned(variables: &[(&str, &str)]) -> Result<Assignment, Finding> {
        assignment(&|name| {
            let found = variables.iter().find(|(each, _)| *each == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn every_scheduler_is_understood() {
        let slurm = |id, least, most, count| {
            [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_MIN", least),
                ("SLURM_ARRAY_TASK_MAX", most),
                ("SLURM_ARRAY_TASK_COUNT", count),
            ]
        };
        let with = |more: &[(&'static str, &'static str)], shards| {
            [more, &[("NEEDLEBENCH_SHARDS", shards)]].concat()
        };
        for (variables, shard, by) in [
            (slurm("7", "1", "400", "400").to_vec(), "7/400", "Slurm"),
            (slurm("0", "0", "399", "400").to_vec(), "1/400", "Slurm"),
            // Asked for again.
            (with(&slurm("17", "3", "17", "2"), "400"), "17/400", "Slurm"),
            (with(&slurm("2", "1", "2", "2"), "400"), "2/400", "Slurm"),
            (with(&[("SLURM_ARRAY_TASK_ID", "5")], "8"), "5/8", "Slurm"),
            (
                with(&[("JOB_COMPLETION_INDEX", "0")], "8"),
                "1/8",
                "Kubernetes",
            ),
            (with(&[("PBS_ARRAY_INDEX", "8")], "8"), "8/8", "PBS"),
            (
                with(&[("AWS_BATCH_JOB_ARRAY_INDEX", "7")], "8"),
                "8/8",
                "AWS Batch",
            ),
            (
                vec![
                    ("AWS_BATCH_JOB_ARRAY_INDEX", "1"),
                    ("AWS_BATCH_JOB_ARRAY_SIZE", "10"),
                ],
                "2/10",
                "AWS Batch",
            ),
            (
                with(
                    &[("NEEDLEBENCH_SHARD", "3"), ("SLURM_ARRAY_TASK_ID", "5")],
                    "8",
                ),
                "3/8",
                "by hand",
            ),
        ] {
            let assigned = assigned(&variables).unwrap();
            assert_eq!(assigned.shard.to_string(), shard, "{variables:?}");
            assert_eq!(assigned.by, by);
        }
    }

    #[test]
    fn what_nobody_can_know_is_refused_with_names_and_values() {
        for (variables, parts) in [
            (&[][..], ["no scheduler assigns", "SLURM_ARRAY_TASK_ID"]),
            (
                &[("JOB_COMPLETION_INDEX", "3")],
                ["JOB_COMPLETION_INDEX=3", "NEEDLEBENCH_SHARDS"],
            ),
            (
                &[("PBS_ARRAY_INDEX", "3")],
                ["PBS_ARRAY_INDEX=3", "NEEDLEBENCH_SHARDS"],
            ),
            (
                &[("SLURM_ARRAY_TASK_ID", "3")],
                ["SLURM_ARRAY_TASK_ID=3", "NEEDLEBENCH_SHARDS"],
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "3"),
                    ("SLURM_ARRAY_TASK_MIN", "3"),
                    ("SLURM_ARRAY_TASK_MAX", "17"),
                    ("SLURM_ARRAY_TASK_COUNT", "2"),
                ],
                ["SLURM_ARRAY_TASK_COUNT=2", "NEEDLEBENCH_SHARDS"],
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "3"),
                    ("SLURM_ARRAY_TASK_MIN", "0"),
                    ("NEEDLEBENCH_SHARDS", "8"),
                ],
                ["SLURM_ARRAY_TASK_MIN=0", "--array=1-8"],
            ),
            (
                &[("SLURM_ARRAY_TASK_ID", "3"), ("PBS_ARRAY_INDEX", "4")],
                [
                    "SLURM_ARRAY_TASK_ID=3, PBS_ARRAY_INDEX=4",
                    "NEEDLEBENCH_SHARD",
                ],
            ),
            (
                &[("PBS_ARRAY_INDEX", "9"), ("NEEDLEBENCH_SHARDS", "8")],
                ["PBS_ARRAY_INDEX=9, NEEDLEBENCH_SHARDS=8", "from 1 to 8"],
            ),
            (
                &[("JOB_COMPLETION_INDEX", "8"), ("NEEDLEBENCH_SHARDS", "8")],
                [
                    "JOB_COMPLETION_INDEX=8, NEEDLEBENCH_SHARDS=8",
                    "from 0 to 7",
                ],
            ),
            (
                &[("PBS_ARRAY_INDEX", "0"), ("NEEDLEBENCH_SHARDS", "8")],
                ["PBS_ARRAY_INDEX=0", "from 1 to 8"],
            ),
            (
                &[("PBS_ARRAY_INDEX", "1"), ("NEEDLEBENCH_SHARDS", "0")],
                ["NEEDLEBENCH_SHARDS=0", "at least one"],
            ),
            (
                &[("PBS_ARRAY_INDEX", "first"), ("NEEDLEBENCH_SHARDS", "8")],
                ["PBS_ARRAY_INDEX=\"first\"", "not a number"],
            ),
            (
                &[("PBS_ARRAY_INDEX", "1"), ("NEEDLEBENCH_SHARDS", "-8")],
                ["NEEDLEBENCH_SHARDS=\"-8\"", "not a number"],
            ),
        ] {
            let finding = assigned(variables).unwrap_err();
            let said = format!("{} {}", finding.message, finding.hint.unwrap_or_default());
            for part in parts {
                assert!(said.contains(part), "{variables:?}: {said}");
            }
        }
    }
}
