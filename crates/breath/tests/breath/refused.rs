//! What is no recording of breath, and what is doubtful.

use needlebench_breath::{Recording, Samples, statistics};
use needlebench_input::Finding;

use crate::synthetic::{Law, QUIET, REGULAR, along};

fn made() -> Samples {
    let mut samples = along(&QUIET.displacement_m(120.0, 5), 0.1);
    samples.places = (2..samples.times_s.len() + 2).collect();
    samples
}

fn refused(samples: Samples) -> Finding {
    Recording::from_samples("made", samples).unwrap_err()
}

#[test]
fn a_clock_that_does_not_come_back_is_refused_with_its_line() {
    let mut samples = made();
    for time_s in &mut samples.times_s[600..] {
        *time_s -= 60.0;
    }
    let finding = refused(samples);
    assert_eq!(finding.line, Some(602));
    assert!(
        finding.message.contains("jumps from 59.900 s to 0.000 s"),
        "{finding}"
    );
    let mut samples = made();
    for time_s in &mut samples.times_s[600..700] {
        *time_s = 59.9;
    }
    assert_eq!(refused(samples).line, Some(602));
}

#[test]
fn single_times_that_are_astray_are_lost_samples() {
    let whole = Recording::from_samples("made", made()).unwrap();
    for wrong_s in [0.03, 4e3] {
        let mut samples = made();
        samples.times_s[300] = wrong_s;
        samples.times_s[301] = wrong_s + 0.2;
        samples.times_s[900] = wrong_s;
        let recording = Recording::from_samples("made", samples).unwrap();
        assert_eq!(recording.lost.out_of_order, 3, "{wrong_s}");
        assert!(recording.gaps.is_empty());
        assert_eq!(
            recording.segments[0].displacement_m.len(),
            whole.segments[0].displacement_m.len()
        );
    }
}

#[test]
fn lost_samples_are_cut_and_counted_and_long_gaps_split() {
    let mut samples = made();
    for at in [100, 101, 102, 400] {
        samples.positions_m[at] = [0.0; 3];
    }
    samples.positions_m[500][1] = f64::NAN;
    samples.times_s[600] = f64::INFINITY;
    for position in &mut samples.positions_m[700..720] {
        *position = [0.0; 3];
    }
    let recording = Recording::from_samples("made", samples).unwrap();
    assert_eq!((recording.lost.zero, recording.lost.not_finite), (24, 2));
    assert_eq!(recording.segments.len(), 2);
    let gap = recording.gaps[0];
    assert!(
        (gap.after_s - 69.9).abs() < 1e-9 && (gap.length_s - 2.1).abs() < 1e-9,
        "{gap:?}"
    );
    // Three lost samples are bridged by a line.
    assert_eq!(recording.segments[0].displacement_m.len(), 700);
    let whole = statistics(&Recording::from_samples("made", made()).unwrap()).unwrap();
    let found = statistics(&recording).unwrap();
    assert!(
        whole.breaths - found.breaths <= 2,
        "a breath over the gap is none"
    );
    assert!((found.amplitude_m.value - whole.amplitude_m.value).abs() < 3e-4);
}

#[test]
fn a_single_coordinate_may_pass_through_zero_and_is_lost_where_it_never_is_near() {
    let displacement_m = REGULAR.displacement_m(60.0, 1);
    let single = |offset_m: f64| Samples {
        times_s: (0..displacement_m.len())
            .map(|count| 0.1 * count as f64)
            .collect(),
        positions_m: displacement_m
            .iter()
            .map(|each| [each + offset_m, 0.0, 0.0])
            .collect(),
        is_one_coordinate: true,
        ..Samples::default()
    };
    let mut samples = single(-0.005);
    samples.positions_m[7] = [0.0; 3];
    assert_eq!(
        Recording::from_samples("made", samples).unwrap().lost.zero,
        0
    );
    let mut samples = single(0.4);
    samples.positions_m[7] = [0.0; 3];
    let recording = Recording::from_samples("made", samples).unwrap();
    assert_eq!(recording.lost.zero, 1);
    assert!(recording.axis.is_none());
}

#[test]
fn two_patients_in_a_file_are_refused_where_the_second_begins() {
    let mut samples = made();
    for position in &mut samples.positions_m[600..] {
        position[0] += 0.08;
    }
    let finding = refused(samples);
    assert_eq!(finding.line, Some(602));
    assert!(finding.message.contains("jumps by"), "{finding}");
    let mut samples = made();
    for (time_s, position) in samples
        .times_s
        .iter_mut()
        .zip(&mut samples.positions_m)
        .skip(600)
    {
        *time_s += 30.0;
        position[2] -= 0.2;
    }
    let finding = refused(samples);
    assert_eq!(finding.line, Some(602));
    assert!(finding.message.contains("after a gap"), "{finding}");
}

