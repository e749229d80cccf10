//! A phantom that is moved by itself is where the scenario's keys put it.

use std::path::Path;

use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::{Change, KeyPath, Overrides, PhantomMove, ScenarioFamily, Setting};

/// Of `vary`: what a move gives, or what is wrong with it.
fn agrees(scenario: &str, changes: &[(KeyPath, Change)], far_mm: f64) -> [u32; 2] {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let family = ScenarioFamily::load(&folder.join(scenario), &Overrides::default()).unwrap();
    let mut random = SplitMix64::new(11);
    let (mut there, mut refused) = (0, 0);
    for goal in family.goals() {
        let moves = family.phantom_moves(goal, changes).unwrap();
        assert_eq!(moves.base(), &family.vary(goal, changes).unwrap());
        for k in 0..150 {
            // Near, far, and out of all ranges.
            let far = [1.0, 10.0, 100.0, 1000.0][k % 4] * far_mm * 1e-3;
            let mut by = || random.uniform(-far, far);
            let by = if k % 3 == 0 {
                PhantomMove::Turn([by(), by()])
            } else {
                PhantomMove::Shift([by(), by(), by()])
            };
            let mut all = changes.to_vec();
            all.extend(by.changes());
            match (moves.moved(&by), family.vary(goal, &all)) {
                (Ok(moved), Ok(resolved)) => {
                    assert_eq!(Some(&moved.phantom), resolved.phantom.as_ref());
                    assert_eq!(moved.goal, resolved.goals[0]);
                    let section = resolved.scenario.phantom.as_ref();
                    assert_eq!(Some(&moves.section_after(&by)), section);
                    there += 1;
                }
                (Err(moved), Err(resolved)) => {
                    assert_eq!(moved, resolved);
                    refused += 1;
                }
                (moved, resolved) => panic!("{scenario} {goal} {by:?}: {moved:?} {resolved:?}"),
            }
        }
    }
    [there, refused]
}

#[test]
fn a_moved_phantom_is_where_the_keys_put_it() {
    let set = |key: &str, value: Setting| (KeyPath::parse(key).unwrap(), Change::Set(value));
    let floating = [
        set("phantom.rest_on_table", false.into()),
        set("phantom.position_mm", [0.0, 10.0, 905.0].into()),
    ];
    let distant = [set("people.persons", Setting::from([0.0; 0]))];
    for (scenario, changes, far_mm) in [
        ("studies/chest.toml", &[][..], 300.0),
        ("studies/chest.toml", &floating, 100.0),
        ("studies/chest.toml", &[], 6000.0),
        // Its goal stays, its people are given places, it has obstacles.
        ("table3.toml", &[], 200.0),
        ("supine_suite.toml", &distant, 800.0),
        ("supine_suite.toml", &[], 800.0),
        ("hanging.toml", &[], 400.0),
        ("lateral.toml", &[], 300.0),
    ] {
        let [there, refused] = agrees(scenario, changes, far_mm);
        assert!(there > 20 && refused > 5, "{scenario}: {there} {refused}");
    }
}
