//! An array of jobs of Slurm.

use needlebench_input::Finding;

use super::shell::quoted;
use super::{Launch, LaunchFile, Texts};

/// How often a task is put back into the queue.
const RESTARTS: u32 = 20;

/// What one task runs. Slurm copies it to the nodes, so it names everything from the root.
pub(super) fn job(launch: &Launch, texts: &Texts) -> Result<LaunchFile, Finding> {
    let logs = texts.absolute("logs/%a.log");
    // Not a path any more: Slurm would take `%a` for itself.
    if logs.contains('\\') {
        return Err(
            Finding::new(logs, "Slurm cannot write to a file with a \\ in its name")
                .key("--launch"),
        );
    }
    let (folder, file) = logs.rsplit_once('/').unwrap_or(("", &logs));
    let logs = format!("{}/{file}", folder.replace('%', "%%").replace('"', "\\\""));
    let legal = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
    let name: String = launch
        .name
        .chars()
        .map(|letter| if legal(letter) { letter } else { '_' })
        .collect();
    let head = texts.head("/bin/bash", "A Slurm array task: one shard.");
    let (shards, jobs) = (launch.request.shards, launch.jobs);
    let shard = quoted(&texts.absolute("shard.sh"));
    Ok(LaunchFile {
        name: "job.sh",
        text: format!(
            r#"{head}#SBATCH --job-name={name}
#SBATCH --array=1-{shards}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={jobs}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output="{logs}"
# Two minutes before the time limit, to this script alone.
#SBATCH --signal=B:USR1@120

# May be set by the submitter; all tasks would then compute the same shard.
unset NEEDLEBENCH_SHARD
# A signal ends `wait`, not the shard, which saves its results and ends by itself.
limit=no
signalled=no
trap 'signalled=yes; limit=yes; kill -TERM "$child" 2>/dev/null' USR1
trap 'signalled=yes; kill -TERM "$child" 2>/dev/null' TERM INT
{shard} &
child=$!
while :; do
    signalled=no
    wait "$child"
    status=$?
    [ "$signalled" = no ] && break
done

# Retry after 3 and after the time limit; 2 is permanent. After a kill, a lost node or a preemption Slurm requeues
# the task itself, unless it was cancelled.
again=no
[ "$status" = 3 ] && again=yes
[ "$limit" = yes ] && [ "$status" != 0 ] && [ "$status" != 2 ] && again=yes
# The shard was killed: out of memory, or manually.
[ "$status" = 137 ] && again=yes
if [ "$again" = yes ] && [ "${{SLURM_RESTART_COUNT:-0}}" -lt {RESTARTS} ]; then
    # SLURM_JOB_ID would requeue the whole array: it is the number of its last task.
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}"
fi
exit "$status"
"#
        ),
    })
}

/// Submits the shards that are missing.
pub(super) fn missing(texts: &Texts) -> LaunchFile {
    let head = texts.head("/bin/sh", "Submits missing shards again.");
    let environment = texts.environment();
    let (program, study, shards, options) =
        (&texts.program, &texts.study, &texts.shards, &texts.options);
    let job = quoted(&texts.absolute("job.sh"));
    let merge = quoted(&texts.absolute("merge.sh"));
    LaunchFile {
        name: "missing.sh",
        text: format!(
            r#"{head}{environment}missing=$({program} study {study} --status {shards} --missing{options})
status=$?
if [ "$status" = 0 ]; then
    echo {done}
elif [ "$status" = 1 ] && [ -n "$missing" ]; then
    # Shards that wait in the queue are missing too: if started twice, the second finds the results of the first.
    exec sbatch --array="$missing" "$@" {job}
elif [ "$status" = 1 ]; then
    echo "no shard is missing, some are still running"
fi
exit "$status"
"#,
            done = quoted(&format!("all shards are complete: sh {merge}")),
        ),
    }
}
