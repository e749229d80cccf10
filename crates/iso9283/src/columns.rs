//! What the columns of a log mean, and what its cells say.

use std::collections::BTreeMap;

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};
use needlebench_input::{Finding, nearest_name};

use super::Commanded;
use super::log_units::{Dimension, LogUnits, RotationColumns, to_si};
use super::number::parse_shifted;
use super::table::{HEADER_HINT, Heading, Table};
use super::timestamp::seconds_of;

/// No robot is as large: a coordinate beyond has another unit, m.
const FARTHEST_M: f64 = 50.0;

/// A quaternion whose norm differs from 1 by more is none: rounding to four decimals gives 1e-4.
const QUATERNION_SLACK: f64 = 1e-3;

/// A quaternion this near to norm 1 is taken as it is, so that what was written reads back.
const QUATERNION_ROUNDING: f64 = 1e-12;

/// What a column can be, and its names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Role {
    Time,
    Cycle,
    Pose,
    Direction,
    Position(usize),
    Quaternion(usize),
    Rotation(usize),
}

const NAMES: [(Role, &[&str]); 14] = [
    (
        Role::Time,
        &[
            "time",
            "t",
            "timestamp",
            "time stamp",
            "date",
            "datetime",
            "date time",
        ],
    ),
    (
        Role::Cycle,
        &[
            "cycle",
            "cycle id",
            "run",
            "run number",
            "repetition",
            "iteration",
        ],
    ),
    (
        Role::Pose,
        &[
            "pose",
            "pose id",
            "point",
            "point name",
            "pointname",
            "point id",
            "pt",
            "name",
            "target",
            "target name",
            "waypoint",
            "waypoint number",
        ],
    ),
    (
        Role::Direction,
        &[
            "direction",
            "approach",
            "approach direction",
            "approach axis",
        ],
    ),
    (Role::Position(0), &["x"]),
    (Role::Position(1), &["y"]),
    (Role::Position(2), &["z"]),
    (Role::Quaternion(0), &["qw", "q0", "quat w"]),
    (Role::Quaternion(1), &["qx", "q1", "quat x"]),
    (Role::Quaternion(2), &["qy", "q2", "quat y"]),
    (Role::Quaternion(3), &["qz", "q3", "quat z"]),
    (Role::Rotation(0), &["rx"]),
    (Role::Rotation(1), &["ry"]),
    (Role::Rotation(2), &["rz"]),
];

/// One row, understood.
pub(super) struct Row {
    pub commanded: Commanded,
    pub cycle: Option<u32>,
    pub axis: Option<usize>,
}

/// Which column is what, and in which unit.
pub(super) struct Columns {
    of: BTreeMap<Role, usize>,
    /// Power of ten and factor to metres, per coordinate.
    length: [(i32, f64); 3],
    /// Factor to radians.
    angle: f64,
    rotation: Option<RotationColumns>,
    /// What was left out or assumed.
    pub notes: Vec<String>,
}

