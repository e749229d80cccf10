//! `needlebench ct routes`, and goals with planned routes.

use std::fs;
use std::sync::OnceLock;

use crate::support::{Bench, Json, has_keys, holds, numbers, with_edit, workspace};

/// A chest of coarse pixels with markers that the robot has touched, and the patient made of it.
fn built() -> &'static Bench {
    static BUILT: OnceLock<Bench> = OnceLock::new();
    BUILT.get_or_init(build)
}

fn build() -> Bench {
    let text = fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap();
    let bench = Bench::shared();
    bench.write("s.toml", text);
    let scan = "ct synth s.toml --out ct --markers ct-sphere --pixels 300 --preset biopsy --no-labels \
         --shift-mm 10,-20,-300";
    bench.run(scan).exits_with(0);
    let build = "ct build ct/ct.nii.gz --out patient --lesion nodule=-97,-10,-265 --thickness-mm 2.5 \
                 --markers ct/marker_list.toml --room s.toml --no-pictures";
    bench.run(build).exits_with(0);
    bench
}

#[test]
fn routes_in_a_scan_are_planned_with_the_robot_written_and_checked() {
    let bench = built();
    let arguments = "ct routes patient --directions 3000 --write patient/planned.toml --json";
    let found = bench.run(arguments).exits_with(0).json();
    has_keys(
        &found,
        "schema_version ok findings targets unlabelled remarks written",
    );
    let unlabelled = found["unlabelled"].list().iter();
    let unlabelled: Vec<&str> = unlabelled.map(|row| row["name"].word()).collect();
    for name in ["bone", "mediastinum", "intercostal_vessels"] {
        assert!(unlabelled.contains(&name), "{unlabelled:?}");
    }
    assert!(!unlabelled.contains(&"skin") && !unlabelled.contains(&"markers"));
    let target = &found["targets"][0];
    assert_eq!(target["goal"], "nodule");
    assert_eq!(target["anatomy"], "voxels");
    assert_eq!(target["robot_not_asked"], serde_json::Value::Null);
    let chosen = target["chosen"]["route"].as_u64().unwrap();
    let route = &target["routes"][usize::try_from(chosen).unwrap()];
    assert_eq!(route["pleural_crossings"], 1);
    let working = route["working"].as_u64().unwrap();
    assert!(working >= target["wanted"].as_u64().unwrap());
    // Margins hold with the error of every configuration that works.
    let sigmas = target["sigmas"].number();
    let constant_m = target["margin_constant_m"].number();
    for each in route["configurations"].list() {
        if each["works"] != true {
            assert!(each["reason"].is_string(), "{each}");
            continue;
        }
        let error = &each["error"];
        let (bias_m, sd_m) = (error["bias_m"].number(), error["sd_m"].number());
        let spare_m = each["spare_m"].number();
        let mut least_m = f64::INFINITY;
        for margin in route["margins"].list() {
            if let Some(distance_m) = margin["distance_m"].as_f64() {
                let wanted_m =
                    (constant_m + bias_m + sigmas * sd_m).max(margin["margin_m"].number());
                least_m = least_m.min(distance_m - wanted_m);
            }
        }
        assert!((least_m - spare_m).abs() < 1e-9, "{each}");
        assert!(spare_m >= 0.0);
    }
    // The terms make the sum.
    let terms = route["risk"]["terms"].list();
    let sum: f64 = terms.iter().map(|term| term["log_odds"].number()).sum();
    assert!((libm::exp(sum) - route["risk"]["odds_ratio"].number()).abs() < 1e-9);
    // The file has every direction with its rule and value.
    let file = bench.read_json("patient/routes.json");
    let map = &file["targets"][0]["map"];
    let rules = map["rule"].list();
    assert_eq!(rules.len(), 3000);
    let values = map["value"].list();
    let odds = map["odds_ratio"].list();
    let known = rules
        .iter()
        .zip(values)
        .filter(|(rule, value)| rule.is_u64() && value.is_f64());
    assert!(known.count() > 1500);
    assert!(
        rules
            .iter()
            .zip(odds)
            .all(|(rule, odds)| rule.is_null() == odds.is_f64())
    );
    // The entry is on the skin of the patient that is run: the scenario says how deep the needle goes.
    let checked = bench
        .run("check patient/planned.toml --json")
        .exits_with(0)
        .json();
    assert_eq!(checked["ok"], true);
    // The same on another number of threads.
    let alone = "ct routes patient --directions 3000 --json --jobs 1 --out other";
    let again = bench.run(alone).exits_with(0).json();
    assert_eq!(again["targets"], found["targets"]);
    let entry = numbers(&route["entry_in_phantom_m"]);
    assert_eq!(entry.len(), 3);
}

