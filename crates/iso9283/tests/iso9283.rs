//! ISO 9283: statistics against NumPy's, logs of trackers in and out, and what is wrong with them.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_input::Finding;
use needlebench_iso9283::{
    Attained, Commanded, LogUnits, MeasuredReport, RotationColumns, StatisticsError, drift,
    evaluate, measured_report, read_commanded, read_log, write_commanded, write_log,
};
use needlebench_kinematics::Pose;
use needlebench_numerics::random::SplitMix64;
use serde_json::Value;

const LOG: &str = include_str!("data/log.csv");
const COMMANDED: &str = include_str!("data/commanded.csv");
const REFERENCE: &str = include_str!("data/reference.json");

/// Difference from NumPy, mm: rounding of coordinates of 300 mm.
const POSITION_MM: f64 = 1e-11;
/// Difference from NumPy, rad: rounding of products of rotations, over the small angles' sines.
const ANGLE_RAD: f64 = 1e-13;

const UNITS: LogUnits = LogUnits {
    length: None,
    angle: None,
    rotation: Some(RotationColumns::RotationVector),
};

fn commanded() -> Vec<Commanded> {
    read_commanded("commanded.csv", COMMANDED, UNITS).unwrap()
}

fn close(found: f64, expected: &Value, tolerance: f64) {
    let expected = expected.as_f64().unwrap();
    assert!((found - expected).abs() < tolerance, "{found} {expected}");
}

#[test]
fn statistics_are_those_of_numpy() {
    let commanded = commanded();
    let log = read_log("log.csv", LOG, &commanded, UNITS).unwrap();
    assert_eq!(log.notes, ["log.csv: columns not used: RMS_mm"]);
    let found = evaluate(&commanded, &log.attained).unwrap();
    let reference: Value = serde_json::from_str(REFERENCE).unwrap();
    assert_eq!((found.poses.len(), found.directional.len()), (5, 3));
    for each in &found.poses {
        let expected = &reference["poses"][each.pose.to_string()];
        assert_eq!(each.count, 30);
        close(each.ap_m * 1e3, &expected["ap_mm"], POSITION_MM);
        close(each.rp_m * 1e3, &expected["rp_mm"], POSITION_MM);
        let angles = each.angles.unwrap();
        for axis in 0..3 {
            close(angles.ap_rad[axis], &expected["ap_rad"][axis], ANGLE_RAD);
            close(angles.rp_rad[axis], &expected["rp_rad"][axis], ANGLE_RAD);
        }
    }
    for each in &found.directional {
        let expected = &reference["directional"][each.pose.to_string()];
        assert_eq!(each.count, [30; 3]);
        close(each.vap_m * 1e3, &expected["vap_mm"], POSITION_MM);
        for axis in 0..3 {
            close(
                each.vap_rad.unwrap()[axis],
                &expected["vap_rad"][axis],
                ANGLE_RAD,
            );
        }
    }
}

/// Five positions at 1 mm on the axes about (0, 0, 3): distances 1, 1, 1, 1, 0 from their mean, so
/// `l' = 0.8`, `S = sqrt(0.2)`.
#[test]
fn a_small_example_by_hand() {
    let command = Commanded {
        pose: 1,
        position_m: Point3::origin(),
        orientation: None,
    };
    let offsets = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]];
    let attained: Vec<Attained> = (1..)
        .zip(offsets)
        .map(|(cycle, [x, y])| measured(1, cycle, Point3::new(x, y, 3.0)))
        .collect();
    let found = &evaluate(&[command], &attained).unwrap().poses[0];
    assert!((found.ap_m - 3.0).abs() < 1e-15);
    assert!((found.rp_m - (0.8 + 3.0 * 0.2_f64.sqrt())).abs() < 1e-15);
    assert!(!found.identical && found.angles.is_none());
}

