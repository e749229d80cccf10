//! Measurements and commanded poses as text.

use std::fmt::Write;

use nalgebra::{Point3, UnitQuaternion};

use super::number::shifted;
use super::{AXES, Attained, Commanded};

/// Measurements as a log that [`read_log`](super::read_log) reads back to the same numbers.
pub fn write_log(title: &str, attained: &[Attained]) -> String {
    let oriented = attained.iter().any(|each| each.orientation.is_some());
    let mut text = comment(title);
    text.push_str("time_s,cycle,pose,direction,x_mm,y_mm,z_mm");
    text.push_str(if oriented { ",qw,qx,qy,qz\n" } else { "\n" });
    for each in attained {
        let time = each
            .time_s
            .map_or(String::new(), |time_s| time_s.to_string());
        let direction = each.axis.map_or("", |axis| AXES[axis]);
        // Writing to a String cannot fail.
        let _ = write!(text, "{time},{},P{},{direction},", each.cycle, each.pose);
        push_pose(
            &mut text,
            &each.position_m,
            oriented,
            each.orientation.as_ref(),
        );
    }
    text
}

/// Commanded poses as a text that [`read_commanded`](super::read_commanded) reads back to the same numbers.
pub fn write_commanded(title: &str, commanded: &[Commanded]) -> String {
    let oriented = commanded.iter().any(|each| each.orientation.is_some());
    let mut text = comment(title);
    text.push_str("pose,x_mm,y_mm,z_mm");
    text.push_str(if oriented { ",qw,qx,qy,qz\n" } else { "\n" });
    for each in commanded {
        let _ = write!(text, "P{},", each.pose);
        push_pose(
            &mut text,
            &each.position_m,
            oriented,
            each.orientation.as_ref(),
        );
    }
    text
}

fn comment(title: &str) -> String {
    let mut text = String::new();
    for line in title.lines() {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "# {line}");
    }
    text
}

fn push_pose(
    text: &mut String,
    position_m: &Point3<f64>,
    oriented: bool,
    orientation: Option<&UnitQuaternion<f64>>,
) {
    let mm: Vec<String> = position_m.iter().map(|value| shifted(*value, 3)).collect();
    text.push_str(&mm.join(","));
    match orientation {
        Some(q) => {
            let _ = write!(text, ",{},{},{},{}", q.w, q.i, q.j, q.k);
        }
        None if oriented => text.push_str(",,,,"),
        None => {}
    }
    text.push('\n');
}