/// Markups are where the paths are in the scan, though the robot is registered and the patient lies elsewhere.
#[test]
fn needles_become_markups_in_the_coordinates_of_the_scan() {
    let bench = built();
    let plan =
        "ct routes patient --directions 3000 --no-robot --write patient/markups.toml --out routes";
    let found = bench.run(format!("{plan} --json")).exits_with(0).json();
    let plan = &found["targets"][0];
    let chosen = plan["chosen"]["route"].as_u64().unwrap();
    let route = &plan["routes"][usize::try_from(chosen).unwrap()];
    let origin = numbers(&plan["phantom_origin_in_ct_m"]);
    assert!(origin.iter().any(|each| each.abs() > 1e-3));
    let in_scan_mm = |place: &serde_json::Value| {
        let place = numbers(place).into_iter().zip(&origin);
        place
            .map(|(phantom_m, origin_m)| 1e3 * (phantom_m + origin_m))
            .collect::<Vec<_>>()
    };
    let file = "slicer/needles.mrk.json";
    let export = |scenario: &str| bench.run(format!("export {scenario} --as markups --out {file}"));
    export("patient/markups.toml").exits_with(0).says([file]);
    let document = bench.read_json(file);
    let [line, entries, targets] = &document["markups"].list()[..] else {
        panic!("{document}")
    };
    let is_at = |point: &serde_json::Value, wanted: &[f64]| {
        let position = numbers(&point["position"]);
        let mut pairs = position.iter().zip(wanted);
        // The skin of the voxels, and its surface.
        assert!(
            pairs.all(|(a, b)| (a - b).abs() < 0.5),
            "{point} {wanted:?}"
        );
    };
    let entry = in_scan_mm(&route["entry_in_phantom_m"]);
    let target = in_scan_mm(&plan["target_in_phantom_m"]);
    assert_eq!(line["name"], "nodule");
    assert_eq!(line["coordinateSystem"], "LPS");
    assert_eq!(line["coordinateUnits"], "mm");
    is_at(&line["controlPoints"][0], &entry);
    is_at(&line["controlPoints"][1], &target);
    is_at(&entries["controlPoints"][0], &entry);
    is_at(&targets["controlPoints"][0], &target);
    // A tip that ends elsewhere is said at the target.
    let text = bench.text("patient/markups.toml");
    let shorter = with_edit(
        &text,
        "[[goals]]\n",
        "[[goals]]\ninsertion_length_mm = 40\n",
    );
    bench.write("patient/shorter.toml", shorter);
    export("patient/shorter.toml").exits_with(0);
    let point = bench.read_json(file)["markups"][0]["controlPoints"][1].clone();
    is_at(&point, &target);
    holds(
        point["description"].word(),
        ["the planned needle tip ends ", " mm before it"],
    );
    // Where surfaces are elsewhere or turned, so is the patient: these are no coordinates of the scan.
    let at = "name = \"skin\"\nposition_mm = [";
    let from = text.find(at).unwrap() + at.len();
    let first = &text[from..from + text[from..].find(',').unwrap()];
    let nearer = format!("{}", first.parse::<f64>().unwrap() + 1.0);
    let moved = text.replace(
        &format!("\nposition_mm = [{first},"),
        &format!("\nposition_mm = [{nearer},"),
    );
    let turned = with_edit(&text, at, &format!("rpy_deg = [0, 0, 0.5]\n{at}"));
    for (edited, what) in [(moved, "1.00 mm from its position"), (turned, "is turned")] {
        bench.write("patient/edited.toml", edited);
        export("patient/edited.toml")
            .exits_with(2)
            .complains(["phantom.parts", what, "hint: "]);
    }
}