#[test]
fn equal_measurements_have_no_spread_at_all() {
    let commanded = commanded();
    let at_m = Point3::new(0.1 + 0.2, 1.0 / 3.0, -0.7);
    let attained: Vec<Attained> = (1..=30).map(|cycle| measured(3, cycle, at_m)).collect();
    let found = evaluate(&commanded, &attained).unwrap();
    assert!(found.nothing_random);
    assert_eq!(
        (found.rp_m, found.poses[0].mean_m),
        (0.0, at_m.coords.into())
    );
    let drift = drift(&commanded[2], &attained).unwrap();
    assert_eq!(
        (drift.blocks.len(), drift.dap_m, drift.drp_m),
        (3, 0.0, 0.0)
    );
}

#[test]
fn drift_is_the_change_from_the_first_ten_cycles() {
    let commanded = commanded();
    let start = commanded[0].position_m;
    let attained: Vec<Attained> = (1..=25)
        .map(|cycle| {
            let moved = if cycle > 10 { 2e-4 } else { 0.0 };
            measured(1, cycle, start + Vector3::new(0.0, moved, 0.0))
        })
        .collect();
    let found = drift(&commanded[0], &attained).unwrap();
    assert_eq!(found.blocks.len(), 2);
    assert!((found.dap_m - 2e-4).abs() < 1e-15 && found.drp_m < 1e-15);
    assert!(drift(&commanded[0], &attained[..19]).is_none());
}

#[test]
fn what_is_written_reads_back_to_the_same_bits() {
    let mut random = SplitMix64::new(77);
    let mut number = || random.uniform(-0.7, 0.7);
    let commanded: Vec<Commanded> = (1..=5)
        .map(|pose| Commanded {
            pose,
            position_m: Point3::new(number(), number(), number()),
            orientation: Some(UnitQuaternion::from_euler_angles(
                number(),
                number(),
                number(),
            )),
        })
        .collect();
    let attained: Vec<Attained> = (1..=60)
        .map(|k| Attained {
            pose: 1 + k % 5,
            cycle: 1 + k / 5,
            axis: [None, Some(0), Some(1), Some(2)][k as usize % 4],
            time_s: Some(number()),
            position_m: Point3::new(number(), number() * 1e-9, number()),
            orientation: Some(UnitQuaternion::from_euler_angles(
                number(),
                number(),
                number(),
            )),
        })
        .collect();
    let text = write_commanded("commanded\npositions", &commanded);
    let read = read_commanded("a.csv", &text, LogUnits::default()).unwrap();
    assert_eq!(read, commanded);
    let text = write_log("attained", &attained);
    let read = read_log("b.csv", &text, &commanded, LogUnits::default()).unwrap();
    assert_eq!(read.attained, attained);
    assert_eq!(write_log("attained", &read.attained), text);
}

#[test]
fn a_tracker_s_own_frame_is_fitted() {
    let commanded = commanded();
    let mut log = read_log("log.csv", LOG, &commanded, UNITS).unwrap();
    let in_base = report(&commanded, log.clone(), false);
    let tracker_from_base = Pose::new(Vector3::new(2.0, -1.5, 0.4), Vector3::new(0.3, -0.2, 2.0));
    for each in &mut log.attained {
        each.position_m = tracker_from_base * each.position_m;
        each.orientation = each.orientation.map(|q| tracker_from_base.rotation * q);
    }
    let foreign = report(&commanded, log.clone(), false);
    assert!(
        foreign
            .notes
            .iter()
            .any(|note| note.contains("--fit-frame"))
    );
    let fitted = report(&commanded, log, true);
    let fit = fitted.frame_fit.unwrap();
    assert_eq!(fit.poses, 5);
    // RP does not depend on the frame; AP is what no frame takes away.
    for (a, b) in fitted
        .statistics
        .poses
        .iter()
        .zip(&in_base.statistics.poses)
    {
        assert!((a.rp_m - b.rp_m).abs() < 1e-14);
    }
    assert!(fitted.statistics.ap_m < in_base.statistics.ap_m);
    assert!(fit.residual_rms_m > 1e-5);
}

fn report(
    commanded: &[Commanded],
    log: needlebench_iso9283::TrackerLog,
    fit_frame: bool,
) -> MeasuredReport {
    measured_report("log", "commanded", commanded, log, fit_frame)
        .unwrap()
        .0
}

