//! A job with indices of Kubernetes.

use needlebench_input::Finding;

use super::{Launch, LaunchFile, SHARDS, Texts, is_below};

/// Where the shared volume is mounted: the folder that the request was made in.
const MOUNT: &str = "/work";

/// Longest name that a job may have, so that its pods' names fit too.
const LONGEST_NAME: usize = 52;

/// The manifest. A pod that a node has lost or that was evicted is not counted; 2 is for good, all else is tried
/// again.
pub(super) fn job(launch: &Launch, texts: &Texts) -> Result<LaunchFile, Finding> {
    for (what, path) in [("the study", launch.study), ("--out", launch.out)] {
        if !is_below(path) {
            return Err(Finding::new(
                path.display().to_string(),
                format!("{what} must be inside this folder, which the pods mount as {MOUNT}"),
            )
            .key("--launch")
            .hint("change to the folder on the shared volume, and give paths relative to it"));
        }
    }
    // Kubernetes would put variables in the place of `$(NAME)`.
    let text = |text: &str| {
        let text = text.replace("$(", "$$(");
        serde_json::to_string(&text).expect("a string")
    };
    let path = |path: &std::path::Path| text(&path.display().to_string());
    let shards = path(&launch.out.join(launch.name).join(SHARDS));
    let mut arguments = vec![
        text("study"),
        path(launch.study),
        text("--shard"),
        text("auto"),
        text("--out"),
        shards,
        text("--resume"),
        text("--yes"),
        text("--quiet"),
        text("--jobs"),
        text(&launch.jobs.to_string()),
    ];
    arguments.extend(launch.options.iter().map(|option| text(option)));
    let arguments: Vec<String> = arguments
        .iter()
        .map(|argument| format!("            - {argument}\n"))
        .collect();
    let head = texts.head("", "A Kubernetes job: one pod per shard.");
    // Its first line is for shells.
    let head = head.split_once('\n').map_or("", |(_, rest)| rest);
    let (name, count, jobs) = (name(launch.name), launch.request.shards, launch.jobs);
    let image = text(concat!("needlebench:", env!("CARGO_PKG_VERSION")));
    let arguments = arguments.concat();
    Ok(LaunchFile {
        name: "job.yaml",
        text: format!(
            r#"{head}# Set two names: the image (built from Containerfile), and the claim of a volume (ReadWriteMany) that all pods can
# write to and that holds the folder in which this file was requested.
apiVersion: batch/v1
kind: Job
metadata:
  name: {name}
spec:
  completionMode: Indexed
  completions: {count}
  parallelism: {count}
  # For each shard separately.
  backoffLimitPerIndex: 20
  podFailurePolicy:
    rules:
      # Invalid input: no retry.
      - action: FailIndex
        onExitCodes:
          containerName: shard
          operator: In
          values: [2]
      # Lost node, eviction or preemption: not counted as a failure of the shard.
      - action: Ignore
        onPodConditions:
          - type: DisruptionTarget
            status: "True"
  template:
    spec:
      restartPolicy: Never
      # A stopped shard saves its results.
      terminationGracePeriodSeconds: 120
      containers:
        - name: shard
          image: {image}
          command: ["needlebench"]
          args:
{arguments}          workingDir: {MOUNT}
          env:
            - name: NEEDLEBENCH_SHARDS
              value: "{count}"
          resources:
            requests:
              cpu: "{jobs}"
              memory: 512Mi
          volumeMounts:
            - name: study
              mountPath: {MOUNT}
      volumes:
        - name: study
          persistentVolumeClaim:
            claimName: needlebench
"#
        ),
    })
}

/// A study's name as a label of DNS (RFC 1123).
fn name(study: &str) -> String {
    let letters = study.chars().map(|letter| match letter {
        letter if letter.is_ascii_alphanumeric() => letter.to_ascii_lowercase(),
        _ => '-',
    });
    let name: String = letters.take(LONGEST_NAME).collect();
    let name = name.trim_matches('-');
    if name.is_empty() {
        "needlebench".to_owned()
    } else {
        name.to_owned()
    }
}
