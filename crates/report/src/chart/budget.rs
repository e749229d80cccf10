//! Where the needle goes: error budgets as ellipses, and the shares of the sources.

use needlebench_evaluation::report::GoalReport;
use needlebench_show::chart::{
    Anchor, Axis, Chart, LEGEND_ROW_PX, Paint, Panel, Sample, Size, Stroke, legend,
};
use needlebench_uncertainty::Source;
use needlebench_uncertainty::budget::{ErrorBudget, Moments, SourceBudget};

use crate::table::budget::{ALLOWED_M, budgets, mm};

/// Side of a panel, px.
const PANEL_PX: f64 = 170.0;
/// From the left end of a tile to its panels, and from one panel to the next, px.
const BESIDE_PX: f64 = 58.0;
/// From the top of a tile to its panels, and from their foot to the bar of shares, px.
const ABOVE_PX: f64 = 30.0;
const BELOW_PX: f64 = 56.0;
const BAR_PX: f64 = 14.0;
/// Width and height of a tile, and the space around it, px.
const TILE_PX: [f64; 2] = [
    2.0 * (BESIDE_PX + PANEL_PX),
    ABOVE_PX + PANEL_PX + BELOW_PX + BAR_PX + SHARES_ROWS as f64 * LEGEND_ROW_PX + 6.0,
];
/// Rows of names below the bar of shares.
const SHARES_ROWS: usize = 2;
const GAP_PX: f64 = 20.0;
const COLUMNS: usize = 2;

const TARGET: Stroke = Stroke {
    paint: Paint::Series(0),
    width: 3.0,
    dash: None,
};
const SKIN: Stroke = Stroke {
    paint: Paint::Series(5),
    width: 2.0,
    dash: None,
};
const DRAWN: Stroke = Stroke {
    paint: Paint::Ink,
    width: 1.2,
    dash: Some([4.0, 3.0]),
};

/// Radius of the ellipse that holds 95 % of a plane normal distribution, in standard deviations.
const ELLIPSE_95: f64 = 2.4477;

/// Where the needle goes: 95 % ellipses at skin and target, across and along the needle, and the
/// shares of the sources, for every configuration; none without imperfections.
pub(crate) fn budget_chart(goal: &GoalReport) -> Option<Chart> {
    let budgets = budgets(goal);
    if budgets.is_empty() {
        return None;
    }
    let tiles: Vec<(&str, &ErrorBudget)> = budgets
        .into_iter()
        .map(|(configuration, budget)| (configuration.label, budget))
        .collect();
    Some(chart(&goal.name, &tiles))
}

/// The same of one configuration, on the scale of all of its goal, narrow enough for a column of a paper;
/// none without imperfections.
pub(crate) fn budget_figure(goal: &GoalReport, label: &str) -> Option<Chart> {
    let budgets = budgets(goal);
    let of_all: Vec<(&str, &ErrorBudget)> = budgets
        .into_iter()
        .map(|(configuration, budget)| (configuration.label, budget))
        .collect();
    let (label, budget) = of_all.iter().find(|(each, _)| *each == label)?;
    let title = format!("{}, {label}: distribution of needle positions", goal.name);
    let named = named_sources(&of_all);
    Some(tiles(title, &[(label, budget)], reach_m(&of_all), &named))
}

fn chart(goal: &str, budgets: &[(&str, &ErrorBudget)]) -> Chart {
    let title = format!("{goal}: distribution of needle positions");
    tiles(title, budgets, reach_m(budgets), &named_sources(budgets))
}

/// Half the side of all panels, m.
fn reach_m(budgets: &[(&str, &ErrorBudget)]) -> f64 {
    budgets
        .iter()
        .flat_map(|(_, budget)| [budget.total.at_target, budget.total.at_skin])
        .map(|point| {
            let moments = point.analytic;
            moments.bias().amax() + ELLIPSE_95 * moments.principal()[0].0
        })
        .fold(ALLOWED_M, f64::max)
        * 1.08
}

fn tiles(title: String, budgets: &[(&str, &ErrorBudget)], reach_m: f64, named: &[Source]) -> Chart {
    let columns = COLUMNS.min(budgets.len());
    let width = columns as f64 * (TILE_PX[0] + GAP_PX) + GAP_PX;
    let mut chart = Chart::new([width, 0.0], &*title);
    if columns == COLUMNS {
        chart.write_large([GAP_PX, 24.0], title);
    }
    let allowed = format!(
        "{} mm: largest error accepted by radiologists, mean",
        mm(ALLOWED_M)
    );
    let entries = [
        (Sample::Line(TARGET), "95 % ellipse at the target"),
        (Sample::Line(SKIN), "95 % ellipse at the skin"),
        (
            Sample::Line(DRAWN),
            "95 % ellipse at the target, from draws",
        ),
        (Sample::Circle(8.0, limit()), &*allowed),
    ];
    let key = if columns == COLUMNS { 56.0 } else { 20.0 };
    let rows = legend(&mut chart, [GAP_PX, key], width - 2.0 * GAP_PX, entries);
    let top = key + LEGEND_ROW_PX * rows as f64;
    for (index, (label, budget)) in budgets.iter().enumerate() {
        let corner = [
            GAP_PX + (index % columns) as f64 * (TILE_PX[0] + GAP_PX),
            top + (index / columns) as f64 * (TILE_PX[1] + GAP_PX),
        ];
        tile(&mut chart, corner, (label, budget), reach_m, named);
    }
    let rows = budgets.len().div_ceil(columns) as f64;
    chart.size[1] = top + rows * (TILE_PX[1] + GAP_PX);
    chart
}

