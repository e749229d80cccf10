//! Wraps against listing every combination and sorting.

use std::f64::consts::{PI, TAU};

use needlebench_numerics::random::SplitMix64;
use proptest::prelude::*;

use super::{Wrap, WrapOrder, WrapSearch, closed_form, nearest_within_limits};
use crate::pose_sets::PoseSet;
use crate::{JOINT_COUNT, JointLimits, Joints, LimitPolicy, UrGeometry, UrModel};

fn limits(policy: LimitPolicy) -> JointLimits {
    policy.limits_of(UrModel::Ur3)
}

/// What [`WrapSearch`] promises, by brute force: all combinations of `-turns..=turns`, sorted.
fn listed(
    postures: &[Joints],
    limits: &JointLimits,
    seed: &Joints,
    weights: &Joints,
    order: WrapOrder,
    turns: i32,
) -> Vec<Wrap> {
    let mut found = Vec::new();
    for (posture, q) in postures.iter().enumerate() {
        let mut rows = vec![([0; JOINT_COUNT], *q)];
        for joint in 0..JOINT_COUNT {
            rows = rows
                .iter()
                .flat_map(|&(row, joints)| {
                    (-turns..=turns).filter_map(move |k| {
                        let (mut row, mut joints) = (row, joints);
                        row[joint] = k;
                        joints[joint] = limits.0[joint].admit(q[joint] + TAU * f64::from(k))?;
                        Some((row, joints))
                    })
                })
                .collect();
        }
        for (turns, joints) in rows {
            let costs: [f64; 6] =
                std::array::from_fn(|i| weights[i] * (joints[i] - seed[i]).powi(2));
            let sum: f64 = costs.iter().sum();
            let key = match order {
                WrapOrder::Distance => [sum, 0.0],
                WrapOrder::LargestJoint => [costs.into_iter().fold(0.0, f64::max), sum],
            };
            let distance_rad = sum.sqrt();
            found.push((
                (key, costs),
                Wrap {
                    posture,
                    joints,
                    turns,
                    distance_rad,
                },
            ));
        }
    }
    found.sort_by(|(a, x), (b, y)| {
        let ladders = |costs: &[f64; 6], wrap: &Wrap| {
            std::array::from_fn::<_, 6, _>(|i| (costs[i], wrap.turns[i]))
        };
        a.0.partial_cmp(&b.0)
            .unwrap()
            .then(x.posture.cmp(&y.posture))
            .then(ladders(&a.1, x).partial_cmp(&ladders(&b.1, y)).unwrap())
    });
    found.into_iter().map(|(_, wrap)| wrap).collect()
}

fn joints(range: std::ops::Range<f64>) -> impl Strategy<Value = Joints> {
    prop::array::uniform6(range).prop_map(Joints::from)
}

/// A joint where something may go wrong: on a limit, half a turn from the seed, or anywhere.
fn critical_joints() -> impl Strategy<Value = Joints> {
    let joint = prop_oneof![
        prop::sample::select(vec![
            0.0,
            PI,
            -PI,
            PI.next_down(),
            PI.next_up(),
            PI / 2.0,
            TAU,
            -TAU
        ]),
        -PI..PI,
    ];
    prop::array::uniform6(joint).prop_map(Joints::from)
}