#[test]
fn constant_traces_single_breaths_and_too_much_movement_are_refused() {
    let constant = refused(along(&[1e-5; 1200], 0.1));
    assert!(constant.message.contains("constant"), "{constant}");
    let far = Law {
        amplitude_m: 0.2,
        period_s: 12.0,
        ..REGULAR
    };
    let far = refused(along(&far.displacement_m(120.0, 5), 0.1));
    assert!(far.message.contains("above the 150 mm"), "{far}");
    let one = REGULAR.displacement_m(16.0, 1);
    let one = Recording::from_samples("made", along(&one[..130], 0.1)).unwrap();
    let one = statistics(&one).unwrap_err();
    assert!(one.message.starts_with("one breath from"), "{one}");
    let mut bursts = along(&REGULAR.displacement_m(60.0, 1), 0.01);
    for (count, time_s) in (0_u32..).zip(&mut bursts.times_s) {
        *time_s += 0.6 * f64::from(count / 3);
    }
    let bursts = refused(bursts);
    assert!(bursts.message.contains("without a gap"), "{bursts}");
    let few = refused(along(&[0.0], 0.1));
    assert!(few.message.contains("1 of 1 rows"), "{few}");
}

#[test]
fn the_clock_is_in_milliseconds_where_its_steps_are_above_one() {
    let mut samples = made();
    for time_s in &mut samples.times_s {
        *time_s *= 1e3;
    }
    let recording = Recording::from_samples("made", samples).unwrap();
    assert_eq!(
        (
            recording.time_unit,
            recording.segments[0].displacement_m.len()
        ),
        ("ms", 1201)
    );
    let mut samples = made();
    for time_s in &mut samples.times_s {
        *time_s *= 1e9;
    }
    let finding = refused(samples);
    assert!(
        finding.message.contains("median step of the clock"),
        "{finding}"
    );
}

#[test]
fn expiration_is_where_the_trace_dwells_whichever_way_the_axis_points() {
    for sign in [1.0, -1.0] {
        let turned: Vec<f64> = QUIET
            .displacement_m(120.0, 5)
            .iter()
            .map(|each| sign * each)
            .collect();
        let recording = Recording::from_samples("made", along(&turned, 0.1)).unwrap();
        let axis = recording.axis.unwrap();
        assert!(axis.share > 0.999);
        let towards = axis.direction[0] * 0.36 - axis.direction[1] * 0.48 + axis.direction[2] * 0.8;
        assert!((towards - sign).abs() < 1e-3, "{towards}");
        assert!(recording.findings.is_empty(), "{:?}", recording.findings);
    }
    let sine: Vec<f64> = (0..1200_u32)
        .map(|count| 0.005 * libm::sin(0.12 * f64::from(count)))
        .collect();
    let recording = Recording::from_samples("made", along(&sine, 0.1)).unwrap();
    assert!(
        recording.findings[0].message.contains("doubtful"),
        "{:?}",
        recording.findings
    );
}

#[test]
fn a_marker_that_moves_along_no_line_is_a_finding() {
    let mut samples = made();
    let length = samples.times_s.len() as f64;
    for (count, position) in samples.positions_m.iter_mut().enumerate() {
        position[0] += 0.008 * libm::sin(9.0 * count as f64 / length);
    }
    let recording = Recording::from_samples("made", samples).unwrap();
    let share = recording.axis.unwrap().share;
    assert!(share < 0.8, "{share}");
    assert!(
        recording
            .findings
            .iter()
            .any(|each| each.message.contains("along no line"))
    );
}

#[test]
fn a_fast_tracker_gives_the_same_breaths() {
    let slow = QUIET.displacement_m(120.0, 5);
    // At 50 Hz on lines between, with 0.1 mm of noise.
    let mut random = needlebench_numerics::random::SplitMix64::new(1);
    let fast: Vec<f64> = slow
        .windows(2)
        .flat_map(|pair| {
            (0..5_u32)
                .map(|part| pair[0] + 0.2 * f64::from(part) * (pair[1] - pair[0]))
                .collect::<Vec<_>>()
        })
        .map(|each| each + 1e-4 * random.standard_normal())
        .collect();
    let [slow, fast] = [(slow, 0.1), (fast, 0.02)].map(|(trace, step_s)| {
        statistics(&Recording::from_samples("made", along(&trace, step_s)).unwrap()).unwrap()
    });
    assert_eq!(slow.breaths, fast.breaths);
    assert!((slow.amplitude_m.value - fast.amplitude_m.value).abs() < 1e-4);
    assert!((slow.period_s.value - fast.period_s.value).abs() < 0.05);
}