#[test]
fn what_cannot_be_planned_is_said() {
    let bench = built();
    let fails = |arguments: &str, words: &str| {
        let all = format!("ct routes {arguments}");
        let text = bench.run(&all).exits_with(2).stderr;
        let flat: Vec<&str> = text.split_whitespace().collect();
        assert!(flat.join(" ").contains(words), "{text}");
    };
    fails("patient --target 0,0,900", "outside");
    fails("patient --lesion no_such", "no_such");
    fails("nowhere", "nowhere");
    fails("ct", "ct build");
    fails("patient --write elsewhere.toml", "scenario's folder");
    // Without markers nobody knows where the robot is: routes by the patient alone, and why.
    let build = "ct build ct/ct.nii.gz --out unregistered --lesion nodule=-97,-10,-265 --thickness-mm 2.5 \
                 --room s.toml --no-pictures";
    bench.run(build).exits_with(0);
    let arguments = "ct routes unregistered --directions 1000 --json";
    let found = bench.run(arguments).exits_with(0).json();
    let why = found["targets"][0]["robot_not_asked"].word();
    holds(why, ["markers", "--assume-room"]);
    assert_eq!(
        found["targets"][0]["routes"][0]["configurations"],
        serde_json::json!([])
    );
    fs::remove_file(bench.path("unregistered/labels.nii.gz")).unwrap();
    fails("unregistered", "--no-labels");
}

#[test]
fn a_goal_with_a_route_has_its_entry_planned() {
    let text = fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap();
    let start = text.find("entry_mm = [-156.4, 16.8, 15.2]").unwrap();
    let goal = text[..start].rfind("[[goals]]").unwrap();
    let end = start + text[start..].find("[goals.expected]").unwrap();
    let rest = text.find("[planning]").unwrap();
    let first = text.find("[[goals]]").unwrap();
    let own = text[goal..end].replace("entry_mm = [-156.4, 16.8, 15.2]\n", "");
    let planned = format!(
        "{}{own}\n[goals.route]\nsigmas = 1\n\n{}",
        &text[..first],
        &text[rest..]
    );
    let bench = Bench::with_scenario(&planned);
    let checked = bench.run("check s.toml").exits_with(0);
    let words: Vec<&str> = checked.stdout.split_whitespace().collect();
    let said = format!("{} {}", words.join(" "), checked.stderr);
    holds(
        &said,
        ["needle path planned for goal `right_pleural_lateral`"],
    );
    // Not both.
    let both = planned.replace(
        "[goals.route]",
        "entry_mm = [-156.4, 16.8, 15.2]\n[goals.route]",
    );
    let text = Bench::with_scenario(&both)
        .run("check s.toml")
        .exits_with(2)
        .stderr;
    holds(&text, ["has both an entry and a needle path to plan"]);
    // Rules that nothing keeps.
    let hard = planned.replace("sigmas = 1", "margin_mm = 40");
    // They are no fault of the file: what it asks for is not met.
    let bench = Bench::with_scenario(&hard);
    for command in [
        "check s.toml",
        "check s.toml --json",
        "run s.toml --out out",
    ] {
        let ran = bench.run(command).exits_with(1);
        let text = format!("{}{}", ran.stdout, ran.stderr);
        assert!(text.contains("has no needle path"), "{command}: {text}");
    }
}

#[test]
fn routes_recommend_what_a_run_of_the_plan_does() {
    let text = fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap();
    let bench = Bench::with_scenario(&text);
    for lesion in ["pleural_based", "right_upper_lobe"] {
        let arguments = format!(
            "ct routes s.toml --lesion {lesion} --directions 1500 --write {lesion}.toml --json"
        );
        let found = bench.run(&arguments).exits_with(0).json();
        let target = &found["targets"][0];
        let chosen = &target["chosen"];
        let recommended = chosen["configuration"].word();
        let route = &target["routes"][usize::try_from(chosen["route"].as_u64().unwrap()).unwrap()];
        let served = route["configurations"].list();
        let served = |label: &str| {
            let mut all = served.iter();
            let found = all.find(|each| each["label"].word() == label).unwrap();
            found["works"].as_bool().unwrap()
        };
        // Exit 1: what the file expects of configurations is expected of its own entries.
        let run = format!("run {lesion}.toml --engine rapier --no-pictures --out out --quiet");
        bench.run(&run);
        let report = bench.read_json(&format!("out/{lesion}/report.json"));
        let goals = report["goals"].list();
        let goal = goals
            .iter()
            .find(|goal| goal["name"] == target["goal"])
            .unwrap();
        let order = goal["ranking"]["order"].list();
        let first = order.iter().map(Json::word).find(|label| served(label));
        assert_eq!(Some(recommended), first, "{lesion}");
        if order[0].word() == recommended {
            assert_eq!(
                chosen["because"], goal["recommended"]["summary"],
                "{lesion}"
            );
        }
    }
}