fn measured(pose: u32, cycle: u32, position_m: Point3<f64>) -> Attained {
    Attained {
        pose,
        cycle,
        axis: None,
        time_s: None,
        position_m,
        orientation: None,
    }
}

/// The shape of a SpatialAnalyzer export: names of points with the cycle in them.
#[test]
fn names_of_points_carry_the_cycle() {
    let text = "// frame: robot base\nTarget\tX (m)\tY (m)\tZ (m)\tTimestamp\n\
                P2_01\t0.1\t0.2\t0.3\t2026-01-31T12:00:00\nP2_02\t0,1\t0.2\t0.3\t2026-01-31T12:00:09.5\n";
    let log = read_log("sa.txt", text, &commanded(), LogUnits::default()).unwrap();
    let cycles: Vec<u32> = log.attained.iter().map(|each| each.cycle).collect();
    assert_eq!(cycles, [1, 2]);
    let times: Vec<f64> = log
        .attained
        .iter()
        .map(|each| each.time_s.unwrap())
        .collect();
    assert!((times[1] - times[0] - 9.5).abs() < 1e-9);
    assert_eq!(log.attained[0].position_m, log.attained[1].position_m);
}

#[test]
fn cycles_are_counted_where_nothing_says_them() {
    let text = "pose,x_mm,y_mm,z_mm\n1,1,2,3\n2,1,2,3\n1,1,2,3.5\n";
    let log = read_log("log.csv", text, &commanded(), LogUnits::default()).unwrap();
    let found: Vec<(u32, u32)> = log
        .attained
        .iter()
        .map(|each| (each.pose, each.cycle))
        .collect();
    assert_eq!(found, [(1, 1), (2, 1), (1, 2)]);
}

#[test]
fn inches_and_headers_without_units_are_understood_when_told() {
    let units = LogUnits {
        length: Some("mm"),
        ..LogUnits::default()
    };
    let text = "pose,x,y [in],z_m\n1,25.4,1,0.0254\n";
    let log = read_log("log.csv", text, &commanded(), units).unwrap();
    assert_eq!(
        log.attained[0].position_m,
        Point3::new(0.0254, 0.0254, 0.0254)
    );
}

/// The finding, with line and marked text.
fn refused(text: &str) -> (Finding, String) {
    let mut findings = read_log("log.csv", text, &commanded(), LogUnits::default()).unwrap_err();
    let finding = findings.remove(0);
    let marked = finding.span.clone().map_or("", |span| &text[span]);
    let marked = marked.to_owned();
    (finding, marked)
}

