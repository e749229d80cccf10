//! The server as those meet it who are let in, and those who are not.

mod support;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};

use support::Running;

#[test]
fn who_knows_the_token_sees_the_patient_and_nobody_else_does() {
    let server = Running::start();
    let case = server.get("/api/case").json();
    assert_eq!(case["size"], json!(support::SIZE));
    for token in [
        None,
        Some("0".repeat(32)),
        Some(server.token[1..].to_owned()),
    ] {
        for path in [
            "/api/case",
            "/api/volume",
            "/api/labels",
            "/api/scene",
            "/api/session",
            "/api/nothing",
        ] {
            let mut asked = server.asked("GET", path);
            asked.token.clone_from(&token);
            let answer = asked.send();
            assert_eq!(answer.status, 401, "{path}");
            assert!(answer.json()["hint"].is_string());
        }
    }
    // The page itself has nothing of a patient in it.
    for path in [
        "/",
        "/assets/view.js",
        "/assets/view.css",
        "/assets/three.js",
        "/assets/shared.js",
    ] {
        let mut asked = server.asked("GET", path);
        asked.token = None;
        let page = asked.send();
        assert_eq!(page.status, 200, "{path}");
        assert!(!page.text().contains(support::NAME) && !page.text().contains(&server.token));
    }
}

#[test]
fn other_names_and_origins_are_refused_whatever_they_know() {
    let server = Running::start();
    let attacks: [&[(&str, &str)]; 6] = [
        &[("host", "evil.example")],
        &[("host", "127.0.0.1:1")],
        &[("origin", "http://evil.example")],
        &[("origin", "null")],
        &[("sec-fetch-site", "cross-site")],
        &[
            ("host", "127.0.0.1.evil.example"),
            ("origin", "http://127.0.0.1.evil.example"),
        ],
    ];
    for attack in attacks {
        for (method, path) in [
            ("GET", "/"),
            ("GET", "/api/case"),
            ("PUT", "/api/session"),
            ("POST", "/api/plan"),
            ("DELETE", "/api/simulation"),
        ] {
            let mut asked = server.asked(method, path);
            for (name, value) in attack {
                if *name == "host" {
                    (*value).clone_into(&mut asked.host);
                } else {
                    asked
                        .headers
                        .push(((*name).to_owned(), (*value).to_owned()));
                }
            }
            let answer = asked.send();
            assert_eq!(answer.status, 403, "{attack:?} {method} {path}");
            assert!(answer.header("access-control-allow-origin").is_none());
        }
    }
    let preflight = server
        .asked("OPTIONS", "/api/case")
        .header("origin", "http://evil.example")
        .send();
    assert_eq!(preflight.status, 403);
}

#[test]
fn every_answer_says_what_a_browser_may_do_with_it() {
    let server = Running::start();
    for path in ["/", "/api/case", "/nothing", "/assets/../api/case"] {
        let answer = server.get(path);
        let policy = answer.header("content-security-policy").unwrap();
        assert!(
            policy.contains("default-src 'none'") && !policy.contains("unsafe"),
            "{path}"
        );
        assert_eq!(
            answer.header("x-content-type-options").as_deref(),
            Some("nosniff")
        );
        assert_eq!(
            answer.header("referrer-policy").as_deref(),
            Some("no-referrer")
        );
        assert_eq!(answer.header("cache-control").as_deref(), Some("no-store"));
    }
}

