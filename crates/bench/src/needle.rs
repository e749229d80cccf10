//! How a goal's needle bends in tissue, and what can be done about it.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector2, Vector3};
use needlebench_evaluation::report::{
    BendSummary, BevelDirection, NeedleAlternative, NeedleInBreath, NeedleLayer, NeedleReport,
    TurnedNeedle,
};
use needlebench_insertion::{Gauge, Guide, Point, Tissue, WARNED_SLOPE};
use needlebench_numerics::order::quantile_position;
use needlebench_planning::bent_route;
use needlebench_scenario::imperfections::{Breathing, TissueNeedle, bend_at_m, bends_along_m};
use needlebench_scenario::{Goal, NeedlePath, PlacedPhantom, ResolvedScenario};
use needlebench_uncertainty::drawn_bends_m;

/// Longer guides and smaller stand-offs that are tried, m.
const GUIDES_M: [f64; 2] = [30e-3, 80e-3];
const STAND_OFFS_M: [f64; 4] = [5e-3, 10e-3, 20e-3, 40e-3];

/// The needle of a goal; none for one that bends in air, or not at all.
pub(crate) fn needle_report(resolved: &ResolvedScenario, goal: &Goal) -> Option<NeedleReport> {
    let expected = resolved.expected.as_ref()?;
    let needle = expected.imperfections.tissue()?;
    let (path, placed) = (goal.needle_path.as_deref()?, resolved.phantom.as_ref()?);
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let inserted = needle.insert_median(path, stand_off_m).ok()?;
    let has_direction = needle.tip == Point::Bevel;
    let towards = needle.pushed_towards(path);
    let path_m = bends_along_m(&inserted);
    let sizes_m = sizes_m(needle, goal);
    let tool = &resolved.cell.tool;
    let with_forces = needle.layers(&needle.medians(), path).ok()?;
    let layers = path.layers.iter().zip(with_forces.all());
    let layers = layers.map(|(passed, layer)| NeedleLayer {
        tissue: passed.tissue.name(),
        length_m: layer.length_m,
        stiffness_n_m2: layer.stiffness_n_m2,
        force_n: layer.force_n,
    });
    let to_patient =
        placed.world_from_phantom.rotation.inverse() * goal.world_from_guide_exit.rotation;
    let mut assumed = vec![
        "stiffnesses of tissues",
        "shares of the force in fat, lung and lesion",
    ];
    if !needle.is_force_measured {
        assumed.insert(0, "force across the tip (from a 22 G in ballistic gel)");
    }
    let pushed_towards = towards.map(|[x, y]| to_patient * Vector3::new(x, y, 0.0));
    let mut report = NeedleReport {
        summary: String::new(),
        gauge: tool.needle.gauge,
        outer_diameter_m: needle.needle.outer_m,
        bending_stiffness_nm2: needle.needle.bending_stiffness_nm2(),
        tip: match needle.tip {
            Point::Bevel => "bevel",
            Point::Symmetric => "symmetric",
            Point::Rolled => "rolled",
        },
        layers: layers.collect(),
        pushed_towards: pushed_towards.map(Into::into),
        bend: summary(&sizes_m),
        bend_at_pleura_m: pleura_m(path).map(|depth_m| bend_at_m(&inserted, depth_m)),
        largest_slope: inserted.largest_slope(),
        path_in_world_m: towards.map_or_else(Vec::new, |towards| {
            let points = goal.bent_line(&path_m, towards).into_iter();
            points.map(|point| point.coords.into()).collect()
        }),
        turn_at_m: path.turn_at_m,
        turned: if has_direction && path.turn_at_m.is_none() {
            turned(needle, goal, path)
        } else {
            None
        },
        aim_m: needle.is_aimed.then(|| goal.aim_m.norm()),
        aimed_rms_m: match towards {
            Some(_) => Some(aimed_rms_m(needle, goal, path, &sizes_m)?),
            None => None,
        },
        by_hub_m: needle.bend_by_hub_m(path, tool.needle.length_m).ok(),
        alternatives: alternatives(resolved, needle, goal),
        breath: expected
            .imperfections
            .breathing
            .and_then(|breathing| in_breath(needle, &breathing, goal, path, &to_patient)),
        faces: if has_direction {
            faces(resolved, placed, goal, path, &path_m)
        } else {
            Vec::new()
        },
        path_m,
        assumed,
    };
    report.summary = summary_of(&report, needle, pushed_towards);
    Some(report)
}