fn limit() -> Stroke {
    Stroke::full(Paint::Limit, 1.2)
}

fn tile(
    chart: &mut Chart,
    [left, top]: [f64; 2],
    (label, budget): (&str, &ErrorBudget),
    reach_m: f64,
    named: &[Source],
) {
    let total = &budget.total;
    let heading = format!(
        "{label}: {} mm RMS, {} mm lateral",
        mm(total.at_target.analytic.rms_m),
        mm(total.at_target.analytic.lateral_rms_m)
    );
    chart.write(Anchor::Start, [left, top + 8.0], heading);
    let reach_mm = 1e3 * reach_m;
    let axis = |name: &str| Axis::linear(format!("{name} (mm)"), -reach_mm, reach_mm);
    let panels = [
        (1, "y, lateral"),
        // Along the needle.
        (2, "z, depth"),
    ];
    for (place, (vertical, name)) in panels.into_iter().enumerate() {
        let panel = Panel {
            corner: [
                left + BESIDE_PX + place as f64 * (BESIDE_PX + PANEL_PX),
                top + ABOVE_PX,
            ],
            size: [PANEL_PX; 2],
            title: String::new(),
            x: axis("x, lateral"),
            y: axis(name),
        };
        panel.draw(chart);
        let scale = 0.5 * PANEL_PX / reach_m;
        chart.circle(panel.at([0.0, 0.0]), ALLOWED_M * scale, limit());
        let mut ellipse = |moments: &Moments, stroke: Stroke| {
            let outline = ellipse_points(moments, (0, vertical));
            panel.curve(chart, outline, stroke);
            let bias = moments.bias();
            let middle = [1e3 * bias[0], 1e3 * bias[vertical]];
            panel.points(chart, [middle], stroke.width + 1.0, stroke.paint);
        };
        ellipse(&total.at_skin.analytic, SKIN);
        ellipse(&total.at_target.analytic, TARGET);
        if let Some(sampled) = &total.at_target.monte_carlo {
            ellipse(sampled, DRAWN);
        }
    }
    let bar = [left + BESIDE_PX, top + ABOVE_PX + PANEL_PX + BELOW_PX];
    shares(chart, bar, TILE_PX[0] - BESIDE_PX, budget, named);
}

/// Closed outline of the 95 % ellipse in two of the axes, mm.
fn ellipse_points(moments: &Moments, (x, y): (usize, usize)) -> Vec<[f64; 2]> {
    const POINTS: u32 = 64;
    let (bias, covariance) = (moments.bias(), moments.covariance());
    let (xx, yy, xy) = (covariance[(x, x)], covariance[(y, y)], covariance[(x, y)]);
    // Cholesky factor of the two rows and columns.
    let a = xx.max(0.0).sqrt();
    let b = if a > 0.0 { xy / a } else { 0.0 };
    let c = (yy - b * b).max(0.0).sqrt();
    (0..=POINTS)
        .map(|k| {
            let (sine, cosine) =
                libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(POINTS));
            [
                1e3 * (bias[x] + ELLIPSE_95 * a * cosine),
                1e3 * (bias[y] + ELLIPSE_95 * (b * cosine + c * sine)),
            ]
        })
        .collect()
}

/// Share of the mean square from which a source is named.
const WORTH_A_NAME: f64 = 0.02;

/// What a source has of the sources' mean square at the target; 0 where there is none.
fn share_of(budget: &ErrorBudget, source: Source) -> f64 {
    let square = |each: &SourceBudget| each.at_target.analytic.rms_m.powi(2);
    let sum: f64 = budget.sources.iter().map(square).sum();
    let mut sources = budget.sources.iter();
    let mine = sources.find(|each| each.source == Some(source) && sum > 0.0);
    mine.map_or(0.0, |each| square(each) / sum)
}

/// Sources that have a colour of their own, the largest over all budgets first; what is left is one grey rest.
fn named_sources(budgets: &[(&str, &ErrorBudget)]) -> Vec<Source> {
    /// As many as have room below the bar, and colours that nobody takes for one another.
    const MOST: usize = 5;
    let share = |source: Source| -> f64 {
        let of_each = budgets.iter().map(|(_, budget)| share_of(budget, source));
        of_each.fold(0.0, f64::max)
    };
    let mut named: Vec<(Source, f64)> = Source::ALL
        .into_iter()
        .map(|source| (source, share(source)))
        .collect();
    named.retain(|(_, share)| *share >= WORTH_A_NAME);
    // The sort is stable: equals stay in the order of reports.
    named.sort_by(|a, b| b.1.total_cmp(&a.1));
    named.truncate(MOST);
    named.into_iter().map(|(source, _)| source).collect()
}