fn any_limits() -> impl Strategy<Value = JointLimits> {
    let reach = prop_oneof![prop::sample::select(vec![PI, TAU, 1.5 * TAU]), 1.0..8.0];
    prop::array::uniform6(reach).prop_map(|reach_rad| limits(LimitPolicy { reach_rad }))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn wraps_are_all_combinations_sorted(
        postures in prop::collection::vec(critical_joints(), 1..3),
        seed in joints(-7.0..7.0),
        weights in joints(0.1..10.0),
        limits in any_limits(),
        by_joint in any::<bool>(),
    ) {
        let order = if by_joint { WrapOrder::LargestJoint } else { WrapOrder::Distance };
        let search = WrapSearch::new(&limits, &seed).weighted(&weights).unwrap().ordered_by(order);
        // No limit is further than 1.5 turns off and no posture than one.
        let expected = listed(&postures, &limits, &seed, &weights, order, 3);
        let found: Vec<Wrap> = search.wraps_of_all(postures.iter().copied()).collect();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn the_nearest_is_the_first(q in critical_joints(), seed in critical_joints(), limits in any_limits()) {
        let search = WrapSearch::new(&limits, &seed);
        prop_assert_eq!(search.nearest(&q), search.wraps(&q).next());
        prop_assert_eq!(nearest_within_limits(&q, &limits, &seed), search.nearest(&q));
    }

    #[test]
    fn an_endless_joint_gives_sorted_wraps_without_end(q in joints(-PI..PI), seed in joints(-9.0..9.0)) {
        let limits = limits(LimitPolicy::of_ros(UrModel::Ur3));
        let search = WrapSearch::new(&limits, &seed);
        let found: Vec<Wrap> = search.wraps(&q).take(2000).collect();
        prop_assert_eq!(found.len(), 2000);
        prop_assert!(found.windows(2).all(|pair| pair[0].distance_rad <= pair[1].distance_rad));
        // Four joints have two wraps each and the elbow one: 16 times 41 turns of wrist 3.
        let bounded: Vec<Wrap> = search.at_most_turns(20).wraps(&q).collect();
        prop_assert_eq!(bounded.len(), 16 * 41);
        let none_missing = bounded.iter().take(400).all(|wrap| found.contains(wrap));
        prop_assert!(none_missing);
    }
}

#[test]
fn the_eight_solutions_of_a_pose_have_512_wraps_of_which_each_reproduces_it() {
    /// Rounding of two whole turns and of the product of six transforms.
    const POSE: f64 = 1e-14;
    let geometry = UrGeometry::UR3;
    let limits = limits(LimitPolicy::FULL_TURNS);
    let mut random = SplitMix64::new(3);
    let (pose, answer) = loop {
        let q = PoseSet::Generic.sample(&geometry, &mut random, 0.0);
        let pose = geometry.base_from_flange(&q);
        let answer = closed_form(&geometry, &pose, None);
        if answer.count() == 8 {
            break (pose, answer);
        }
    };
    let seed = Joints::new(0.3, -1.2, 4.0, -5.0, 0.1, 6.0);
    let search = WrapSearch::new(&limits, &seed);
    let rows: Vec<Joints> = answer.solutions().map(|row| row.joints).collect();
    let wraps: Vec<Wrap> = search.wraps_of_all(rows.iter().copied()).collect();
    assert_eq!(wraps.len(), 512);
    for wrap in &wraps {
        assert_eq!(limits.first_violation(&wrap.joints), None);
        let reached = geometry.base_from_flange(&wrap.joints);
        let nominal = geometry.base_from_flange(&rows[wrap.posture]);
        let moved = (reached.translation.vector - nominal.translation.vector).norm();
        assert!(moved < POSE, "{moved}");
        let missed = (reached.translation.vector - pose.translation.vector).norm();
        assert!(missed < 2.0 * POSE, "{missed}");
    }
}

#[test]
fn a_joint_on_its_limit_is_on_both() {
    let limits = limits(LimitPolicy::HALF_TURNS);
    let q = Joints::new(0.0, 0.0, PI, 0.0, -PI, 0.0);
    let wraps: Vec<Wrap> = WrapSearch::new(&limits, &Joints::zeros())
        .wraps(&q)
        .collect();
    let ends: Vec<(f64, f64)> = wraps.iter().map(|w| (w.joints[2], w.joints[4])).collect();
    // Equally far from the seed: lower turns of the elbow first.
    assert_eq!(ends, [(-PI, -PI), (-PI, PI), (PI, -PI), (PI, PI)]);
}

#[test]
fn equal_distances_come_in_the_order_of_the_postures_then_first_joints_nearest_first() {
    let limits = limits(LimitPolicy::FULL_TURNS);
    let zero = Joints::zeros();
    let search = WrapSearch::new(&limits, &zero);
    let wraps: Vec<Wrap> = search.wraps_of_all([zero, zero]).collect();
    assert_eq!(wraps.len(), 2 * 729);
    assert!(wraps.windows(2).all(|pair| {
        let key = |wrap: &Wrap| {
            // No turn before one down before one up.
            let rungs = wrap.turns.map(|turns| (turns.abs(), turns));
            (wrap.distance_rad, wrap.posture, rungs)
        };
        key(&pair[0]) < key(&pair[1])
    }));
}

#[test]
fn what_has_no_place_has_no_wraps_and_hides_no_others() {
    let mut narrow = limits(LimitPolicy::FULL_TURNS);
    narrow.0[1].lower_rad = 1.0;
    narrow.0[1].upper_rad = 2.0;
    let (outside, inside) = (Joints::zeros(), Joints::repeat(1.5 - TAU));
    let search = WrapSearch::new(&narrow, &outside);
    assert_eq!(search.nearest(&outside), None);
    let mut wraps = search.wraps_of_all([outside, inside]);
    assert!(wraps.all(|wrap| wrap.posture == 1 && wrap.turns[1] == 1));
    assert_eq!(wraps.next(), None);

    let nowhere = Joints::repeat(f64::NAN);
    assert_eq!(search.wraps(&nowhere).next(), None);
    assert_eq!(WrapSearch::new(&narrow, &nowhere).nearest(&inside), None);
    // Turns are refused where they are needed.
    assert_eq!(search.at_most_turns(0).nearest(&inside), None);
}

#[test]
fn weights_must_be_positive_and_finite() {
    let limits = limits(LimitPolicy::FULL_TURNS);
    let search = WrapSearch::new(&limits, &Joints::zeros());
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut weights = Joints::repeat(1.0);
        weights[4] = bad;
        assert_eq!(search.weighted(&weights).unwrap_err().joint, 4);
    }
}
