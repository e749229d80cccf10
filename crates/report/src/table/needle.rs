//! How a needle bends in tissue: a sentence, and what can be done about it.

use needlebench_cell::part_in_words;
use needlebench_evaluation::report::{BendSummary, NeedleReport};
use needlebench_show::Block;

/// Alternatives that the needle is compared with, and what its bevel may face.
pub(crate) fn needle_blocks(needle: &NeedleReport) -> Vec<Block> {
    let one = |metres: f64| format!("{:.1}", metres * 1e3);
    let layers = needle.layers.iter().map(|layer| {
        vec![
            layer.tissue.to_owned(),
            one(layer.length_m),
            format!("{:.1}", layer.stiffness_n_m2 * 1e-3),
            format!("{:.3}", layer.force_n),
        ]
    });
    let row = |what: &str, bend: &BendSummary| {
        vec![
            what.to_owned(),
            one(bend.median_m),
            format!("{} to {}", one(bend.p05_m), one(bend.p95_m)),
            one(bend.rms_m),
        ]
    };
    let own = [row("as planned", &needle.bend)];
    let rms_alone =
        |what: String, rms_m: f64| vec![what, "-".to_owned(), "-".to_owned(), one(rms_m)];
    let turned = needle.turned.map(|turned| {
        let what = format!("turned by 180 deg at {:.0} mm", turned.at_m * 1e3);
        rms_alone(what, turned.rms_m)
    });
    let aimed = needle.aimed_rms_m.map(|rms_m| {
        let what = match needle.aim_m {
            Some(aim_m) => format!("as planned, aimed {} mm against it", one(aim_m)),
            None => "aimed against the mean bend".to_owned(),
        };
        rms_alone(what, rms_m)
    });
    let by_hub = needle.by_hub_m.map(|bend_m| {
        let (what, none) = ("held by its hub, without a guide", "-".to_owned());
        vec![what.to_owned(), one(bend_m), none.clone(), none]
    });
    let others = needle
        .alternatives
        .iter()
        .map(|each| row(&each.what, &each.bend));
    let mut blocks = vec![
        Block::table(
            [
                "layer",
                "length (mm)",
                "stiffness (kN/m2)",
                "force across the tip (N)",
            ],
            layers.collect(),
        ),
        Block::table(
            ["needle", "median bend (mm)", "90 % of needles", "RMS"],
            own.into_iter()
                .chain(turned)
                .chain(aimed)
                .chain(by_hub)
                .chain(others)
                .collect(),
        ),
    ];
    if let (Some(best), Some(worst)) = (needle.faces.first(), needle.faces.last()) {
        blocks.push(Block::Lines(vec![format!(
            "bevel facing {}: the bent needle keeps {} mm from {}; facing {}: {} mm from {} (12:00 towards the head, seen \
             from the hub)",
            best.clock,
            one(best.distance_m),
            part_in_words(&best.part),
            worst.clock,
            one(worst.distance_m),
            part_in_words(&worst.part),
        )]));
    }
    if let Some(breath) = needle.breath {
        let mut lines = Vec::new();
        if breath.lung_slides_m > 0.0 {
            lines.push(format!(
                "a full breath once the needle is in: the lung slides {} mm along the wall, lateral to the needle: tip {} mm \
                 off the lesion",
                one(breath.lung_slides_m),
                one(breath.off_by_lung_m)
            ));
        }
        if breath.chest_moves_m > 0.0 {
            lines.push(format!(
                "a full breath in the closed guide: the chest moves {} mm lateral to the needle: tip {} mm off the lesion, \
                 the guide holds it with {:.1} N; neither with the guide open",
                one(breath.chest_moves_m),
                one(breath.off_by_chest_m),
                breath.guide_n
            ));
        }
        blocks.push(Block::Lines(lines));
    }
    blocks.push(Block::Lines(vec![format!(
        "assumed: {}",
        needle.assumed.join("; ")
    )]));
    blocks
}