#[test]
fn a_route_that_no_motion_serves_is_told_and_ends_with_1() {
    let text = fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap();
    let hard = text.replace(
        "max_peak_torque_ratio = 0.8",
        "max_peak_torque_ratio = 0.05",
    );
    assert_ne!(hard, text);
    let bench = Bench::with_scenario(&hard);
    let arguments =
        "ct routes s.toml --lesion pleural_based --directions 1500 --write p.toml --json";
    let found = bench.run(arguments).exits_with(1).json();
    assert_eq!(found["ok"], false);
    let chosen = &found["targets"][0]["chosen"];
    assert_eq!(chosen["configuration"], serde_json::Value::Null);
    holds(
        chosen["because"].word(),
        ["no configuration is feasible with its motion"],
    );
    // The route is there to be looked into.
    assert!(bench.path("p.toml").exists());
}

/// What a needle in tissue adds to the routes of a scenario.
#[test]
fn routes_of_a_needle_in_tissue_keep_their_margins_bent() {
    let text = fs::read_to_string(workspace().join("guide/examples/tissue.toml")).unwrap();
    let unknown = text.replace("bevel = \"inferior\"\n", "");
    let in_air = unknown.replace("model = \"tissue\"", "model = \"cantilever\"");
    assert!(text != unknown && unknown != in_air);
    let routes = |text: &str| {
        let bench = Bench::with_scenario(text);
        let arguments = "ct routes s.toml --no-robot --directions 1500 --json --out out";
        let found = bench.run(arguments).exits_with(0).json();
        let map = bench.read_json("out/routes.json")["targets"][0]["map"].clone();
        let printed = bench.run("ct routes s.toml --no-robot --directions 1500");
        (
            found["targets"][0].clone(),
            map,
            printed.exits_with(0).stdout,
        )
    };
    let [known, unknown, in_air] = [&text, &unknown, &in_air].map(|text| routes(text));
    let count = |plan: &serde_json::Value| {
        let refused = plan["refused"].list().iter();
        let mut bent = refused.filter(|each| each["rule"] == "bent");
        bent.next()
            .map_or(0, |bent| bent["count"].as_u64().unwrap())
    };
    let free = |plan: &serde_json::Value| plan["free"].as_u64().unwrap();
    for (plan, map, printed) in [&known, &unknown] {
        assert_eq!(free(plan) + count(plan), free(&in_air.0));
        assert!(map["rules"].list().iter().any(|rule| rule == "bent"));
        holds(printed, ["bend: of the tip of the median needle"]);
        for route in plan["routes"].list() {
            let bend = &route["bend"];
            assert!(bend["tip_m"].number() > 1e-4, "{bend}");
            for margin in bend["margins"].list() {
                let kept = margin["distance_m"]
                    .as_f64()
                    .is_none_or(|m| m >= margin["margin_m"].number());
                assert!(kept || bend["towards_in_phantom"].is_null(), "{bend}");
            }
        }
    }
    let towards =
        |plan: &serde_json::Value| plan["routes"][0]["bend"]["towards_in_phantom"].clone();
    // Its face looks to the feet.
    assert!(numbers(&towards(&known.0))[2] > 0.5);
    assert!(towards(&unknown.0).is_null());
    // A bend to any side is part of the error that the margins are for.
    assert_eq!(count(&unknown.0), 0);
    assert!(count(&known.0) > 0);
    holds(known.0["bent"]["reason"].word(), ["bent by", "asked for"]);
    let known_side = [
        "admissible for the straight needle alone",
        "behind the slash",
    ];
    holds(&known.2, known_side);
    holds(&unknown.2, ["to a side that is not known"]);
    // In air nothing of it is there.
    assert!(in_air.0.get("bent").is_none() && in_air.0["routes"][0].get("bend").is_none());
    assert!(in_air.1["rules"].list().iter().all(|rule| rule != "bent"));
    assert!(!in_air.2.contains("bend"));
}