impl Columns {
    pub fn find(table: &Table<'_>, units: LogUnits, is_log: bool) -> Result<Self, Vec<Finding>> {
        let mut of = BTreeMap::new();
        let (mut findings, mut ignored) = (Vec::new(), Vec::new());
        for (column, heading) in table.headings.iter().enumerate() {
            match role_of(heading) {
                Some(role) => {
                    if of.insert(role, column).is_some() {
                        let message = format!("there are two columns for `{}`", heading.name);
                        findings.push(table.column_finding(column, message));
                    }
                }
                None => ignored.push(table.text[heading.span.clone()].to_owned()),
            }
        }
        for (role, name) in [
            (Role::Pose, "pose"),
            (Role::Position(0), "x_mm"),
            (Role::Position(1), "y_mm"),
            (Role::Position(2), "z_mm"),
        ] {
            if !of.contains_key(&role) {
                findings.push(missing(table, name, &ignored));
            }
        }
        let mut length = [(0, 1.0); 3];
        for (axis, found) in length.iter_mut().enumerate() {
            if let Some(&column) = of.get(&Role::Position(axis)) {
                match unit_of(table, column, Dimension::Length, units.length) {
                    Ok(unit) => *found = unit,
                    Err(finding) => findings.push(finding),
                }
            }
        }
        let mut angle = 1.0;
        let whole = |roles: &[Role]| roles.iter().filter(|role| of.contains_key(role)).count();
        let quaternion = [0, 1, 2, 3].map(Role::Quaternion);
        let rotation = [0, 1, 2].map(Role::Rotation);
        for (roles, what) in [
            (&quaternion[..], "qw, qx, qy, qz"),
            (&rotation[..], "rx, ry, rz"),
        ] {
            if !matches!(whole(roles), 0) && whole(roles) != roles.len() {
                let message = format!("not all columns {what} are present");
                findings.push(
                    Finding::new(table.file, message)
                        .hint("an orientation requires all of them; remove the others to omit it"),
                );
            }
        }
        if let Some(&column) = of.get(&Role::Rotation(0)) {
            match unit_of(table, column, Dimension::Angle, units.angle) {
                Ok((_, factor)) => angle = factor,
                Err(finding) => findings.push(finding),
            }
            if units.rotation.is_none() {
                findings.push(
                    table
                        .column_finding(column, "rx, ry, rz are ambiguous".to_owned())
                        .hint(
                            "use --rotation rotation-vector (as UR controllers display poses) or \
                             --rotation fixed-xyz (as SpatialAnalyzer displays frames)",
                        ),
                );
            }
        }
        if !findings.is_empty() {
            return Err(findings);
        }
        let mut notes = Vec::new();
        if !ignored.is_empty() {
            notes.push(format!(
                "{}: columns not used: {}",
                table.file,
                ignored.join(", ")
            ));
        }
        if is_log && !of.contains_key(&Role::Cycle) {
            notes.push(format!(
                "{}: no cycle column; cycles are taken from point names (P3_07) or counted",
                table.file
            ));
        }
        Ok(Self {
            of,
            length,
            angle,
            rotation: units.rotation,
            notes,
        })
    }

    pub fn row(
        &self,
        table: &Table<'_>,
        row: usize,
        commanded: &[Commanded],
    ) -> Result<Row, Finding> {
        let (pose, suffix) = self.pose(table, row, commanded)?;
        let mut position_m = Point3::origin();
        for axis in 0..3 {
            position_m[axis] = self.coordinate(table, row, axis)?;
        }
        let cycle = match self.of.get(&Role::Cycle) {
            Some(&column) => Some(whole_number(table, row, column)?),
            None => suffix,
        };
        Ok(Row {
            commanded: Commanded {
                pose,
                position_m,
                orientation: self.orientation(table, row)?,
            },
            cycle,
            axis: self.axis(table, row)?,
        })
    }

    /// Number of the pose, and of the cycle if the name has one.
    fn pose(
        &self,
        table: &Table<'_>,
        row: usize,
        commanded: &[Commanded],
    ) -> Result<(u32, Option<u32>), Finding> {
        let column = self.of[&Role::Pose];
        let text = table.cell(row, column);
        let known = || {
            let names: Vec<String> = commanded
                .iter()
                .map(|each| format!("P{}", each.pose))
                .collect();
            names.join(", ")
        };
        let Some((pose, cycle)) = pose_name(text) else {
            return Err(table
                .finding(row, column, format!("`{text}` is not a pose"))
                .hint("use P1 to P5, or 1 to 5; P3_07 for pose 3 in cycle 7"));
        };
        if !commanded.is_empty() && commanded.iter().all(|each| each.pose != pose) {
            return Err(table
                .finding(row, column, format!("`{text}` is not a commanded pose"))
                .hint(format!("commanded poses are {}", known())));
        }
        Ok((pose, cycle))
    }

