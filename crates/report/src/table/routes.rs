//! Needle paths as tables, with the keys to paste.

use std::fmt::Write;

use needlebench_cell::{part_in_words, reason_in_words};
use needlebench_patient::Refused;
use needlebench_patient::routes::{
    ConfigurationAnswer, MarginReport, RouteAnswer, RoutePlan, SAME_ODDS, WhyNot,
};
use needlebench_show::plain_table;

/// Needle paths of the table.
const SHOWN: usize = 8;

/// What tables have of a needle that bends, for people: to a known side, they have its clearances, too.
pub(super) fn bend_terms(to_known_side: bool) -> &'static str {
    if to_known_side {
        "bend: of the tip of the median needle in tissue; behind the slash the clearance of the needle so bent"
    } else {
        "bend: of the tip of the median needle in tissue, to a side that is not known; clearances are those of the \
         straight needle"
    }
}

/// Needle paths to a target.
pub fn routes_text(plan: &RoutePlan) -> String {
    let mut text = head(plan);
    if plan.routes.is_empty() {
        text.push_str("no direction is admissible");
        return text;
    }
    match &plan.chosen {
        Some(chosen) => {
            let _ = writeln!(
                text,
                "{}",
                choice(plan, &plan.routes[chosen.route], chosen.route)
            );
        }
        None => {
            let _ = writeln!(
                text,
                "none of the {} representative paths is feasible in {} of 8 configurations; main \
                 reason: {}",
                plan.routes.len(),
                plan.wanted,
                counts(&plan.robot_refused)
            );
        }
    }
    if let Some(why) = &plan.robot_not_asked {
        let _ = writeln!(text, "robot not checked: {why}");
    }
    if let Some(why_not) = &plan.why_not {
        let _ = writeln!(text, "{}", refused_route(why_not));
    }
    if let Some(bent) = &plan.bent {
        let [azimuth, elevation] = bent.direction_deg;
        let _ = writeln!(
            text,
            "admissible for the straight needle alone: {azimuth:.0}, {elevation:.0} deg, odds {:.2}; {}",
            bent.odds_ratio, bent.reason
        );
    }
    let _ = writeln!(text, "\n{}", table(plan));
    text.push_str(
        "odds: product of published pneumothorax odds ratios relative to a path without risk \
         factors; for ranking only, not a probability\nbone, vessel, organ: lower bounds of the needle clearance",
    );
    let mut bends = plan.routes.iter().filter_map(|route| route.bend.as_ref());
    if let Some(bend) = bends.next() {
        text.push('\n');
        text.push_str(bend_terms(bend.towards_in_phantom.is_some()));
    }
    if plan.margins.iter().any(|margin| !margin.known) {
        text.push_str("\n?: no such structure labelled in this patient");
    }
    if let Some(chosen) = &plan.chosen {
        let route = &plan.routes[chosen.route];
        let _ = write!(text, "\n\n{}\n{}", terms(route), route.toml);
    }
    text
}

fn head(plan: &RoutePlan) -> String {
    let [x, y, z] = plan.target_in_phantom_m.map(|m| m * 1e3);
    let refused: Vec<String> = plan
        .refused
        .iter()
        .map(|each| format!("{} {}", each.in_words, each.count))
        .collect();
    let scan = plan
        .phantom_origin_in_ct_m
        .map_or_else(String::new, |origin| {
            let place = [0, 1, 2]
                .map(|k| format!("{:.1}", (plan.target_in_phantom_m[k] + origin[k]) * 1e3));
            format!(", in the scan [{}]", place.join(", "))
        });
    format!(
        "needle paths to {}, target [{x:.1}, {y:.1}, {z:.1}] mm{scan}\n{} of {} directions \
         admissible by {}; rejected: {}\n",
        plan.goal,
        plan.free,
        plan.tried,
        if plan.anatomy == "voxels" {
            "the scan's voxels"
        } else {
            "the phantom's solids"
        },
        refused.join(", ")
    )
}

fn best(route: &RouteAnswer) -> Option<&ConfigurationAnswer> {
    let label = route.best?;
    route.configurations.iter().find(|each| each.label == label)
}

fn choice(plan: &RoutePlan, route: &RouteAnswer, index: usize) -> String {
    let mut text = format!("path {}, {:.0} mm deep", index + 1, route.depth_m * 1e3);
    if let Some(best) = best(route) {
        let _ = write!(
            text,
            "; feasible in {} of 8 configurations, margins satisfied including their own error; \
             best posture {}",
            route.working, best.label
        );
        if let Some(clearance_m) = best.clearance_m {
            let _ = write!(text, ", clearance {:.1} mm", clearance_m * 1e3);
        }
        if let Some(error) = &best.error {
            let _ = write!(
                text,
                ", RMS lateral error {:.1} mm",
                error.target_lateral_rms_m * 1e3
            );
        }
        if let Some(spare_m) = best.spare_m {
            let _ = write!(
                text,
                ", {:.1} mm in excess of its margins including {} standard deviations",
                spare_m * 1e3,
                plan.sigmas
            );
        }
    }
    if let Some(because) = plan.chosen.as_ref().and_then(|it| it.because.as_ref()) {
        let label = plan.chosen.as_ref().and_then(|it| it.configuration);
        let _ = write!(
            text,
            "\nrecommended: {} - {because}",
            label.unwrap_or("none")
        );
    }
    text
}

