//! Whether the values of an `arm.toml` can be.

use needlebench_input::{Finding, TomlText, nearest_name};
use needlebench_kinematics::JOINT_LABELS;

use super::data::{ArmData, BrakesData, StopData, TABLES};

/// What is wrong with the values of an arm's data.
pub(super) fn check_arm(toml: &TomlText<'_>, data: &ArmData) -> Vec<Finding> {
    let mut check = Check {
        toml,
        findings: Vec::new(),
    };
    check.text("name", &data.name);
    check.text("urdf", &data.urdf);
    check.sources(data);
    if let Some(friction) = &data.friction {
        for (i, (stiction, coulomb)) in friction
            .stiction_nm
            .iter()
            .zip(&friction.coulomb_nm)
            .enumerate()
        {
            if stiction < coulomb {
                let message = format!(
                    "the break-away torque of {stiction} N m is below the sliding friction of \
                     {coulomb} N m"
                );
                let key = format!("friction.stiction_nm[{i}]");
                let hint = "the break-away torque must be at least the sliding friction";
                check.refuse(&key, message, hint);
            }
        }
    }
    if let Some(brakes) = &data.brakes {
        check.brakes(brakes);
    }
    check.population(data);
    for name in data.lacks.keys() {
        let key = format!("lacks.{name}");
        if !TABLES.contains(&name.as_str()) {
            let hint = match nearest_name(name, TABLES) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("one of {}", TABLES.join(", ")),
            };
            check.refuse(&key, format!("there is no table `{name}`"), hint);
        } else if toml.span_of(name).is_some() {
            let message = format!("`[{name}]` is there");
            check.refuse(&key, message, "remove one of the two");
        }
    }
    check.findings
}

struct Check<'a> {
    toml: &'a TomlText<'a>,
    findings: Vec<Finding>,
}

impl Check<'_> {
    fn refuse(&mut self, key: &str, message: impl Into<String>, hint: impl Into<String>) {
        self.findings
            .push(self.toml.finding(key, message).hint(hint));
    }

    fn text(&mut self, key: &str, text: &str) {
        if text.trim().is_empty() {
            self.refuse(key, format!("`{key}` is empty"), "give a text");
        }
    }

    fn source(&mut self, key: &str, text: &str) {
        let rest = text.trim().strip_prefix("assumed").unwrap_or(text);
        if rest.trim_matches([' ', ':']).is_empty() {
            let message = format!("`{key}` names no source");
            self.refuse(key, message, "a citation, or `assumed: ` and the reason");
        }
    }

    fn sources(&mut self, data: &ArmData) {
        let mut all = vec![("geometry.source", &data.geometry.source)];
        if let Some(limits) = &data.limits {
            all.push(("limits.position_source", &limits.position_source));
            all.push(("limits.velocity_source", &limits.velocity_source));
            all.push(("limits.effort_source", &limits.effort_source));
        }
        if let Some(brakes) = &data.brakes {
            all.push(("brakes.standing.source", &brakes.standing.source));
        }
        for (key, source) in [
            ("inertia.source", data.inertia.as_ref().map(|t| &t.source)),
            (
                "enclosure.source",
                data.enclosure.as_ref().map(|t| &t.source),
            ),
            ("payload.source", data.payload.as_ref().map(|t| &t.source)),
            ("reach.source", data.reach.as_ref().map(|t| &t.source)),
            (
                "tool_speed.source",
                data.tool_speed.as_ref().map(|t| &t.source),
            ),
            (
                "repeatability.source",
                data.repeatability.as_ref().map(|t| &t.source),
            ),
            ("servo.source", data.servo.as_ref().map(|t| &t.source)),
            ("rotors.source", data.rotors.as_ref().map(|t| &t.source)),
            ("motors.source", data.motors.as_ref().map(|t| &t.source)),
            ("control.source", data.control.as_ref().map(|t| &t.source)),
            ("gravity.source", data.gravity.as_ref().map(|t| &t.source)),
            ("gears.source", data.gears.as_ref().map(|t| &t.source)),
            ("friction.source", data.friction.as_ref().map(|t| &t.source)),
            ("brakes.source", data.brakes.as_ref().map(|t| &t.source)),
            ("cell.source", data.cell.as_ref().map(|t| &t.source)),
            ("iso9283.source", data.iso9283.as_ref().map(|t| &t.source)),
            (
                "population.source",
                data.population.as_ref().map(|t| &t.source),
            ),
            (
                "calibration.source",
                data.calibration.as_ref().map(|t| &t.source),
            ),
        ] {
            all.extend(source.map(|source| (key, source)));
        }
        for (key, source) in all {
            self.source(key, source);
        }
    }

    fn brakes(&mut self, brakes: &BrakesData) {
        for (index, stop) in brakes.stops.iter().enumerate() {
            self.stop(brakes, index, stop);
        }
        for joint in JOINT_LABELS {
            if !brakes.stops.iter().any(|stop| stop.joint == joint) {
                let message = format!("there is no stop of {joint}");
                let hint = format!(
                    "add [[brakes.stops]] with joint = \"{joint}\", and its figures or `like`"
                );
                self.refuse("brakes.stops", message, hint);
            }
        }
    }

    fn stop(&mut self, brakes: &BrakesData, index: usize, stop: &StopData) {
        let key = |name: &str| format!("brakes.stops[{index}].{name}");
        let earlier = &brakes.stops[..index];
        if earlier.iter().any(|each| each.joint == stop.joint) {
            let message = format!("`{}` has two stops", stop.joint);
            self.refuse(&key("joint"), message, "keep one of them");
        }
        if let Some(source) = &stop.source {
            self.source(&key("source"), source);
        }
        let figures = [("distance_rad", stop.distance_rad), ("time_s", stop.time_s)];
        let Some(like) = &stop.like else {
            for (name, value) in figures {
                if value.is_none() {
                    self.refuse(
                        &key(name),
                        format!("the key `{name}` is missing"),
                        "a stop has `distance_rad` and `time_s`, or `like` another joint's",
                    );
                }
            }
            return;
        };
        for (name, value) in figures {
            if value.is_some() {
                let message = format!("`{name}` contradicts `like = \"{like}\"`");
                self.refuse(&key(name), message, "remove one of the two");
            }
        }
        let model = brakes.stops.iter().find(|each| each.joint == *like);
        if model.is_none_or(|model| model.like.is_some()) {
            let message = format!("`{like}` has no figures of its own");
            let hint = "`like` names a joint with `distance_rad` and `time_s`";
            self.refuse(&key("like"), message, hint);
        }
        if stop.source.is_none() {
            let message = "the key `source` is missing";
            let hint = "`assumed: ` and the reason for the other joint's brake";
            self.refuse(&key("source"), message, hint);
        }
    }

    fn population(&mut self, data: &ArmData) {
        let Some(population) = &data.population else {
            return;
        };
        if population.calibrations.is_empty() {
            let message = "there is no [[population.calibrations]]";
            let hint = "omit [population] if there is none";
            self.refuse("population", message, hint);
        }
        for (index, each) in population.calibrations.iter().enumerate() {
            let key = |name: &str| format!("population.calibrations[{index}].{name}");
            self.text(&key("file"), &each.file);
            self.source(&key("source"), &each.source);
        }
    }
}