#[test]
fn what_is_wrong_is_named_with_line_and_place() {
    const HEADER: &str = "cycle,pose,x_mm,y_mm,z_mm\n1,P1,1,2,3\n";
    for (text, line, marked, message, hint) in [
        (
            format!("{HEADER}2,P1,1,nan,3\n"),
            3,
            "nan",
            "not a finite number",
            "lost the target",
        ),
        (
            format!("{HEADER}2,P1,1,,3\n"),
            3,
            "",
            "the value is missing",
            "omit",
        ),
        (
            format!("{HEADER}2,P1,1,2..5,3\n"),
            3,
            "2..5",
            "`2..5` is not a number",
            "omit",
        ),
        (
            format!("{HEADER}2,P7,1,2,3\n"),
            3,
            "P7",
            "not a commanded pose",
            "P1, P2, P3, P4, P5",
        ),
        (
            format!("{HEADER}2,home,1,2,3\n"),
            3,
            "home",
            "is not a pose",
            "P1 to P5",
        ),
        (
            format!("{HEADER}0,P1,1,2,3\n"),
            3,
            "0",
            "is not a cycle number",
            "numbered 1, 2, 3",
        ),
        (
            format!("{HEADER}1,P1,1,2,3\n"),
            3,
            "P1",
            "already measured in line 2",
            "average",
        ),
        (
            format!("{HEADER}2,P1,194200,2,3\n"),
            3,
            "194200",
            "would be 194 m",
            "unit in the header",
        ),
        (
            format!("{HEADER}2,P1,1,2"),
            3,
            "2,P1,1,2",
            "has 4 values",
            "truncated",
        ),
        (
            format!("{HEADER}2,P1,1,2,3,4\n3,P1,1,2,3\n"),
            3,
            "2,P1,1,2,3,4",
            "has 6 values",
            "semicolon",
        ),
        (
            "pose,x_mm,y_mm\nP1,1,2\n".into(),
            1,
            "pose,x_mm,y_mm",
            "no column `z_mm`",
            "names the columns",
        ),
        (
            "pose,x_mm,y_mm,zz_mm\nP1,1,2,3\n".into(),
            1,
            "pose,x_mm,y_mm,zz_mm",
            "no column `z_mm`",
            "did you mean `zz_mm`?",
        ),
        (
            "pose,x,y_mm,z_mm\nP1,1,2,3\n".into(),
            1,
            "x",
            "does not state its unit",
            "--length-unit",
        ),
        (
            "pose,x [ft],y_mm,z_mm\nP1,1,2,3\n".into(),
            1,
            "x [ft]",
            "`ft` is not a unit of length",
            "m, mm, um or in",
        ),
        (
            "pose,x_mm,X_mm,y_mm,z_mm\n".into(),
            1,
            "X_mm",
            "two columns for `x`",
            "",
        ),
        (
            "1, 2296.4, -2416.2, -442.5\n".into(),
            1,
            "1, 2296.4, -2416.2, -442.5",
            "numbers instead of column names",
            "names the columns",
        ),
        (
            "pose,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n".into(),
            1,
            "rx_deg",
            "are ambiguous",
            "--rotation",
        ),
        (
            "pose,x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,1,2,3,1,0.1,0,0\n1,1,2,3,1,1,0,0\n".into(),
            2,
            "1",
            "norm 1.005",
            "qw, qx, qy, qz",
        ),
        (
            format!("{}1,P1,w,1,2,3\n", "cycle,pose,direction,x_mm,y_mm,z_mm\n"),
            2,
            "w",
            "is not an approach direction",
            "x, y or z",
        ),
    ] {
        let (finding, at) = refused(&text);
        let said = finding.to_string();
        assert_eq!(finding.line, Some(line), "{said}");
        assert_eq!(at, marked, "{said}");
        assert!(said.contains(message), "{said}");
        assert!(finding.hint.unwrap_or_default().contains(hint), "{said}");
    }
    let (finding, _) = refused("# nothing\n");
    assert!(finding.message.contains("no header"));
    let (finding, _) = refused("pose,x_mm,y_mm,z_mm,qw,qx\n");
    assert!(
        finding
            .message
            .contains("not all columns qw, qx, qy, qz are present")
    );
}

#[test]
fn too_few_cycles_are_no_spread() {
    let commanded = commanded();
    let attained = [measured(1, 1, Point3::origin())];
    assert_eq!(
        evaluate(&commanded, &attained),
        Err(StatisticsError::TooFew {
            pose: 1,
            count: 1,
            direction: String::new()
        })
    );
    let mut attained = vec![
        measured(2, 1, Point3::origin()),
        measured(2, 2, Point3::origin()),
    ];
    attained.push(Attained {
        axis: Some(0),
        ..attained[0].clone()
    });
    let error = evaluate(&commanded, &attained).unwrap_err();
    assert_eq!(
        error.to_string(),
        "P2 was measured 1 times along x; repeatability requires at least two"
    );
    assert_eq!(
        evaluate(&commanded, &[]),
        Err(StatisticsError::NoPlainSequence)
    );
}

#[test]
fn a_pose_commanded_twice_is_refused() {
    let text = "pose,x_mm,y_mm,z_mm\nP1,1,2,3\nP2,1,2,3\nP1,1,2,3\n";
    let findings = read_commanded("commanded.csv", text, LogUnits::default()).unwrap_err();
    assert_eq!(findings[0].line, Some(4));
    assert!(findings[0].message.contains("P1 is commanded twice"));
}
