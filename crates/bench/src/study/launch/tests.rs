use super::*;

fn launch(request: &str) -> Launch<'static> {
    Launch {
        request: request.parse().unwrap(),
        name: "place",
        program: Path::new("/opt/needlebench"),
        folder: Path::new("/home/jo/it's mine"),
        study: Path::new("my studies/place.toml"),
        out: Path::new("out"),
        options: &[],
        jobs: 1,
        cache: None,
        needs_mujoco: false,
    }
}

fn text<'a>(plan: &'a LaunchPlan, name: &str) -> &'a str {
    let file = plan.files.iter().find(|file| file.name == name);
    &file.unwrap_or_else(|| panic!("no {name}")).text
}

#[test]
fn requests_are_a_launcher_and_a_number() {
    let request: LaunchRequest = "slurm:400".parse().unwrap();
    assert_eq!((request.launcher, request.shards), (Launcher::Slurm, 400));
    assert_eq!(request.to_string(), "slurm:400");
    for text in [
        "slurm",
        "slurm:0",
        "slurm:-1",
        "lsf:3",
        "local:",
        ":3",
        "local:3.5",
    ] {
        let message = text.parse::<LaunchRequest>().unwrap_err();
        assert!(message.contains("expected slurm:N"), "{message}");
    }
}

#[test]
fn paths_are_words_whatever_is_in_them() {
    assert_eq!(quoted("out/place"), "out/place");
    assert_eq!(quoted("it's $HOME `x` \"y\""), "'it'\\''s $HOME `x` \"y\"'");
    assert_eq!(quoted(""), "''");
    assert_eq!(quoted("~"), "'~'");
}

#[test]
fn a_shard_is_the_program_itself_where_it_was_asked_for() {
    let plan = launch_plan(&launch("local:8")).unwrap();
    let shard = text(&plan, "shard.sh");
    let lines = [
        "cd '/home/jo/it'\\''s mine' || exit 3",
        "export NEEDLEBENCH_SHARDS=8",
        "exec /opt/needlebench study 'my studies/place.toml' --shard auto --out out/place/shards \\",
        "    --resume --yes --quiet --jobs 1",
    ];
    for line in lines {
        assert!(
            shard.lines().any(|each| each == line),
            "{line} is not in\n{shard}"
        );
    }
    assert!(!shard.contains("CACHE"));
}

#[test]
fn engines_of_dynamic_studies_are_prepared_ahead_on_a_shared_disk() {
    let dynamic = Launch {
        needs_mujoco: true,
        ..launch("slurm:8")
    };
    let plan = launch_plan(&dynamic).unwrap();
    let cache = "export NEEDLEBENCH_CACHE_DIR='/home/jo/it'\\''s mine/out/place/launch/cache'\n";
    for name in ["shard.sh", "prepare.sh"] {
        assert!(text(&plan, name).contains(cache), "{}", text(&plan, name));
    }
    assert_eq!(plan.steps[0].line, "sh out/place/launch/prepare.sh");
    let set = Launch {
        cache: Some(Path::new("/shared/cache")),
        ..dynamic
    };
    let plan = launch_plan(&set).unwrap();
    assert!(text(&plan, "shard.sh").contains("export NEEDLEBENCH_CACHE_DIR=/shared/cache\n"));
}

#[test]
fn a_task_of_slurm_hands_signals_on_and_puts_itself_back_alone() {
    let plan = launch_plan(&launch("slurm:400")).unwrap();
    let job = text(&plan, "job.sh");
    for part in [
        "#SBATCH --array=1-400\n",
        "#SBATCH --signal=B:USR1@120\n",
        "#SBATCH --requeue\n",
        "#SBATCH --output=\"/home/jo/it's mine/out/place/launch/logs/%a.log\"\n",
        "scontrol requeue \"${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}\"",
        "'/home/jo/it'\\''s mine/out/place/launch/shard.sh' &\n",
    ] {
        assert!(job.contains(part), "{part} is not in\n{job}");
    }
    // Slurm reads its lines up to the first that is no comment.
    let head = job.split("\nunset ").next().unwrap();
    assert!(
        head.lines()
            .all(|line| line.starts_with('#') || line.is_empty())
    );
    assert!(text(&plan, "missing.sh").contains("exec sbatch --array=\"$missing\" \"$@\" "));
    let odd = Launch {
        folder: Path::new("/50% \"here\""),
        ..launch("slurm:4")
    };
    let plan = launch_plan(&odd).unwrap();
    assert!(
        text(&plan, "job.sh")
            .contains("--output=\"/50%% \\\"here\\\"/out/place/launch/logs/%a.log\"")
    );
    for folder in ["/a\\b", "/a\nb"] {
        let odd = Launch {
            folder: Path::new(folder),
            ..launch("slurm:4")
        };
        assert_eq!(
            launch_plan(&odd).unwrap_err().key.as_deref(),
            Some("--launch")
        );
    }
}

#[test]
fn pods_see_what_is_below_the_folder_alone() {
    let options = ["--arm=ur5e".to_owned()];
    let below = Launch {
        options: &options,
        name: "place $(x)",
        ..launch("kubernetes:8")
    };
    let plan = launch_plan(&below).unwrap();
    let job = text(&plan, "job.yaml");
    for part in [
        "  name: place---x\n",
        "  completions: 8\n",
        "            - \"my studies/place.toml\"\n",
        "            - \"--arm=ur5e\"\n          workingDir: /work\n",
        "              value: \"8\"\n",
        "          values: [2]\n",
        "            - \"out/place $$(x)/shards\"\n",
    ] {
        assert!(job.contains(part), "{part} is not in\n{job}");
    }
    for study in ["/abs/place.toml", "../place.toml"] {
        let elsewhere = Launch {
            study: Path::new(study),
            ..launch("kubernetes:8")
        };
        let finding = launch_plan(&elsewhere).unwrap_err();
        assert!(finding.message.contains("/work"), "{finding}");
    }
}

#[test]
fn the_same_request_gives_the_same_bytes() {
    for request in ["slurm:3", "kubernetes:3", "local:3"] {
        let [one, two] = [(); 2].map(|()| launch_plan(&launch(request)).unwrap());
        assert_eq!(one, two);
        // What is written replaces what another launch has left.
        assert_eq!(one.files.len() + one.stale.len(), FILES.len());
    }
}

#[test]
fn short_shards_and_long_arrays_are_remarked() {
    let said = |request: &str, cases, each_ms| {
        let each = Duration::from_millis(each_ms);
        advice(request.parse().unwrap(), cases, 1, each).join("\n")
    };
    // 400 shards of 35 s.
    let advice = said("slurm:400", 1_000_000, 14);
    assert!(
        advice.contains("about 35 s") && advice.contains("use 46 shards, "),
        "{advice}"
    );
    assert_eq!(said("slurm:40", 1_000_000, 14), "");
    assert_eq!(said("local:8", 1_000_000, 14), "");
    assert!(said("slurm:1001", 100_000_000, 14).contains("MaxArraySize"));
    // One shard cannot be fewer.
    assert_eq!(said("slurm:1", 10, 14), "");
}