#[test]
fn methods_bodies_and_paths_that_are_none_are_answered_with_a_sentence() {
    let server = Running::start();
    let sentence =
        |answer: &Value| assert!(answer["error"].as_str().unwrap().contains(' '), "{answer}");
    for (method, path, body, status) in [
        ("POST", "/api/case", "", 405),
        ("DELETE", "/api/session", "", 405),
        ("PUT", "/", "", 405),
        ("POST", "/api/place", "", 400),
        ("POST", "/api/place", "{", 400),
        ("POST", "/api/place", "{\"index\":[1,2]}", 400),
        ("POST", "/api/place", "{\"index\":[1,2,1e999]}", 400),
        ("POST", "/api/place", "{\"index\":[1,2,1e7]}", 400),
        ("POST", "/api/place", "{\"index\":[1,2,3],\"more\":1}", 400),
        (
            "POST",
            "/api/route",
            "{\"aim\":{\"target\":{\"file\":\"/etc/passwd\"},\"entry\":{\"index\":[1,2,3]}}}",
            400,
        ),
        ("PUT", "/api/session", "{\"version\":-1,\"state\":{}}", 400),
        (
            "PUT",
            "/api/session",
            "{\"version\":0,\"state\":{\"window_hu\":[9,1]}}",
            422,
        ),
        ("GET", "/../../etc/passwd", "", 404),
        ("GET", "/assets/..%2f..%2fCargo.toml", "", 404),
        ("GET", "/results/../session.toml", "", 404),
        ("GET", "/results/report.html", "", 401),
    ] {
        let answer = server.asked(method, path).body(body).send();
        assert_eq!(
            answer.status,
            status,
            "{method} {path} {body}: {}",
            answer.text()
        );
        sentence(&answer.json());
    }
    let large = server
        .asked("PUT", "/api/session")
        .body(&" ".repeat(300 * 1024))
        .send();
    assert_eq!(large.status, 413);
    sentence(&large.json());
    assert!(large.json()["error"].as_str().unwrap().contains("256 KiB"));
    // It is none the worse for it.
    assert_eq!(server.get("/api/case").status, 200);
}

#[test]
fn voxels_and_their_places_are_those_of_the_scan() {
    let server = Running::start();
    let hu = server.get("/api/volume").body;
    let labels = server.get("/api/labels").body;
    let [columns, rows, slices] = support::SIZE;
    assert_eq!([hu.len(), labels.len()], [2 * columns * rows * slices; 2]);
    let case = server.get("/api/case").json();
    for index in [
        [0, 0, 0],
        [columns / 2, rows / 2, slices / 2],
        [columns - 1, 3, slices - 1],
    ] {
        let place = server.post("/api/place", &json!({"index": index})).json();
        for axis in 0..3 {
            let expected_mm =
                (support::FIRST_M[axis] + support::SPACING_M[axis] * index[axis] as f64) * 1e3;
            let mm = place["ct_mm"][axis].as_f64().unwrap();
            assert!((mm - expected_mm).abs() < 1e-9, "{mm} {expected_mm}");
        }
        let at = 2 * ((index[2] * rows + index[1]) * columns + index[0]);
        let value = i64::from(i16::from_le_bytes([hu[at], hu[at + 1]]));
        assert_eq!(place["hu"], json!(value));
        assert_eq!(value, i64::from(support::hu(index)));
        let label = u16::from_le_bytes([labels[at], labels[at + 1]]);
        let names = case["labels"].as_array().unwrap();
        let name = names
            .iter()
            .find(|each| each["label"] == json!(label))
            .map(|each| &each["name"]);
        assert_eq!(&place["label"], name.unwrap_or(&Value::Null));
    }
    let outside = server
        .post("/api/place", &json!({"index": [-5, 0, 0]}))
        .json();
    assert_eq!(outside["hu"], Value::Null);
}