/// The answer: how far it bends, to which side, and what helps.
fn summary_of(
    report: &NeedleReport,
    needle: &TissueNeedle,
    towards: Option<Vector3<f64>>,
) -> String {
    let mm = |metres: f64| format!("{:.1}", metres * 1e3);
    let stylet = if needle.needle.has_stylet {
        "stylet in"
    } else {
        "stylet out"
    };
    let BendSummary {
        median_m,
        p05_m,
        p95_m,
        rms_m,
    } = report.bend;
    let side = match towards {
        Some(towards) if median_m >= 0.0 => format!("towards the patient's {}", side_of(&towards)),
        Some(towards) => format!("towards the patient's {}", side_of(&-towards)),
        None => "to a side that is not known".to_owned(),
    };
    let (least_m, most_m) = if median_m >= 0.0 {
        (p05_m, p95_m)
    } else {
        (-p95_m, -p05_m)
    };
    let assumed = if needle.is_force_measured {
        ""
    } else {
        "; forces assumed"
    };
    let turn = report.turn_at_m.map_or_else(String::new, |at_m| {
        format!(", turned by 180 deg at {:.0} mm", at_m * 1e3)
    });
    let bends = format!(
        "needle {} G, {}, {stylet}{turn}: bends {} mm {side} (90 % of needles {} to {}{assumed})",
        report.gauge,
        report.tip,
        mm(median_m.abs()),
        mm(least_m),
        mm(most_m)
    );
    let before_lung = report
        .bend_at_pleura_m
        .map(|before_m| format!(", {} mm of it before the lung", mm(before_m.abs())));
    let turned = report.turned.map(|turned| {
        format!(
            "; turned by 180 deg at {:.0} mm: RMS {} instead of {} mm",
            turned.at_m * 1e3,
            mm(turned.rms_m),
            mm(rms_m)
        )
    });
    let aimed = report.aimed_rms_m.map(|aimed_m| match report.aim_m {
        Some(aim_m) => format!(
            "; aimed {} mm against it: RMS {} mm",
            mm(aim_m),
            mm(aimed_m)
        ),
        None => format!("; aimed against it: RMS {} mm", mm(aimed_m)),
    });
    let is_far = report.largest_slope > WARNED_SLOPE;
    let rough = is_far.then(|| "; it bends more than its model is for: a rough figure".to_owned());
    let parts = [Some(bends), before_lung, turned, aimed, rough];
    parts.into_iter().flatten().collect()
}

/// Sides of a patient along the axes of the phantom frame, forwards and backwards.
const SIDES: [[&str; 2]; 3] = [["left", "right"], ["back", "front"], ["head", "feet"]];

/// Least part of a direction, as a share of the whole, that a second side is named for.
const NAMED: f64 = 0.4;

fn side_of(towards: &Vector3<f64>) -> String {
    let mut parts: Vec<(f64, &str)> = SIDES
        .iter()
        .zip(towards.iter())
        .map(|([ahead, behind], along)| (along.abs(), if *along > 0.0 { *ahead } else { *behind }))
        .collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    match parts.as_slice() {
        [(_, first), (second, name), ..] if *second > NAMED => format!("{first} and {name}"),
        [(_, first), ..] => (*first).to_owned(),
        [] => String::new(),
    }
}

fn sizes_m(needle: &TissueNeedle, goal: &Goal) -> Vec<f64> {
    let drawn_m = drawn_bends_m(needle, goal).into_iter();
    drawn_m.map(|[_, at_tip_m]| at_tip_m).collect()
}

