//! Which column of a log is which quantity: the table that a user gives with a log of unknown names.
//!
//! ```toml
//! time = { column = "t_ms", unit = "ms" }
//! target_q = { columns = ["q1_ref", "q2_ref", "q3_ref", "q4_ref", "q5_ref", "q6_ref"], unit = "deg" }
//! actual_q = { columns = ["q1", "q2", "q3", "q4", "q5", "q6"], unit = "deg" }
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use needlebench_input::schema::FileSchema;
use needlebench_input::{Finding, TomlText, read_text};

/// Columns and units of the quantities of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogColumns {
    /// The file.
    pub file: String,
    text: String,
    content: Content,
}

/// Columns of one quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedColumns {
    /// Names of the columns, in the order of the joints or of x, y, z and the rotation vector.
    pub columns: Vec<String>,
    /// Factor to SI.
    pub to_si: f64,
}

#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Content {
    /// Timestamp of the row.
    time: One<TimeUnit>,
    /// Set-points of the joints.
    #[serde(default)]
    target_q: Option<Six<AngleUnit>>,
    /// Their speeds, per second.
    #[serde(default)]
    target_qd: Option<Six<AngleUnit>>,
    /// Their accelerations, per second squared.
    #[serde(default)]
    target_qdd: Option<Six<AngleUnit>>,
    /// The controller's rigid-body torques, without friction.
    #[serde(default)]
    target_moment: Option<Six<TorqueUnit>>,
    /// Set-points of the joint currents.
    #[serde(default)]
    target_current: Option<Six<CurrentUnit>>,
    /// Joint angles as measured.
    actual_q: Six<AngleUnit>,
    /// Joint speeds as measured, per second.
    #[serde(default)]
    actual_qd: Option<Six<AngleUnit>>,
    /// Currents as measured.
    #[serde(default)]
    actual_current: Option<Six<CurrentUnit>>,
    /// Torques at the joints as measured, friction included.
    #[serde(default)]
    actual_torque: Option<Six<TorqueUnit>>,
    /// Position of the tool centre point in the controller's `base` frame.
    #[serde(default)]
    tcp_position: Option<Three<LengthUnit>>,
    /// Its rotation vector.
    #[serde(default)]
    tcp_rotation: Option<Three<AngleUnit>>,
    /// Payload mass set in the controller, kg.
    #[serde(default)]
    payload: Option<One<MassUnit>>,
    /// Its centre of mass in the flange frame.
    #[serde(default)]
    payload_cog: Option<Three<LengthUnit>>,
    /// The controller's mode; 7 is running.
    #[serde(default)]
    robot_mode: Option<One<NoUnit>>,
}

#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct One<U> {
    /// Name of the column.
    column: String,
    /// Its unit.
    unit: U,
}

#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Three<U> {
    /// Names of the columns.
    columns: [String; 3],
    /// Their unit.
    unit: U,
}

#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Six<U> {
    /// Names of the columns, shoulder pan to wrist 3.
    columns: [String; 6],
    /// Their unit.
    unit: U,
}