#[test]
fn a_route_is_what_geometry_says() {
    /// Of surfaces of voxels of 4 mm, and labels on them.
    const VOXEL_M: f64 = 4e-3;
    let server = Running::start();
    // From the front, straight to the middle of the nodule.
    let [x, y, z] = support::NODULE_M;
    let aim = json!({"target": {"lesion": "nodule"}, "entry": {"place_m": [x, y - 0.2, z]}});
    let route = server.post("/api/route", &json!({"aim": aim})).json();
    let number = |key: &str| {
        route[key]
            .as_f64()
            .unwrap_or_else(|| panic!("{key}: {route}"))
    };
    let skin_y = -support::BODY_M[1] * (1.0 - (x / support::BODY_M[0]).powi(2)).sqrt();
    assert!(
        (number("length_m") - (y - skin_y)).abs() < VOXEL_M,
        "{route}"
    );
    let [half_x, half_y, half_z] = support::LUNG_M;
    let aside = ((x - support::LUNG_AT_M) / half_x).powi(2) + (z / half_z).powi(2);
    let lung_m = y + half_y * (1.0 - aside).sqrt();
    assert!(
        (number("in_lung_m") - lung_m).abs() < VOXEL_M,
        "{} {lung_m}",
        number("in_lung_m")
    );
    assert_eq!(route["lung_entries"], json!(1));
    // The normal of an ellipse.
    let normal = libm::atan2(
        x / support::BODY_M[0].powi(2),
        -skin_y / support::BODY_M[1].powi(2),
    )
    .abs();
    assert!(
        (number("skin_angle_rad") - normal).abs() < 0.1,
        "{} {normal}",
        number("skin_angle_rad")
    );
    assert!(number("axial_angle_rad").abs() < 0.02);
    let crossed: Vec<&str> = route["crossings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|each| each["name"].as_str().unwrap())
        .collect();
    assert_eq!(crossed, ["soft_tissue", "lung_left", "nodule"]);
    // Without a registration nothing is said of the robot, and why.
    let reach = server.post("/api/reach", &json!({"aim": aim})).json();
    assert!(
        reach["unknown"]
            .as_str()
            .unwrap()
            .contains("no registration"),
        "{reach}"
    );
    let motion = server
        .post(
            "/api/motion",
            &json!({"aim": aim, "configuration": "Right-Up-Fold"}),
        )
        .json();
    assert!(
        motion["refused"]["message"]
            .as_str()
            .unwrap()
            .contains("no registration")
    );
    // What is no needle is told so.
    for (aim, word) in [
        (
            json!({"target": {"place_m": [0.5, 0.0, 0.0]}, "entry": {"place_m": [0.0, -0.2, 0.0]}}),
            "target",
        ),
        (
            json!({"target": {"lesion": "none"}, "entry": {"place_m": [0.0, -0.2, 0.0]}}),
            "none",
        ),
        (
            json!({"target": {"lesion": "nodule"}, "entry": {"place_m": [x, y, z]}}),
            "apart",
        ),
    ] {
        let refused = server.post("/api/route", &json!({"aim": aim})).json();
        let message = refused["refused"]["message"].as_str().unwrap_or_default();
        assert!(message.contains(word), "{refused}");
    }
}

#[test]
fn the_second_tab_is_told_and_nothing_is_lost() {
    let server = Running::start();
    let fresh = server.get("/api/session").json();
    assert_eq!(fresh["version"], json!(0));
    let keep = |version: u64, notes: &str| {
        server
            .asked("PUT", "/api/session")
            .body(&json!({"version": version, "state": {"notes": notes}}).to_string())
            .send()
    };
    assert_eq!(keep(0, "first").json()["version"], json!(1));
    let refused = keep(0, "second");
    assert_eq!(refused.status, 409);
    assert_eq!(refused.json()["session"]["notes"], json!("first"));
    assert_eq!(keep(1, "second").json()["version"], json!(2));
    // Killed and started again.
    let folder = server.stop();
    let again = Running::open(folder);
    let session = again.get("/api/session").json();
    assert_eq!(
        [&session["version"], &session["notes"]],
        [&json!(2), &json!("second")]
    );
}

#[test]
fn a_plan_is_the_scenario_with_another_goal_and_stays_in_its_folder() {
    let server = Running::start();
    let [x, y, z] = support::NODULE_M;
    let aim = json!({"goal": "nodule", "target": {"lesion": "nodule"}, "entry": {"place_m": [x, y - 0.2, z]}});
    for name in ["../escaped", "scenario", "a/b", "session.toml", ""] {
        let refused = server.post("/api/plan", &json!({"aim": aim, "name": name}));
        assert_eq!(refused.status, 422, "{name}");
    }
    let source = std::fs::read_to_string(server.folder().join("scenario.toml")).unwrap();
    let saved = server.post(
        "/api/plan",
        &json!({"aim": aim, "name": "mine", "configuration": "Right-Up-Fold"}),
    );
    assert_eq!(saved.json()["file"], json!("mine.toml"), "{}", saved.text());
    let text = std::fs::read_to_string(server.folder().join("mine.toml")).unwrap();
    let first = source.lines().next().unwrap();
    assert!(text.starts_with(first), "comments stay");
    assert!(
        text.contains("entry_mm = [") && text.contains("for Right-Up-Fold"),
        "{text}"
    );
    let overrides = needlebench_scenario::Overrides::default();
    let resolved =
        needlebench_scenario::load_scenario(&server.folder().join("mine.toml"), &overrides)
            .unwrap();
    let route = server.post("/api/route", &json!({"aim": aim})).json();
    let length_m = resolved.goals[0].entry_to_target_m().unwrap();
    assert!((length_m - route["length_m"].as_f64().unwrap()).abs() < 1e-6);
    assert_eq!(
        source,
        std::fs::read_to_string(server.folder().join("scenario.toml")).unwrap()
    );
}

#[test]
fn a_needle_that_is_refused_and_a_file_that_is_there_are_asked_about() {
    let server = Running::start();
    // Of another page: on this one nobody asks for entries before a needle is saved.
    let asked = Running::start();
    asked.post(
        "/api/entries",
        &json!({"aim": {"goal": "nodule", "target": {"lesion": "nodule"}}, "robot": false}),
    );
    let [x, y, z] = support::NODULE_M;
    let refusal = |entry: [f64; 3]| {
        let aim =
            json!({"goal": "nodule", "target": {"lesion": "nodule"}, "entry": {"place_m": entry}});
        let route = asked.post("/api/route", &json!({"aim": aim})).json();
        (aim, route["refusal"].as_str().map(str::to_owned))
    };
    // From above the table: some needles cross what the rules of routes forbid.
    let around = (0..36).map(|step| {
        let angle = -std::f64::consts::PI * f64::from(step) / 36.0;
        refusal([x + 0.2 * libm::cos(angle), y + 0.2 * libm::sin(angle), z])
    });
    let all: Vec<_> = around.collect();
    let (refused, why) = all
        .iter()
        .find(|(_, why)| why.is_some())
        .expect("a needle is refused");
    let (allowed, _) = all
        .iter()
        .find(|(_, why)| why.is_none())
        .expect("a way is free");
    let save = |aim: &Value, name: &str, consent: Value| {
        server.post(
            "/api/plan",
            &json!({"aim": aim, "name": name, "consent": consent}),
        )
    };
    let asked = save(refused, "mine", json!({}));
    assert_eq!(
        (asked.status, &asked.json()["ask"]),
        (409, &json!("refused")),
        "{}",
        asked.text()
    );
    assert!(!server.folder().join("mine.toml").exists());
    let agreed = save(refused, "mine", json!({"refused": true}));
    assert_eq!(
        agreed.json()["refusal"].as_str(),
        why.as_deref(),
        "{}",
        agreed.text()
    );
    let text = std::fs::read_to_string(server.folder().join("mine.toml")).unwrap();
    assert!(
        text.contains(&format!("REJECTED: {}", why.as_ref().unwrap())),
        "{text}"
    );
    assert!(!text.contains("not evaluated"), "{text}");
    // The same again changes nothing; another text is asked about, and has a name of its own to go to.
    assert_eq!(save(refused, "mine", json!({"refused": true})).status, 200);
    let asked = save(allowed, "mine", json!({}));
    assert_eq!(asked.status, 409);
    assert_eq!(
        [&asked.json()["ask"], &asked.json()["free"]],
        [&json!("overwrite"), &json!("mine-2")]
    );
    assert_eq!(
        text,
        std::fs::read_to_string(server.folder().join("mine.toml")).unwrap()
    );
    assert_eq!(
        save(allowed, "mine", json!({"overwrite": true})).status,
        200
    );
    assert_ne!(
        text,
        std::fs::read_to_string(server.folder().join("mine.toml")).unwrap()
    );
    let simulated = server.post("/api/simulation", &json!({"aim": refused, "name": "third"}));
    assert_eq!(simulated.status, 409, "{}", simulated.text());
}

#[test]
fn a_folder_that_disappears_is_said_and_what_is_shown_stays() {
    let server = Running::start();
    std::fs::remove_dir_all(server.folder()).unwrap();
    let body = json!({"version": 0, "state": {"notes": "mine"}}).to_string();
    let refused = server.asked("PUT", "/api/session").body(&body).send();
    assert_eq!(refused.status, 410);
    assert!(refused.json()["hint"].as_str().unwrap().contains("folder"));
    assert_eq!(server.get("/api/session").status, 410);
    assert!(!server.folder().exists(), "nothing makes it anew");
    assert_eq!(server.get("/api/volume").status, 200);
}

#[test]
fn connections_that_say_nothing_are_let_go_and_keep_nobody_out() {
    let server = Running::start();
    // More than there is room for at once.
    let mut idle: Vec<TcpStream> = (0..80)
        .map(|_| {
            let mut stream = TcpStream::connect(("127.0.0.1", server.port)).unwrap();
            stream.write_all(b"GET").unwrap();
            stream
        })
        .collect();
    assert_eq!(server.get("/api/case").status, 200);
    let first = &mut idle[0];
    first
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    let mut said = Vec::new();
    // Let go, with a word or without.
    assert!(first.read_to_end(&mut said).is_ok(), "it is still held");
}

#[cfg(unix)]
#[test]
fn a_lock_that_is_a_link_is_not_followed() {
    let made = support::patient();
    let folder = support::copy_of(&made);
    let outside = folder.path().with_extension("outside");
    std::fs::write(&outside, "somebody else's").unwrap();
    std::os::unix::fs::symlink(&outside, folder.path().join("session.lock")).unwrap();
    let case = needlebench_viewer::Case::open(
        folder.path(),
        &needlebench_scenario::Overrides::default(),
        &std::sync::atomic::AtomicBool::new(false),
    );
    let refused = needlebench_viewer::Server::new(case.unwrap(), 0, "needlebench".into());
    assert!(matches!(
        refused,
        Err(needlebench_viewer::ServerError::LockIsNoFile)
    ));
    assert_eq!(
        std::fs::read_to_string(&outside).unwrap(),
        "somebody else's"
    );
    std::fs::remove_file(&outside).unwrap();
}

#[test]
fn ten_at_once_are_all_answered() {
    let server = Running::start();
    let [x, y, z] = support::NODULE_M;
    std::thread::scope(|scope| {
        for client in 0..10 {
            let server = &server;
            scope.spawn(move || {
                for turn in 0..20 {
                    let entry = [
                        x + 1e-3 * f64::from(client),
                        y - 0.2,
                        z + 1e-3 * f64::from(turn),
                    ];
                    let aim = json!({"target": {"lesion": "nodule"}, "entry": {"place_m": entry}});
                    let answer = server.post(
                        "/api/route",
                        &json!({"aim": aim, "page": client.to_string(), "turn": turn}),
                    );
                    assert_eq!(answer.status, 200, "{}", answer.text());
                    if turn % 10 == 0 {
                        assert_eq!(server.get("/api/volume").status, 200);
                    }
                }
            });
        }
    });
    assert_eq!(server.get("/api/case").status, 200);
}

#[test]
fn folders_that_do_not_belong_together_are_refused() {
    let made = support::patient();
    let refused = |change: &dyn Fn(&std::path::Path), word: &str| {
        let folder = support::copy_of(&made);
        change(folder.path());
        let Err(needlebench_patient::Stop::Refused(findings)) = needlebench_viewer::Case::open(
            folder.path(),
            &needlebench_scenario::Overrides::default(),
            &std::sync::atomic::AtomicBool::new(false),
        ) else {
            panic!("it was taken: {word}");
        };
        let said = findings[0].to_string();
        assert!(said.contains(word), "{said}");
        assert!(findings[0].hint.is_some(), "{said}");
    };
    let replace = |file: &str, from: &str, to: &str| {
        let (file, from, to) = (file.to_owned(), from.to_owned(), to.to_owned());
        move |folder: &std::path::Path| {
            let text = std::fs::read_to_string(folder.join(&file)).unwrap();
            assert!(text.contains(&from), "{from}");
            std::fs::write(folder.join(&file), text.replacen(&from, &to, 1)).unwrap();
        }
    };
    refused(
        &|folder| std::fs::remove_file(folder.join("volume.nii.gz")).unwrap(),
        "no volume",
    );
    refused(
        &|folder| std::fs::remove_file(folder.join("labels.nii.gz")).unwrap(),
        "no label map",
    );
    refused(
        &|folder| std::fs::remove_file(folder.join("report.json")).unwrap(),
        "report.json",
    );
    refused(
        &replace(
            "report.json",
            "\"voxels_sha256\": \"",
            "\"voxels_sha256\": \"00",
        ),
        "different Hounsfield units",
    );
    refused(
        &replace(
            "report.json",
            "\"labels_sha256\": \"",
            "\"labels_sha256\": \"00",
        ),
        "label map",
    );
    refused(
        &|folder| {
            std::fs::copy(
                folder.join("surfaces/skin.stl"),
                folder.join("surfaces/lung_left.stl"),
            )
            .map(|_| ())
            .unwrap();
        },
        "lung_left",
    );
    refused(
        &replace("scenario.toml", "name = \"skin\"", "name = \"hide\""),
        "skin",
    );
}

#[test]
fn a_folder_is_shown_once_at_a_time() {
    let folder = support::copy_of(&support::patient());
    let server = || {
        let go = std::sync::atomic::AtomicBool::new(false);
        let overrides = needlebench_scenario::Overrides::default();
        let case = needlebench_viewer::Case::open(folder.path(), &overrides, &go).unwrap();
        needlebench_viewer::Server::new(case, 0, std::path::PathBuf::from("false"))
    };
    let first = server().unwrap();
    let Err(second) = server() else {
        panic!("two servers write one session");
    };
    assert!(matches!(second, needlebench_viewer::ServerError::Shown));
    assert!(second.hint().is_some());
    drop(first);
    server().unwrap();
}

/// What the normal within 12 mm of the skin changes by where voxels of 4 mm and the surface made of them differ by half of one.
const SAME_ANGLE_RAD: f64 = 0.05;

#[test]
fn entries_are_those_of_the_rules_and_needles_to_them_are_judged_alike() {
    let server = Running::start();
    let aim = json!({"target": {"lesion": "nodule"}});
    let answer = server
        .post("/api/entries", &json!({"aim": aim, "robot": false}))
        .json();
    let plan = &answer["plan"];
    let map = &plan["map"];
    let tried = map["azimuth_deg"].as_array().unwrap().len();
    let free: Vec<usize> = (0..tried)
        .filter(|&index| map["rule"][index].is_null())
        .collect();
    assert!(
        tried == 20_000 && plan["free"] == free.len(),
        "{} {}",
        plan["free"],
        free.len()
    );
    assert!(!free.is_empty());
    assert!(
        answer["remarks"]
            .as_array()
            .unwrap()
            .iter()
            .any(|it| it["message"].as_str().unwrap().contains("heart"))
    );
    // A needle that comes from a direction.
    let target = &plan["target_in_phantom_m"];
    let needle = |azimuth_deg: &Value, elevation_deg: &Value| {
        let [azimuth, elevation] =
            [azimuth_deg, elevation_deg].map(|angle| angle.as_f64().unwrap().to_radians());
        let way = [
            libm::cos(elevation) * libm::sin(azimuth),
            -libm::cos(elevation) * libm::cos(azimuth),
            libm::sin(elevation),
        ];
        let place: Vec<f64> = (0..3)
            .map(|axis| {
                target[axis].as_f64().unwrap()
                    + plan["phantom_origin_in_ct_m"][axis].as_f64().unwrap()
                    + 0.1 * way[axis]
            })
            .collect();
        let aim = json!({"target": {"lesion": "nodule"}, "entry": {"place_m": place}});
        server.post("/api/route", &json!({"aim": aim})).json()
    };
    // Needles in directions of the map, one that is free and one of each rule.
    let mut seen = std::collections::BTreeSet::new();
    let mut judged = 0;
    for index in (0..tried).filter(|index| map["depth_m"][*index].is_number()) {
        if !seen.insert(map["rule"][index].to_string()) {
            continue;
        }
        let route = needle(&map["azimuth_deg"][index], &map["elevation_deg"][index]);
        let told = &route["judged"];
        assert_eq!(
            told["free"],
            map["rule"][index].is_null(),
            "{told} {}",
            map["rule"][index]
        );
        judged += 1;
    }
    assert!(judged >= 3, "{judged}");
    // Its angle to the skin is that of the plan, as far as surface and voxels have one skin.
    for known in plan["routes"].as_array().unwrap().iter().take(5) {
        let [azimuth, elevation] = [0, 1].map(|at| &known["direction_deg"][at]);
        let route = needle(azimuth, elevation);
        let [here, there] = [&route["skin_angle_rad"], &known["angle_to_skin_normal_rad"]]
            .map(|angle| angle.as_f64().unwrap());
        assert!((here - there).abs() < SAME_ANGLE_RAD, "{here} {there}");
    }
    // Of another target nobody has asked.
    let aim =
        json!({"target": {"index": [30.0, 30.0, 30.0]}, "entry": {"index": [30.0, 0.0, 30.0]}});
    let route = server.post("/api/route", &json!({"aim": aim})).json();
    assert!(
        route["judged"].is_null() || route["refused"].is_object(),
        "{route}"
    );
    // A target that is none.
    let aim = json!({"target": {"index": [0.0, 0.0, 0.0]}});
    let refused = server.post("/api/entries", &json!({"aim": aim})).json();
    assert!(
        refused["refused"]["message"].is_string() && refused["refused"]["hint"].is_string(),
        "{refused}"
    );
}
