//! The error budgets of a goal: a table by source, and a picture of where the needle goes.

use std::fmt::Write;

use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_uncertainty::Source;
use needlebench_uncertainty::budget::{ErrorBudget, Moments, SourceBudget};

use super::table::plain_table;
use crate::picture::Image;
use crate::picture::flat::{Canvas, pixel};

/// Mean of the largest errors that 153 interventional radiologists allow, m.
const ALLOWED_M: f64 = 2.7e-3;

/// Root mean square tip errors of needle robots in clinical use, m.
const CLINICAL_M: [f64; 2] = [1.2e-3, 2.8e-3];

fn budgets(goal: &GoalReport) -> Vec<(&ConfigurationReport, &ErrorBudget)> {
    goal.configurations
        .iter()
        .filter_map(|each| Some((each, each.budget.as_ref()?)))
        .collect()
}

fn mm(metres: f64) -> String {
    format!("{:.2}", metres * 1e3)
}

/// Budgets as a table with what follows from them; none without imperfections.
pub(crate) fn budget_text(goal: &GoalReport) -> Option<String> {
    let budgets = budgets(goal);
    let (_, first) = budgets.first()?;
    let sources: Vec<Source> = first
        .sources
        .iter()
        .filter_map(|each| each.source)
        .collect();
    let mut header = vec!["configuration".to_owned()];
    header.extend(sources.iter().map(|source| source.name().to_owned()));
    header.extend(
        [
            "all",
            "all:\nacross",
            "all:\nbias",
            "all:\nspread",
            "all:\nat skin",
            "95 %\nwithin",
        ]
        .map(str::to_owned),
    );
    header.push("ways differ\nspread, bias".to_owned());
    let mut table = plain_table(&header.iter().map(String::as_str).collect::<Vec<_>>());
    for (configuration, budget) in &budgets {
        let mut row = vec![configuration.label.to_owned()];
        row.extend(
            budget
                .sources
                .iter()
                .map(|each| mm(each.at_target.analytic.rms_m)),
        );
        let total = &budget.total.at_target;
        let moments = &total.analytic;
        row.push(mm(moments.rms_m));
        row.push(mm(moments.lateral_rms_m));
        row.push(mm(moments.bias().norm()));
        row.push(mm(moments.covariance().trace().sqrt()));
        row.push(mm(budget.total.at_skin.analytic.rms_m));
        row.push(total.radius_95_m.map_or_else(|| "-".to_owned(), mm));
        row.push(largest_difference(budget));
        table.add_row(row);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    let mut text = format!(
        "error budget of the needle's tip over all arms and patients (mm, root mean square; by Jacobians{})\n{table}\n",
        if first.samples > 0 {
            format!(", against {} draws", first.samples)
        } else {
            String::new()
        }
    );
    // Writing to a String cannot fail.
    let _ = write_remarks(&mut text, goal, &budgets);
    Some(text)
}

/// The worst differences of the two ways over all sources: covariance in per cent, bias in um.
fn largest_difference(budget: &ErrorBudget) -> String {
    let all = || budget.sources.iter().chain([&budget.total]);
    let points = || all().flat_map(|each| [each.at_skin, each.at_target]);
    let covariance = points()
        .filter_map(|point| point.covariance_difference)
        .reduce(f64::max);
    let bias = points()
        .filter_map(|point| point.bias_difference_m)
        .reduce(f64::max);
    match (covariance, bias) {
        (Some(covariance), Some(bias_m)) => {
            format!("{:.1} %, {:.1} um", covariance * 100.0, bias_m * 1e6)
        }
        (None, Some(bias_m)) => format!("-, {:.1} um", bias_m * 1e6),
        _ => "-".to_owned(),
    }
}

fn write_remarks(
    out: &mut String,
    goal: &GoalReport,
    budgets: &[(&ConfigurationReport, &ErrorBudget)],
) -> std::fmt::Result {
    let rms = |budget: &ErrorBudget| budget.total.at_target.analytic.rms_m;
    let best = budgets
        .iter()
        .filter(|(configuration, _)| configuration.rejections.is_empty())
        .min_by(|(_, a), (_, b)| rms(a).total_cmp(&rms(b)));
    if let Some((configuration, budget)) = best {
        let dominant = budget.dominant.map_or("nothing", Source::name);
        writeln!(
            out,
            "least off of those that work: {}, {} mm, most of it by {dominant}",
            configuration.label,
            mm(rms(budget))
        )?;
        for source in budget.sources.iter().filter_map(|each| each.source) {
            let of = |each: &SourceBudget| each.at_target.analytic.rms_m;
            let value = |budget: &ErrorBudget| {
                let found = budget
                    .sources
                    .iter()
                    .find(|each| each.source == Some(source));
                found.map_or(f64::NAN, of)
            };
            let mut order: Vec<_> = budgets
                .iter()
                .filter(|(configuration, _)| configuration.rejections.is_empty())
                .collect();
            order.sort_by(|(_, a), (_, b)| value(a).total_cmp(&value(b)));
            if let ([least, .., most], true) = (&order[..], order.len() > 1) {
                let (low, high) = (value(least.1), value(most.1));
                if high > 1.2 * low && high > 0.1e-3 {
                    writeln!(
                        out,
                        "to {}: least sensitive {} ({} mm), most {} ({} mm)",
                        source.name(),
                        least.0.label,
                        mm(low),
                        most.0.label,
                        mm(high)
                    )?;
                }
            }
        }
    }
    for configuration in &goal.configurations {
        if let Some(why) = &configuration.budget_failure {
            writeln!(out, "{}: no error budget: {why}", configuration.label)?;
        }
        for (engine, report) in &configuration.engines {
            if let Some(off_m) = report
                .unexplained_tip_m
                .filter(|off_m| *off_m > UNEXPLAINED_M)
            {
                writeln!(
                    out,
                    "{}: {engine} leaves the tip {} mm from where the balance of torques has it",
                    configuration.label,
                    mm(off_m)
                )?;
            }
        }
    }
    writeln!(
        out,
        "anchors: {} mm is what interventional radiologists allow on average, {} to {} mm what \
         needle robots in clinics reach",
        mm(ALLOWED_M),
        mm(CLINICAL_M[0]),
        mm(CLINICAL_M[1])
    )
}

/// Distance from the prediction that is worth a line, m.
const UNEXPLAINED_M: f64 = 0.1e-3;

/// Size of a panel, and what lies between them, px.
const PANEL: usize = 190;
const GAP: usize = 14;
const TEXT: usize = 16;
const COLUMNS: usize = 2;

const WHITE: [u8; 3] = [255, 255, 255];
const GRID: [u8; 3] = [225, 228, 232];
const AXES: [u8; 3] = [150, 155, 160];
/// Colours that people with any colour vision tell apart (Okabe and Ito).
const BLUE: [u8; 3] = [0, 114, 178];
const ORANGE: [u8; 3] = [230, 159, 0];
const BLACK: [u8; 3] = [60, 60, 60];
const SOURCES: [[u8; 3]; 8] = [
    [0, 114, 178],
    [204, 121, 167],
    [230, 159, 0],
    [240, 228, 66],
    [0, 158, 115],
    [120, 120, 120],
    [86, 180, 233],
    [213, 94, 0],
];

/// Radius of the ellipse that holds 95 % of a plane normal distribution, in standard deviations.
const ELLIPSE_95: f64 = 2.4477;

/// Where the needle goes: 95 % ellipses at skin and target, across and along the needle, and the
/// shares of the sources, for every configuration; none without imperfections.
pub(crate) fn budget_picture(goal: &GoalReport) -> Option<Image> {
    let budgets = budgets(goal);
    if budgets.is_empty() {
        return None;
    }
    let reach_m = budgets
        .iter()
        .flat_map(|(_, budget)| [budget.total.at_target, budget.total.at_skin])
        .map(|point| {
            let moments = point.analytic;
            moments.bias().amax() + ELLIPSE_95 * moments.principal()[0].0
        })
        .fold(ALLOWED_M, f64::max)
        * 1.08;
    let tile = [2 * PANEL + GAP, PANEL + 6 * TEXT];
    let rows = budgets.len().div_ceil(COLUMNS);
    let width = COLUMNS * (tile[0] + 2 * GAP) + GAP;
    let height = rows * (tile[1] + GAP) + 4 * TEXT + GAP;
    let mut canvas = Canvas::new(width, height, WHITE);
    canvas.write_large(
        [GAP, GAP / 2],
        &format!("{}: where the needle goes", goal.name),
    );
    canvas.write(
        [GAP, GAP / 2 + 2 * TEXT],
        "ellipses hold 95 %: blue at the target, orange at the skin, black by draws; circle: 2.7 mm; grid 1 mm",
    );
    for (index, (configuration, budget)) in budgets.iter().enumerate() {
        let left = GAP + (index % COLUMNS) * (tile[0] + 2 * GAP);
        let top = 4 * TEXT + (index / COLUMNS) * (tile[1] + GAP);
        let total = &budget.total;
        canvas.write(
            [left, top],
            &format!(
                "{}   {} mm rms, {} mm across",
                configuration.label,
                mm(total.at_target.analytic.rms_m),
                mm(total.at_target.analytic.lateral_rms_m)
            ),
        );
        let panels = [(0, 1, "across: y over x"), (0, 2, "along: z over x")];
        for (panel, (x, y, caption)) in panels.into_iter().enumerate() {
            let corner = [left + panel * (PANEL + GAP), top + TEXT + 4];
            draw_panel(&mut canvas, corner, total, (x, y), reach_m);
            canvas.write([corner[0], corner[1] + PANEL + 2], caption);
        }
        draw_shares(&mut canvas, [left, top + PANEL + 3 * TEXT], tile[0], budget);
    }
    Some(canvas.into_image())
}

fn draw_panel(
    canvas: &mut Canvas,
    [left, top]: [usize; 2],
    total: &SourceBudget,
    (x, y): (usize, usize),
    reach_m: f64,
) {
    let half = 0.5 * PANEL as f64;
    let centre = [left as f64 + half, top as f64 + half];
    let scale = half / reach_m;
    let at = |point: [f64; 2]| [centre[0] + point[0] * scale, centre[1] - point[1] * scale];
    #[expect(clippy::cast_possible_truncation, reason = "a few millimetres")]
    let lines = (reach_m / 1e-3) as i32;
    for k in -lines..=lines {
        let at_m = f64::from(k) * 1e-3;
        let color = if k == 0 { AXES } else { GRID };
        canvas.stroke(at([at_m, -reach_m]), at([at_m, reach_m]), 1.0, color);
        canvas.stroke(at([-reach_m, at_m]), at([reach_m, at_m]), 1.0, color);
    }
    canvas.circle(centre, ALLOWED_M * scale, 1.0, AXES);
    let mut ellipse = |moments: &Moments, width: f64, color| {
        let outline = ellipse_points(moments, (x, y));
        for pair in outline.windows(2) {
            canvas.stroke(at(pair[0]), at(pair[1]), width, color);
        }
        let bias = moments.bias();
        canvas.disc(at([bias[x], bias[y]]), width + 1.0, color);
    };
    ellipse(&total.at_skin.analytic, 2.0, ORANGE);
    ellipse(&total.at_target.analytic, 3.0, BLUE);
    if let Some(sampled) = &total.at_target.monte_carlo {
        ellipse(sampled, 1.0, BLACK);
    }
    canvas.frame([left, top], [PANEL, PANEL], AXES);
}

/// Closed outline of the 95 % ellipse in two of the axes, m.
fn ellipse_points(moments: &Moments, (x, y): (usize, usize)) -> Vec<[f64; 2]> {
    const POINTS: u32 = 96;
    let (bias, covariance) = (moments.bias(), moments.covariance());
    let (xx, yy, xy) = (covariance[(x, x)], covariance[(y, y)], covariance[(x, y)]);
    // Cholesky factor of the two rows and columns.
    let a = xx.max(0.0).sqrt();
    let b = if a > 0.0 { xy / a } else { 0.0 };
    let c = (yy - b * b).max(0.0).sqrt();
    (0..=POINTS)
        .map(|k| {
            let (sine, cosine) =
                (std::f64::consts::TAU * f64::from(k) / f64::from(POINTS)).sin_cos();
            [
                bias[x] + ELLIPSE_95 * a * cosine,
                bias[y] + ELLIPSE_95 * (b * cosine + c * sine),
            ]
        })
        .collect()
}

/// A bar of the sources' shares of the mean square, with their names.
fn draw_shares(canvas: &mut Canvas, [left, top]: [usize; 2], width: usize, budget: &ErrorBudget) {
    let square = |each: &SourceBudget| each.at_target.analytic.rms_m.powi(2);
    let sum: f64 = budget.sources.iter().map(square).sum();
    if sum <= 0.0 {
        return;
    }
    let mut names = Vec::new();
    let mut drawn: f64 = 0.0;
    for each in &budget.sources {
        let Some(source) = each.source else { continue };
        let color = Source::ALL
            .iter()
            .position(|known| *known == source)
            .map_or(AXES, |index| SOURCES[index]);
        let share = square(each) / sum;
        let place = |share: f64| pixel(share * width as f64);
        let (from, to) = (place(drawn), place(drawn + share));
        canvas.fill([left + from, top], [to - from, TEXT - 4], color);
        drawn += share;
        if share >= 0.02 {
            names.push((share, format!("{} {:.0} %", source.name(), share * 100.0)));
        }
    }
    names.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut line = String::new();
    for (_, name) in names {
        let longer = if line.is_empty() {
            name
        } else {
            format!("{line}, {name}")
        };
        if canvas.width_of(&longer) > width {
            break;
        }
        line = longer;
    }
    canvas.write([left, top + TEXT], &line);
}
