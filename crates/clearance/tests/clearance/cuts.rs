//! What may be behind the cuts of the patient's scan, against closed forms.

use crate::common::{Variety, cell};
use nalgebra::{Point3, Vector3};
use needlebench_cell::{Cell, ClearanceClass};
use needlebench_clearance::{
    CUT_MARGIN_M, CertificateOptions, ClearanceModel, Motion, Span, certify, is_known,
};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::trajectory::Phase;
use needlebench_kinematics::{Joints, Pose};

/// The patient's axis is along y; the scan ends there, m.
const END_M: f64 = 0.05;
/// The guide tube of the cell: a capsule in the frame of wrist 3.
const GUIDE: ([f64; 3], f64, f64) = ([0.1, 0.0, 0.05], 0.03, 0.006);
/// The solver's certificate of 1e-10 m and rounding.
const REPRODUCED_M: f64 = 1e-9;

/// The cell with all space behind a plane as what may be there: a block so large that only its face counts.
fn cut_cell() -> Cell {
    let half_m = 5.0;
    cell().with_behind_cuts(vec![Solid {
        name: "unseen_1".to_owned(),
        shape: Shape::Cuboid {
            half_extents_m: Vector3::repeat(half_m),
        },
        parent_from_shape: Pose::translation(0.0, END_M + half_m, 0.0),
    }])
}

/// Gap between the guide tube and the plane: from its two ends and its radius.
fn guide_gap_m(cell: &Cell, q: &Joints) -> f64 {
    let (centre, half_length_m, radius_m) = GUIDE;
    let flange = cell.robot.world_from_flange(q);
    let ends = [-half_length_m, half_length_m].map(|along_m| {
        let end = Point3::from(centre) + Vector3::new(0.0, 0.0, along_m);
        (flange * end).y
    });
    END_M - ends[0].max(ends[1]) - radius_m
}

struct Line(Joints, Joints);

impl Motion for Line {
    fn position(&self, time_s: f64) -> Joints {
        self.0 + (self.1 - self.0) * time_s
    }

    fn chord_deviation(&self, _: f64, _: f64) -> Joints {
        Joints::zeros()
    }

    fn spans(&self) -> Vec<Span> {
        vec![Span {
            phase: Phase::Transfer,
            start_s: 0.0,
            end_s: 1.0,
        }]
    }
}

#[test]
fn a_posture_is_as_far_from_behind_a_plane_as_its_guide() {
    let (whole, cut) = (cell(), cut_cell());
    let [plain, model] = [&whole, &cut].map(ClearanceModel::new);
    let like = plain.for_cell(&cut);
    let class = ClearanceClass::GuideStandoff;
    let mut variety = Variety::new(5);
    let (mut before, mut behind) = (0, 0);
    for _ in 0..200 {
        let q = variety.joints();
        let minima = model.minimum_per_class(&q);
        assert_eq!(minima, like.minimum_per_class(&q));
        let found_m = minima.behind_cuts_m(class).unwrap();
        let wanted_m = guide_gap_m(&cut, &q);
        assert!(
            (found_m - wanted_m).abs() < REPRODUCED_M,
            "{found_m} {wanted_m}"
        );
        before += usize::from(wanted_m > 0.0);
        behind += usize::from(wanted_m < 0.0);
        // The clearances themselves are those without a cut, bit for bit.
        let seen = plain.minimum_per_class(&q);
        assert!(seen.iter().eq(minima.iter()));
        assert!(
            seen.iter()
                .all(|pair| seen.behind_cuts_m(pair.class).is_none())
        );
        assert!(minima.behind_cuts_m(ClearanceClass::RobotTable).is_none());
    }
    assert!(before > 20 && behind > 20, "{before} {behind}");
}

#[test]
fn a_motion_is_known_exactly_where_all_of_it_keeps_farther_from_behind_a_plane() {
    let cut = cut_cell();
    let [plain, model] = [&cell(), &cut].map(ClearanceModel::new);
    let options = CertificateOptions::default();
    let class = ClearanceClass::GuideStandoff;
    let mut variety = Variety::new(11);
    let (mut known, mut open, mut open_between) = (0, 0, 0);
    for _ in 0..200 {
        let line = Line(variety.joints(), variety.joints());
        let certificate = certify(&model, &line, &options);
        let found = certificate.get(class).unwrap();
        assert_eq!(
            found.lower_bound_m.to_bits(),
            certify(&plain, &line, &options)
                .get(class)
                .unwrap()
                .lower_bound_m
                .to_bits()
        );
        let least_m = (0..=2000)
            .map(|step| guide_gap_m(&cut, &line.position(f64::from(step) / 2000.0)))
            .fold(f64::INFINITY, f64::min);
        let clearance_m = found.attained.separation.distance_m;
        let behind_cuts_m = found.behind_cuts_m.unwrap();
        // A lower bound, and no lower than what it is known to where that matters.
        assert!(behind_cuts_m <= least_m + REPRODUCED_M);
        let needed_m = clearance_m.max(0.0) + CUT_MARGIN_M;
        assert!(
            behind_cuts_m >= least_m.min(needed_m) - 3e-4,
            "{behind_cuts_m} {least_m}"
        );
        let ends_m = [line.0, line.1].map(|q| guide_gap_m(&cut, &q));
        if is_known(clearance_m, Some(behind_cuts_m)) {
            known += 1;
            assert!(least_m >= needed_m - REPRODUCED_M);
        } else {
            open += 1;
            assert!(least_m < needed_m + 3e-4);
            open_between += usize::from(ends_m[0].min(ends_m[1]) > needed_m);
        }
        let both = certificate.clone().and(&certificate);
        assert_eq!(both.get(class).unwrap().behind_cuts_m, found.behind_cuts_m);
    }
    assert!(
        known > 3 && open > 10 && open_between > 0,
        "{known} {open} {open_between}"
    );
}