fn rms_m(sizes_m: &[f64]) -> f64 {
    (sizes_m.iter().map(|size| size * size).sum::<f64>() / sizes_m.len() as f64).sqrt()
}

fn summary(sizes_m: &[f64]) -> BendSummary {
    let mut sorted = sizes_m.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let (index, between) = quantile_position(sorted.len() as u64, share);
        let index = usize::try_from(index).unwrap_or(0);
        let next = (index + 1).min(sorted.len() - 1);
        sorted[index] * (1.0 - between) + sorted[next] * between
    };
    let [p05_m, median_m, p95_m] = [0.05, 0.5, 0.95].map(quantile);
    BendSummary {
        median_m,
        p05_m,
        p95_m,
        rms_m: rms_m(sizes_m),
    }
}

/// What is left of the bends, m, once the axis is aimed as `aim` has it: by what is, or would be, done.
fn aimed_rms_m(
    needle: &TissueNeedle,
    goal: &Goal,
    path: &NeedlePath,
    sizes_m: &[f64],
) -> Option<f64> {
    // Towards where the tip is pushed: a turned needle may end on the other side.
    let aim_m = if needle.is_aimed {
        let [x, y] = needle.pushed_towards(path)?;
        let towards = goal.world_from_guide_exit.rotation * Vector3::new(x, y, 0.0);
        -goal.aim_m.dot(&towards)
    } else {
        needle
            .mean_bend_m(path, goal.standoff_m.unwrap_or(0.0))
            .ok()?
    };
    let mean_m = sizes_m.iter().sum::<f64>() / sizes_m.len() as f64;
    // The mean of a direction that is normal about the known one is shorter than 1.
    let shrunk = libm::exp(-0.5 * needle.bevel_spread_rad * needle.bevel_spread_rad);
    let square_m2 = rms_m(sizes_m) * rms_m(sizes_m);
    let left_m2 = square_m2 - 2.0 * aim_m * mean_m * shrunk + aim_m * aim_m;
    Some(left_m2.max(0.0).sqrt())
}

/// Depth at which a needle first enters a lung, m.
fn pleura_m(path: &NeedlePath) -> Option<f64> {
    let lung = path
        .layers
        .iter()
        .position(|layer| layer.tissue == Tissue::Lung)?;
    Some(path.layers[..lung].iter().map(|layer| layer.length_m).sum())
}

/// What a full breath does to a needle that is in.
fn in_breath(
    needle: &TissueNeedle,
    breathing: &Breathing,
    goal: &Goal,
    path: &NeedlePath,
    patient_from_guide: &UnitQuaternion<f64>,
) -> Option<NeedleInBreath> {
    let lateral_m =
        |amplitude: Vector3<f64>| (patient_from_guide.inverse() * amplitude).xy().norm();
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let off = |from_m: f64, by_m: f64| {
        let carried = needle.carried(path, stand_off_m, from_m, by_m).ok()?;
        Some(((carried.tip_m - by_m).abs(), carried.guide_n.abs()))
    };
    let (lung_slides_m, off_by_lung_m) = match pleura_m(path) {
        Some(pleura_m) => {
            let by_m = lateral_m(breathing.target_m - breathing.skin_m);
            (by_m, off(pleura_m, by_m)?.0)
        }
        None => (0.0, 0.0),
    };
    let chest_moves_m = lateral_m(breathing.skin_m);
    let (off_by_chest_m, guide_n) = off(0.0, chest_moves_m)?;
    Some(NeedleInBreath {
        lung_slides_m,
        off_by_lung_m,
        chest_moves_m,
        off_by_chest_m,
        guide_n,
    })
}

/// The turn that leaves the least.
fn turned(needle: &TissueNeedle, goal: &Goal, path: &NeedlePath) -> Option<TurnedNeedle> {
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let at_m = needle.best_turn_m(path, stand_off_m).ok()?;
    let turned = Goal {
        needle_path: Some(Arc::new(path.turned_at(Some(at_m)))),
        ..goal.clone()
    };
    Some(TurnedNeedle {
        at_m,
        rms_m: rms_m(&sizes_m(needle, &turned)),
    })
}

