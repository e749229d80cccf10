//! Processes of one machine.

use super::shell::quoted;
use super::{Launch, LaunchFile, Texts};

/// How often a shard is started again.
const RESTARTS: u32 = 20;

/// Runs all shards in parallel, each again until it is complete.
pub(super) fn run(launch: &Launch, texts: &Texts) -> LaunchFile {
    let head = texts.head(
        "/bin/bash",
        "Runs all shards in parallel, each in its own process; restarts a shard after a transient failure.",
    );
    let shards = launch.request.shards;
    let shard = quoted(&texts.absolute("shard.sh"));
    let logs = quoted(&texts.absolute("logs"));
    let merge = quoted(&texts.absolute("merge.sh"));
    let merge = quoted(&format!("all shards are complete: sh {merge}"));
    LaunchFile {
        name: "run.sh",
        text: format!(
            r#"{head}logs={logs}
mkdir -p "$logs" || exit 3

# One shard, until it is complete or fails permanently.
run() {{
    stopped=no
    child=
    status=130
    trap 'stopped=yes; [ -n "$child" ] && kill -TERM "$child" 2>/dev/null' TERM
    for _ in $(seq {RESTARTS}); do
        [ "$stopped" = no ] || break
        NEEDLEBENCH_SHARD=$1 {shard} >>"$logs/$1.log" 2>&1 &
        child=$!
        wait "$child"
        status=$?
        # A signal ends `wait`, not the shard.
        while [ "$stopped" = yes ]; do
            stopped=told
            wait "$child"
            status=$?
        done
        # 0: complete; 2: permanent failure; 126 and 127: program not found.
        case $status in 0 | 2 | 126 | 127) break ;; esac
        sleep 1
    done
    case $status in
        0 | 130) ;;
        *) echo "shard $1 ended with status $status: $logs/$1.log" >&2 ;;
    esac
    exit "$status"
}}

children=
for k in $(seq {shards}); do
    (run "$k") &
    children="$children $!"
done
stopped=no
trap 'stopped=yes; kill -TERM $children 2>/dev/null' INT TERM HUP
worst=0
for child in $children; do
    wait "$child"
    status=$?
    while [ "$stopped" = yes ]; do
        stopped=told
        wait "$child"
        status=$?
    done
    [ "$status" -gt "$worst" ] && worst=$status
done
[ "$stopped" = no ] || {{
    echo "interrupted: run this script again to continue" >&2
    exit 130
}}
[ "$worst" = 0 ] && echo {merge}
exit "$worst"
"#
        ),
    }
}