    fn coordinate(&self, table: &Table<'_>, row: usize, axis: usize) -> Result<f64, Finding> {
        let column = self.of[&Role::Position(axis)];
        let (places, factor) = self.length[axis];
        let text = finite(table, row, column)?;
        let value_m = parse_shifted(&text, places).map_or(f64::NAN, |value| value * factor);
        if value_m.abs() <= FARTHEST_M {
            Ok(value_m)
        } else {
            Err(table
                .finding(row, column, format!("{text} would be {value_m:.0} m"))
                .hint("check the unit in the header"))
        }
    }

    fn axis(&self, table: &Table<'_>, row: usize) -> Result<Option<usize>, Finding> {
        let Some(&column) = self.of.get(&Role::Direction) else {
            return Ok(None);
        };
        match table.cell(row, column).trim_start_matches(['+', '-']) {
            "" | "none" => Ok(None),
            "x" | "X" | "1" => Ok(Some(0)),
            "y" | "Y" | "2" => Ok(Some(1)),
            "z" | "Z" | "3" => Ok(Some(2)),
            other => Err(table
                .finding(
                    row,
                    column,
                    format!("`{other}` is not an approach direction"),
                )
                .hint(
                    "use x, y or z (1, 2 or 3), or leave empty for the pose sequence without \
                     directions",
                )),
        }
    }

    fn orientation(
        &self,
        table: &Table<'_>,
        row: usize,
    ) -> Result<Option<UnitQuaternion<f64>>, Finding> {
        let number = |role: Role| -> Result<f64, Finding> {
            let text = finite(table, row, self.of[&role])?;
            Ok(text.parse().unwrap_or(f64::NAN))
        };
        if let Some(&column) = self.of.get(&Role::Quaternion(0)) {
            if table.cell(row, column).is_empty() {
                return Ok(None);
            }
            let [w, x, y, z] = [0, 1, 2, 3].map(|part| number(Role::Quaternion(part)));
            let q = Quaternion::new(w?, x?, y?, z?);
            let defect = (q.norm() - 1.0).abs();
            if defect > QUATERNION_SLACK {
                let message = format!("the quaternion has norm {:.4} instead of 1", q.norm());
                return Err(table
                    .finding(row, column, message)
                    .hint("columns must be qw, qx, qy, qz; check their order"));
            }
            return Ok(Some(if defect <= QUATERNION_ROUNDING {
                UnitQuaternion::new_unchecked(q)
            } else {
                UnitQuaternion::new_normalize(q)
            }));
        }
        let Some(meaning) = self
            .rotation
            .filter(|_| self.of.contains_key(&Role::Rotation(0)))
        else {
            return Ok(None);
        };
        let [x, y, z] = [0, 1, 2].map(|part| number(Role::Rotation(part)));
        let r = Vector3::new(x?, y?, z?) * self.angle;
        Ok(Some(match meaning {
            RotationColumns::RotationVector => UnitQuaternion::from_scaled_axis(r),
            RotationColumns::FixedXyz => UnitQuaternion::from_euler_angles(r.x, r.y, r.z),
        }))
    }

    /// Column of the poses.
    pub(crate) fn pose_column(&self) -> usize {
        self.of[&Role::Pose]
    }

    /// Time of every row, s; none where there is no column or it is not understood.
    pub fn times(&self, table: &Table<'_>, notes: &mut Vec<String>) -> Vec<Option<f64>> {
        let count = table.rows.len();
        let Some(&column) = self.of.get(&Role::Time) else {
            return vec![None; count];
        };
        let unit = table.headings[column].unit.as_deref();
        let unit = unit.and_then(|unit| to_si(unit, Dimension::Time));
        let times: Vec<Option<f64>> = (0..count)
            .map(|row| match unit {
                Some((places, _)) => parse_shifted(&table.number(row, column), places),
                None => seconds_of(table.cell(row, column)),
            })
            .map(|time_s| time_s.filter(|time_s| time_s.is_finite()))
            .collect();
        let unread = (0..count)
            .filter(|&row| times[row].is_none() && !table.cell(row, column).is_empty())
            .count();
        if unread > 0 {
            notes.push(format!(
                "{}: {unread} time stamps cannot be parsed and are ignored; give seconds in a \
                 column `time_s`, or dates like 2026-01-31T12:00:00",
                table.file
            ));
        }
        times
    }
}