/// Other needles in the same guide, other tips, stand-offs and guides.
fn alternatives(
    resolved: &ResolvedScenario,
    needle: &TissueNeedle,
    goal: &Goal,
) -> Vec<NeedleAlternative> {
    let tool = &resolved.cell.tool;
    let has_play = needle.guide.play_m > 0.0;
    let play_m = |outer_m: f64| {
        if has_play {
            0.5 * (tool.bore_m - outer_m)
        } else {
            0.0
        }
    };
    let mut all = Vec::new();
    let mut add = |what: String, needle: &TissueNeedle, goal: &Goal| {
        let bend = summary(&sizes_m(needle, goal));
        all.push(NeedleAlternative { what, bend });
    };
    let gauges = Gauge::ALL.into_iter().filter(|gauge| {
        let [outer_m, _] = gauge.diameters_m();
        u32::from(gauge.number()) != tool.needle.gauge && outer_m < tool.bore_m
    });
    for gauge in gauges {
        let [outer_m, inner_m] = gauge.diameters_m();
        let mut other = needle.clone();
        other.needle.outer_m = outer_m;
        other.needle.inner_m = if needle.needle.has_stylet {
            0.0
        } else {
            inner_m
        };
        other.guide.play_m = play_m(outer_m).min(1e-3);
        add(format!("{} G in this guide", gauge.number()), &other, goal);
        if has_play {
            other.guide.play_m = needle.guide.play_m;
            add(
                format!("{} G in a guide that fits as well", gauge.number()),
                &other,
                goal,
            );
        }
    }
    for (tip, what) in [
        (Point::Bevel, "bevelled tip"),
        (Point::Symmetric, "symmetric tip"),
        (Point::Rolled, "bevel rolled on the way"),
    ] {
        if tip != needle.tip {
            let other = TissueNeedle {
                tip,
                ..needle.clone()
            };
            let straight_on = goal.needle_path.as_deref().map(|path| path.turned_at(None));
            let goal = Goal {
                needle_path: straight_on.map(Arc::new),
                ..goal.clone()
            };
            add(what.to_owned(), &other, &goal);
        }
    }
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    for other_m in STAND_OFFS_M
        .into_iter()
        .filter(|each| (each - stand_off_m).abs() > 1e-6)
    {
        let nearer = Goal {
            standoff_m: Some(other_m),
            ..goal.clone()
        };
        add(
            format!("stand-off {:.0} mm", other_m * 1e3),
            needle,
            &nearer,
        );
    }
    for length_m in GUIDES_M
        .into_iter()
        .filter(|each| (each - needle.guide.length_m).abs() > 1e-6)
    {
        let other = TissueNeedle {
            guide: Guide {
                length_m,
                ..needle.guide
            },
            ..needle.clone()
        };
        add(format!("guide {:.0} mm long", length_m * 1e3), &other, goal);
    }
    all
}

/// What a needle that is bent as the medians have it keeps away from, for twelve directions of its bevel's face.
fn faces(
    resolved: &ResolvedScenario,
    placed: &PlacedPhantom,
    goal: &Goal,
    path: &NeedlePath,
    path_m: &[[f64; 2]],
) -> Vec<BevelDirection> {
    let [twelve, three] = path.clock.map(Vector2::from);
    let mut found: Vec<BevelDirection> = (1..=12_u32)
        .filter_map(|hour| {
            let (sine, cosine) = libm::sincos(f64::from(hour) * std::f64::consts::TAU / 12.0);
            let towards = -(twelve * cosine + three * sine);
            let points = goal.bent_line(path_m, towards.into());
            let nearest = bent_route(&resolved.cell, placed, goal, &points)?;
            Some(BevelDirection {
                clock: format!("{hour}:00"),
                part: nearest.part.name.clone(),
                distance_m: nearest.separation.distance_m,
            })
        })
        .collect();
    found.sort_by(|a, b| b.distance_m.total_cmp(&a.distance_m));
    found
}