fn refused_route(why_not: &WhyNot) -> String {
    let mut text = format!(
        "path {} ranks first but is infeasible: {}",
        why_not.route + 1,
        counts(&why_not.reasons)
    );
    if let Some(odds) = why_not.odds_to_chosen {
        let _ = if libm::log(odds).abs() < SAME_ODDS {
            write!(
                text,
                "; its odds equal those of the chosen path within the known uncertainty ({odds:.2} \
                 times), and its margins are larger"
            )
        } else {
            write!(
                text,
                "; its odds are {odds:.2} times those of the chosen path"
            )
        };
    }
    if let Some(freeing) = &why_not.freeing {
        let freed: Vec<String> = freeing
            .freed
            .iter()
            .map(|each| {
                let change = each.toml.replace('\n', " ");
                format!("`{change}` ({} of 8 feasible)", each.working)
            })
            .collect();
        if freed.is_empty() {
            let _ = write!(
                text,
                "; no change tried makes it feasible: {}",
                freeing.tried
            );
        } else {
            let _ = write!(text, "; made feasible by {}", freed.join(", or "));
        }
    }
    text
}

fn counts(reasons: &[Refused]) -> String {
    let reasons: Vec<String> = reasons
        .iter()
        .map(|each| format!("{} ({})", words(&each.rule), each.count))
        .collect();
    reasons.join(", ")
}

fn words(rule: &str) -> String {
    match rule {
        "margin_with_error" => "margin too small for its own error".to_owned(),
        "expected_error" => "its error is unknown".to_owned(),
        other => reason_in_words(other),
    }
}

fn table(plan: &RoutePlan) -> String {
    let mut header = vec![
        "",
        "direction\n(deg)",
        "depth\n(mm)",
        "in lung\n(mm)",
        "odds",
        "bone\n(mm)",
        "vessel\n(mm)",
        "organ\n(mm)",
    ];
    let bends = plan.routes.iter().any(|route| route.bend.is_some());
    if bends {
        header.insert(5, "bend\n(mm)");
    }
    let with_robot = plan.robot_not_asked.is_none();
    if with_robot {
        header.extend([
            "feasible\nin",
            "best\nposture",
            "clearance\n(mm)",
            "lateral\nRMS (mm)",
        ]);
    }
    let mut table = plain_table(&header);
    let chosen = plan.chosen.as_ref().map(|chosen| chosen.route);
    let shown = (0..plan.routes.len()).filter(|&index| index < SHOWN || chosen == Some(index));
    for index in shown {
        let route = &plan.routes[index];
        let [azimuth, elevation] = route.direction_deg;
        let mm = |m: f64| format!("{:.1}", m * 1e3);
        let mut row = vec![
            format!(
                "{}{}",
                index + 1,
                if chosen == Some(index) { "*" } else { "" }
            ),
            format!("{azimuth:.0}, {elevation:.0}"),
            format!("{:.0}", route.depth_m * 1e3),
            format!("{:.0}", route.depth_in_lung_m * 1e3),
            format!("{:.2}", route.risk.odds_ratio),
        ];
        if let Some(bend) = &route.bend {
            row.push(mm(bend.tip_m.abs()));
        }
        // Fields end at 20 mm: what is told there is no distance.
        let told = |margin: &MarginReport| {
            let near = margin.distance_m.filter(|_| margin.part.is_some());
            near.map_or_else(|| "far".to_owned(), mm)
        };
        for (index, (margin, base)) in route.margins.iter().zip(&plan.margins).enumerate() {
            let known = route.bend.as_ref();
            let known = known.filter(|bend| bend.towards_in_phantom.is_some());
            let bent = known.map(|bend| told(&bend.margins[index]));
            row.push(match bent {
                _ if !base.known => "?".to_owned(),
                Some(bent) => format!("{}/{bent}", told(margin)),
                None => told(margin),
            });
        }
        if with_robot {
            let best = best(route);
            row.push(format!("{} of 8", route.working));
            row.push(best.map_or_else(|| "-".to_owned(), |best| best.label.to_owned()));
            let clearance = best.and_then(|best| best.clearance_m);
            row.push(clearance.map_or_else(|| "-".to_owned(), mm));
            let error = best.and_then(|best| best.error);
            row.push(error.map_or_else(|| "-".to_owned(), |error| mm(error.target_lateral_rms_m)));
        }
        table.add_row(row);
    }
    let rest = plan.routes.len().saturating_sub(SHOWN);
    let mut text = table.to_string();
    if rest > 0 {
        let _ = write!(text, "\n{rest} more in the file");
    }
    text
}

fn terms(route: &RouteAnswer) -> String {
    let terms = route.risk.terms.iter().filter(|term| term.log_odds != 0.0);
    let terms: Vec<String> = terms
        .map(|term| {
            let name = term.term.replace('_', " ");
            if term.share < 1.0 {
                format!(
                    "{name} x{:.2} ({:.0} % of x{})",
                    libm::exp(term.log_odds),
                    100.0 * term.share,
                    term.odds_ratio
                )
            } else {
                format!("{name} x{}", term.odds_ratio)
            }
        })
        .collect();
    let nearest: Vec<String> = route
        .margins
        .iter()
        .filter_map(|each| {
            Some(format!(
                "{} {:.1} mm",
                part_in_words(each.part.as_ref()?),
                each.distance_m? * 1e3
            ))
        })
        .collect();
    format!(
        "# odds x{:.2}: {}\n# nearest: {}",
        route.risk.odds_ratio,
        if terms.is_empty() {
            "no risk factor".to_owned()
        } else {
            terms.join(", ")
        },
        if nearest.is_empty() {
            "nothing".to_owned()
        } else {
            nearest.join(", ")
        }
    )
}