fn role_of(heading: &Heading) -> Option<Role> {
    NAMES
        .iter()
        .find(|(_, names)| names.contains(&heading.name.as_str()))
        .map(|(role, _)| *role)
}

/// `P3`, `3`, `pose 3`, `Point3`; with a cycle `P3_07`, `P3-7`, `3.7`.
fn pose_name(text: &str) -> Option<(u32, Option<u32>)> {
    let text = text.to_ascii_lowercase();
    let rest = ["pose", "point", "pt", "p"]
        .iter()
        .find_map(|prefix| text.strip_prefix(prefix))
        .unwrap_or(&text)
        .trim_start_matches([' ', '_', '-']);
    let digits = rest
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(rest.len());
    let pose = rest[..digits].parse().ok().filter(|pose| *pose > 0)?;
    let suffix = rest[digits..].trim_start_matches([' ', '_', '-', '.', '#', '/', ':']);
    if rest.len() == digits {
        return Some((pose, None));
    }
    let cycle = suffix.parse().ok().filter(|cycle| *cycle > 0)?;
    Some((pose, Some(cycle)))
}

fn missing(table: &Table<'_>, name: &str, ignored: &[String]) -> Finding {
    let near = nearest_name(name, ignored.iter().map(String::as_str));
    Finding::new(table.file, format!("there is no column `{name}`"))
        .at(
            table.text,
            table.headings[0].span.start..table.headings[table.headings.len() - 1].span.end,
        )
        .hint(match near {
            Some(near) => format!("did you mean `{near}`? {HEADER_HINT}"),
            None => HEADER_HINT.to_owned(),
        })
}

/// Power of ten and factor from the unit of a column, or else that which was given, to SI.
fn unit_of(
    table: &Table<'_>,
    column: usize,
    of: Dimension,
    given: Option<&'static str>,
) -> Result<(i32, f64), Finding> {
    let heading = &table.headings[column];
    let name = &table.text[heading.span.clone()];
    let (what, units, usual) = match of {
        Dimension::Angle => ("angle", "deg, rad or mrad", "deg"),
        _ => ("length", "m, mm, um or in", "mm"),
    };
    let Some(unit) = heading.unit.as_deref().or(given) else {
        return Err(table
            .column_finding(column, format!("`{name}` does not state its unit"))
            .hint(format!(
                "write it as `{name}_{usual}`, or give --{what}-unit {usual}"
            )));
    };
    to_si(unit, of).ok_or_else(|| {
        table
            .column_finding(
                column,
                format!("`{unit}` is not a unit of {what} in `{name}`"),
            )
            .hint(units)
    })
}

/// Text of a cell that is a finite number.
fn finite(table: &Table<'_>, row: usize, column: usize) -> Result<String, Finding> {
    let text = table.number(row, column);
    let message = match text.parse::<f64>() {
        Ok(value) if value.is_finite() => return Ok(text),
        Ok(_) => format!("{text} is not a finite number"),
        Err(_) if text.is_empty() => "the value is missing".to_owned(),
        Err(_) => format!("`{text}` is not a number"),
    };
    Err(table
        .finding(row, column, message)
        .hint("omit the whole line if the tracker lost the target"))
}

fn whole_number(table: &Table<'_>, row: usize, column: usize) -> Result<u32, Finding> {
    let text = table.cell(row, column);
    text.parse()
        .ok()
        .filter(|number| *number > 0)
        .ok_or_else(|| {
            table
                .finding(row, column, format!("`{text}` is not a cycle number"))
                .hint("cycles are numbered 1, 2, 3 ...")
        })
}