macro_rules! units {
    ($(#[$doc:meta] $name:ident { $($(#[$each:meta])* $unit:ident = $factor:expr),+ $(,)? })+) => {$(
        #[$doc]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
        enum $name { $($(#[$each])* $unit),+ }

        impl $name {
            fn to_si(self) -> f64 {
                match self { $(Self::$unit => $factor),+ }
            }
        }
    )+};
}

units! {
    /// Unit of a time.
    TimeUnit {
        #[serde(rename = "s")] Seconds = 1.0,
        #[serde(rename = "ms")] Milliseconds = 1e-3,
        #[serde(rename = "us")] Microseconds = 1e-6,
        #[serde(rename = "ns")] Nanoseconds = 1e-9,
    }
    /// Unit of an angle.
    AngleUnit {
        #[serde(rename = "rad")] Radians = 1.0,
        #[serde(rename = "deg")] Degrees = std::f64::consts::PI / 180.0,
    }
    /// Unit of a torque.
    TorqueUnit {
        #[serde(rename = "N m")] NewtonMetres = 1.0,
    }
    /// Unit of a current.
    CurrentUnit {
        #[serde(rename = "A")] Amperes = 1.0,
        #[serde(rename = "mA")] Milliamperes = 1e-3,
    }
    /// Unit of a length.
    LengthUnit {
        #[serde(rename = "m")] Metres = 1.0,
        #[serde(rename = "mm")] Millimetres = 1e-3,
    }
    /// Unit of a mass.
    MassUnit {
        #[serde(rename = "kg")] Kilograms = 1.0,
    }
    /// Of a number without unit.
    NoUnit {
        #[serde(rename = "1")] One = 1.0,
    }
}

impl LogColumns {
    /// Reads a file; the path is relative to the working directory.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn load(path: &Path) -> Result<Self, Vec<Finding>> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("a TOML file that names the columns of the log");
            vec![Finding::new(&file, format!("cannot read the columns: {error}")).hint(hint)]
        })?;
        Self::parse(file, text)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn parse(file: String, text: String) -> Result<Self, Vec<Finding>> {
        let content: Content = TomlText::parse(&file, &text)
            .map_err(|finding| vec![finding])?
            .read(&FileSchema::of::<Content>())?;
        let columns = Self {
            file,
            text,
            content,
        };
        let lone = match (&columns.content.tcp_position, &columns.content.tcp_rotation) {
            (Some(_), None) => Some(("tcp_position", "tcp_rotation")),
            (None, Some(_)) => Some(("tcp_rotation", "tcp_position")),
            _ => None,
        };
        match lone {
            Some((key, other)) => Err(vec![
                columns
                    .finding(key, format!("`{key}` requires `{other}`"))
                    .hint("a pose needs a position and a rotation vector; give both or neither"),
            ]),
            None => Ok(columns),
        }
    }

    /// The columns by the quantity's name: `time`, `target_q`, `actual_TCP_pose` and so on.
    pub fn columns(&self) -> BTreeMap<&'static str, Vec<MappedColumns>> {
        fn six<U: Copy>(columns: &Six<U>, to_si: fn(U) -> f64) -> Vec<MappedColumns> {
            vec![MappedColumns {
                columns: columns.columns.to_vec(),
                to_si: to_si(columns.unit),
            }]
        }
        fn three<U: Copy>(columns: &Three<U>, to_si: fn(U) -> f64) -> MappedColumns {
            MappedColumns {
                columns: columns.columns.to_vec(),
                to_si: to_si(columns.unit),
            }
        }
        fn one<U: Copy>(column: &One<U>, to_si: fn(U) -> f64) -> Vec<MappedColumns> {
            vec![MappedColumns {
                columns: vec![column.column.clone()],
                to_si: to_si(column.unit),
            }]
        }
        let content = &self.content;
        let mut found = BTreeMap::new();
        found.insert("time", one(&content.time, TimeUnit::to_si));
        found.insert("actual_q", six(&content.actual_q, AngleUnit::to_si));
        let angles = [
            ("target_q", &content.target_q),
            ("target_qd", &content.target_qd),
            ("target_qdd", &content.target_qdd),
            ("actual_qd", &content.actual_qd),
        ];
        for (name, columns) in angles {
            found.extend(
                columns
                    .as_ref()
                    .map(|six_of| (name, six(six_of, AngleUnit::to_si))),
            );
        }
        let torques = [
            ("target_moment", &content.target_moment),
            ("actual_torque", &content.actual_torque),
        ];
        for (name, columns) in torques {
            found.extend(
                columns
                    .as_ref()
                    .map(|six_of| (name, six(six_of, TorqueUnit::to_si))),
            );
        }
        let currents = [
            ("target_current", &content.target_current),
            ("actual_current", &content.actual_current),
        ];
        for (name, columns) in currents {
            found.extend(
                columns
                    .as_ref()
                    .map(|six_of| (name, six(six_of, CurrentUnit::to_si))),
            );
        }
        if let (Some(position), Some(rotation)) = (&content.tcp_position, &content.tcp_rotation) {
            let pose = vec![
                three(position, LengthUnit::to_si),
                three(rotation, AngleUnit::to_si),
            ];
            found.insert("actual_TCP_pose", pose);
        }
        let cog = content.payload_cog.as_ref();
        found.extend(cog.map(|cog| ("payload_cog", vec![three(cog, LengthUnit::to_si)])));
        let payload = content.payload.as_ref();
        found.extend(payload.map(|mass| ("payload", one(mass, MassUnit::to_si))));
        let mode = content.robot_mode.as_ref();
        found.extend(mode.map(|mode| ("robot_mode", one(mode, NoUnit::to_si))));
        found
    }

    /// A finding about a key of the file.
    pub fn finding(&self, key: &str, message: impl Into<String>) -> Finding {
        match TomlText::parse(&self.file, &self.text) {
            Ok(toml) => toml.finding(key, message),
            Err(_) => Finding::new(&self.file, message).key(key),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const Q: &str = r#"columns = ["a", "b", "c", "d", "e", "f"]"#;

    fn parse(text: &str) -> Result<LogColumns, Vec<Finding>> {
        LogColumns::parse("columns.toml".to_owned(), text.to_owned())
    }

    #[test]
    fn columns_come_with_their_factor_to_si() {
        let text = format!(
            "time = {{ column = \"t\", unit = \"ms\" }}\nactual_q = {{ {Q}, unit = \"deg\" }}\n"
        );
        let columns = parse(&text).unwrap().columns();
        assert_eq!(columns["time"][0].to_si, 1e-3);
        let q = &columns["actual_q"][0];
        assert!((q.to_si - 0.017_453_292_519_943_295).abs() < 1e-18);
        assert_eq!(q.columns, ["a", "b", "c", "d", "e", "f"]);
        assert_eq!(columns.len(), 2);
    }

    #[test]
    fn a_unit_is_asked_for_and_checked() {
        let text = format!("time = {{ column = \"t\", unit = \"min\" }}\nactual_q = {{ {Q} }}\n");
        let findings = parse(&text).unwrap_err();
        let lines: Vec<_> = findings.iter().map(|finding| finding.line).collect();
        assert_eq!(lines, [Some(1), Some(2)], "{findings:?}");
    }

    #[test]
    fn half_a_pose_is_refused() {
        let text = format!(
            "time = {{ column = \"t\", unit = \"s\" }}\nactual_q = {{ {Q}, unit = \"rad\" }}\n\
             tcp_position = {{ columns = [\"x\", \"y\", \"z\"], unit = \"m\" }}\n"
        );
        let findings = parse(&text).unwrap_err();
        assert!(findings[0].message.contains("tcp_rotation"), "{findings:?}");
        assert_eq!(findings[0].line, Some(3));
    }
}