/// A bar of the sources' shares of the mean square, the largest over all configurations first.
fn shares(
    chart: &mut Chart,
    [left, top]: [f64; 2],
    width: f64,
    budget: &ErrorBudget,
    named: &[Source],
) {
    /// Between an entry's colour and its text, and between entries, px.
    const SPACE_PX: [f64; 2] = [5.0, 14.0];
    // A goal whose arms and patients have no errors has nothing to share.
    if budget
        .sources
        .iter()
        .all(|each| each.at_target.analytic.rms_m <= 0.0)
    {
        return;
    }
    let words_of = |source: Source| {
        let mine = budget
            .sources
            .iter()
            .find(|each| each.source == Some(source));
        mine.map_or_else(String::new, |each| each.in_words().to_owned())
    };
    let mut parts: Vec<(f64, Paint, String)> = named
        .iter()
        .enumerate()
        .map(|(at, source)| {
            let share = share_of(budget, *source);
            (share, Paint::Series(at), words_of(*source))
        })
        .collect();
    let rest = 1.0 - parts.iter().map(|(share, ..)| share).sum::<f64>();
    parts.push((rest, Paint::Soft, "others".to_owned()));
    let mut drawn: f64 = 0.0;
    let mut names = Vec::new();
    for (share, color, name) in parts {
        let place = |share: f64| (share * width).round();
        let (from, to) = (place(drawn), place(drawn + share));
        chart.fill([left + from, top], [to - from, BAR_PX], color);
        drawn += share;
        if share >= WORTH_A_NAME {
            names.push((color, format!("{name} {:.0} %", share * 100.0)));
        }
    }
    let (mut x, mut y, mut row) = (left, top + BAR_PX + 13.0, 1);
    for (color, name) in names {
        let length = 10.0 + SPACE_PX[0] + Size::Small.width(&name);
        if x > left && x + length > left + width {
            row += 1;
            if row > SHARES_ROWS {
                break;
            }
            (x, y) = (left, y + LEGEND_ROW_PX);
        }
        chart.fill([x, y - 5.0], [10.0, 10.0], color);
        chart.write(Anchor::Start, [x + 10.0 + SPACE_PX[0], y], name);
        x += length + SPACE_PX[1];
    }
}

#[cfg(test)]
mod tests {
    use needlebench_uncertainty::budget::PointBudget;

    use super::*;

    fn point(rms_m: f64) -> PointBudget {
        let variance = rms_m * rms_m / 3.0;
        let moments = Moments {
            bias_m: [0.5 * rms_m, 0.0, -0.2 * rms_m],
            covariance_m2: [
                [variance, 0.5 * variance, 0.0],
                [0.5 * variance, variance, 0.0],
                [0.0, 0.0, variance],
            ],
            rms_m,
            lateral_rms_m: rms_m,
        };
        PointBudget {
            analytic: moments,
            monte_carlo: Some(moments),
            radius_95_m: None,
            drawn_radius_95_m: None,
            covariance_difference: None,
            bias_difference_m: None,
        }
    }

    fn of(source: Option<Source>, rms_m: f64) -> SourceBudget {
        SourceBudget {
            source,
            basis: None,
            at_skin: point(0.8 * rms_m),
            at_target: point(rms_m),
            skin_with_target: None,
        }
    }

    #[test]
    fn budgets_of_all_sources_are_legible() {
        for rms_m in [0.0, 1e-4, 3e-3, 0.2] {
            let budget = ErrorBudget {
                samples: 100,
                sources: Source::ALL.map(|source| of(Some(source), rms_m)).into(),
                total: of(None, rms_m),
                dominant: None,
                before_insertion: None,
                in_tissue: None,
                of_breath: None,
                breathing_freely: None,
            };
            let budgets = [("Right-Down-Unfold", &budget), ("Left-Up-Fold", &budget)];
            for count in [1, 2] {
                assert_eq!(chart("a_goal", &budgets[..count]).illegible(), None);
                // At 85 mm, 8 pt are a thirtieth of the width: 13 px of 400.
                if count == 1 {
                    let narrow = chart("a_goal", &budgets[..1]).size[0];
                    assert!(narrow <= 500.0, "{narrow}");
                }
            }
        }
    }

    #[test]
    fn ellipses_go_round_the_bias_at_the_radius_of_95_per_cent() {
        let moments = point(3e-3).analytic;
        let outline = ellipse_points(&moments, (0, 2));
        assert_eq!(outline.len(), 65);
        // Uncorrelated, so upright: 2.4477 standard deviations either way.
        let right = outline
            .iter()
            .map(|point| point[0])
            .fold(f64::MIN, f64::max);
        let high = outline
            .iter()
            .map(|point| point[1])
            .fold(f64::MIN, f64::max);
        let reach_mm = ELLIPSE_95 * 3.0_f64.sqrt();
        assert!((right - (1.5 + reach_mm)).abs() < 1e-9, "{right}");
        assert!((high - (-0.6 + reach_mm)).abs() < 1e-9, "{high}");
    }
}
