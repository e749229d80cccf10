//! How metrics are read from a configuration's part of the report.

use needlebench_cell::{ClearanceClass, part_in_words};
use needlebench_uncertainty::budget::Moments;

use crate::report::{ClassClearance, ConfigurationReport, EngineReport};
use crate::room::RoomReport;

/// Which motion the report's clearances are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    Simulated,
    Planned,
}

/// Classes of physical bodies whose clearance counts.
pub(super) fn unwanted() -> impl Iterator<Item = ClearanceClass> {
    ClearanceClass::ALL
        .into_iter()
        .filter(|class| class.is_unwanted())
}

/// Classes of arm and tool against what stands around them.
pub(super) fn surroundings() -> impl Iterator<Item = ClearanceClass> {
    ClearanceClass::ALL
        .into_iter()
        .filter(|class| class.is_surroundings())
}

/// The least clearance of a class along a motion; none if the report has that of another one.
fn along(
    report: &ConfigurationReport,
    class: ClearanceClass,
    motion: Motion,
) -> Option<&ClassClearance> {
    let found = report.clearance.classes.get(class.name())?;
    let is_of = match &found.engine {
        Some(_) => Motion::Simulated,
        // What has no time is no motion's: a posture, or the needle's route.
        None if found.time_s.is_some() => Motion::Planned,
        None => return None,
    };
    (is_of == motion).then_some(found)
}

/// The least certified bound over classes; none unless all in the report are certified.
pub(super) fn certified(
    report: &ConfigurationReport,
    classes: impl Iterator<Item = ClearanceClass>,
    motion: Motion,
) -> Option<f64> {
    let found = classes.filter_map(|class| along(report, class, motion));
    let bounds = found.map(|found| found.certified_lower_bound_m);
    bounds
        .reduce(|least, next| Some(least?.min(next?)))
        .flatten()
}

/// The nearest approach over classes.
pub(super) fn attained(
    report: &ConfigurationReport,
    classes: impl Iterator<Item = ClearanceClass>,
    motion: Motion,
) -> Option<f64> {
    let found = classes.filter_map(|class| along(report, class, motion));
    found.map(|found| found.minimum_m).reduce(f64::min)
}

/// The least clearance of the final posture over classes.
pub(super) fn of_posture(
    report: &ConfigurationReport,
    classes: impl Iterator<Item = ClearanceClass>,
) -> Option<f64> {
    let known = &report.posture_clearance_m;
    let found = classes.filter_map(|class| known.get(class.name()).copied());
    found.reduce(f64::min)
}

/// Which bodies come how near to each other, and when.
pub(super) fn nearest(report: &ConfigurationReport, class: ClearanceClass) -> String {
    let found = report.clearance.classes.get(class.name());
    found.map_or(String::new(), |found| {
        let [a, b] = &found.pair;
        format!(
            "{} and {} in the {}",
            part_in_words(a),
            part_in_words(b),
            found.phase
        )
    })
}

/// Moments of the needle's tip at the target over the arm and patient population.
pub(super) fn budget(report: &ConfigurationReport) -> Option<&Moments> {
    let budget = report.budget.as_ref()?;
    Some(&budget.total.at_target.analytic)
}

/// When the arm stands in its final place.
pub(super) fn arrival_s(report: &ConfigurationReport) -> Option<f64> {
    let phases = report.motion.iter();
    let moving = phases.filter(|phase| phase.phase != "hold");
    moving.map(|phase| phase.end_s).reduce(f64::max)
}

/// Less of the sines of wrist and elbow.
pub(super) fn singularity(report: &ConfigurationReport) -> Option<f64> {
    let margins = report.margins?;
    Some(margins.wrist_sine.min(margins.elbow_sine))
}

/// A joint of the final posture.
pub(super) fn joint(report: &ConfigurationReport, index: usize) -> Option<f64> {
    Some(report.joints_rad?[index])
}

/// How well the doctor's preferences are met; none where none is stated.
pub(super) fn preference(report: &ConfigurationReport) -> Option<f64> {
    let room = report.room.as_ref()?;
    let elbow = room.elbow_as_preferred.map(f64::from);
    let stated: Vec<f64> = [elbow, room.preferred_side_free_fraction]
        .into_iter()
        .flatten()
        .collect();
    (!stated.is_empty()).then(|| stated.iter().sum::<f64>() / stated.len() as f64)
}

/// The largest contact force; above 0 wherever anything touched.
pub(super) fn contact_force(engine: &EngineReport) -> f64 {
    let contact = &engine.motion.contact;
    if contact.occurred {
        contact.peak_force_n.max(f64::MIN_POSITIVE)
    } else {
        0.0
    }
}

/// The first contact.
pub(super) fn first_contact(engine: Option<&EngineReport>) -> String {
    let contact = engine.map(|engine| &engine.motion.contact);
    let pair = contact.and_then(|contact| Some((contact, contact.first_pair.as_ref()?)));
    pair.map_or(String::new(), |(contact, [a, b])| {
        let time_s = contact.first_time_s.unwrap_or(0.0);
        let (a, b) = (part_in_words(a), part_in_words(b));
        format!("contact of {a} with {b} at {time_s:.2} s")
    })
}

/// Something of the room that people have.
pub(super) fn room(report: &ConfigurationReport, value: fn(&RoomReport) -> f64) -> Option<f64> {
    report.room.as_ref().map(value)
}
