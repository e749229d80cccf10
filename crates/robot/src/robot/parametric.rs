//! A needle guide by numbers: the tool `parametric`.
//!
//! Plate, tube, block and densities are those of the shipped tools (`models/needle_guide`, steps 1 to 3 and 10 to 12 of its
//! README); a straight strut of aluminium joins plate and block. Everything lies in the plane of the flange axis
//! and the direction away from the arm's connector, as in the shipped tools. What it makes is a URDF like theirs, so all
//! that is true of a tool from a file is true of it.

use std::fmt::Write;

/// Densities, kg/m3: EN AW-6082, carbon steel, unfilled PEEK.
const ALUMINIUM: f64 = 2700.0;
const STEEL: f64 = 7850.0;
const PEEK: f64 = 1300.0;

const PLATE_RADIUS_M: f64 = 0.0315;
const PLATE_HEIGHT_M: f64 = 0.010;
const BUSH_RADIUS_M: f64 = 0.006;
const GUIDE_LENGTH_M: f64 = 0.050;
const BORE_M: f64 = 0.0014;
/// Edges of the block, the last along the guide.
const BLOCK_M: [f64; 3] = [0.022, 0.022, 0.040];
/// Section of the strut: across the plane, and in it.
const STRUT_M: [f64; 2] = [0.016, 0.012];
/// By which collision shapes are larger on every side.
const MARGIN_M: f64 = 0.0002;
/// Room between the plate and what stands before it, so that a screwdriver gets at the screws.
const BEFORE_PLATE_M: f64 = 0.002;

/// Where the guide tube is, in the frame of the flange: z out of it, -y away from the arm's connector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidePlace {
    /// Of the middle of the tube, along the flange axis.
    pub ahead_m: f64,
    /// Of the same, beside the axis, towards -y.
    pub beside_m: f64,
    /// Of the needle's direction from the flange axis, towards -y.
    pub tilt_rad: f64,
}

impl GuidePlace {
    /// That of the tool `offset`.
    pub const OFFSET: Self = Self {
        ahead_m: 0.055,
        beside_m: 0.070,
        tilt_rad: 0.0,
    };

    /// The least distance along the flange axis at which block and tube keep clear of the plate, m.
    pub fn least_ahead_m(&self) -> f64 {
        let (sine, cosine) = (
            libm::sin(self.tilt_rad).abs(),
            libm::cos(self.tilt_rad).abs(),
        );
        let tube = 0.5 * GUIDE_LENGTH_M * cosine + BUSH_RADIUS_M * sine;
        let block = 0.5 * (BLOCK_M[2] * cosine + BLOCK_M[1] * sine);
        PLATE_HEIGHT_M + BEFORE_PLATE_M + tube.max(block)
    }

    /// The tool as a URDF, lengths in metres; [`GuidePlace::least_ahead_m`] has to hold.
    pub(crate) fn urdf(&self) -> String {
        let mut text = String::from(
            "<?xml version=\"1.0\"?>\n<robot name=\"needle_guide_parametric\">\n  \
             <needle_guide bore_mm=\"1.40\" guide_length_mm=\"50\" needle_gauge=\"18\" needle_od_mm=\"1.270\" \
             needle_length_mm=\"200\"/>\n\n  \
             <material name=\"aluminium\"><color rgba=\"0.72 0.74 0.77 1\"/></material>\n  \
             <material name=\"peek\"><color rgba=\"0.80 0.70 0.52 1\"/></material>\n  \
             <material name=\"steel\"><color rgba=\"0.20 0.20 0.22 1\"/></material>\n\n  \
             <link name=\"tool_mount\"/>\n",
        );
        let upright = |y: f64, z: f64| Placed {
            x: 0.0,
            y,
            z,
            tilt_rad: 0.0,
        };
        let plate = Cylinder {
            radius: PLATE_RADIUS_M,
            bore: 0.0,
            length: PLATE_HEIGHT_M,
        };
        part(
            &mut text,
            "plate",
            "aluminium",
            upright(0.0, 0.5 * PLATE_HEIGHT_M),
            &plate.inertia(ALUMINIUM),
            &plate.element(0.0),
            // Nothing of it grows into the flange.
            Some((0.5 * MARGIN_M, plate.grown(MARGIN_M, 0.5 * MARGIN_M))),
        );
        for k in 0..4 {
            let angle = std::f64::consts::FRAC_PI_4 * f64::from(2 * k + 1);
            let (x, y) = (0.025 * libm::cos(angle), 0.025 * libm::sin(angle));
            for (name, radius, length, z) in [
                ("screw", 0.005, 0.0061, 0.00705),
                ("shank", 0.003, 0.004, 0.002),
            ] {
                let steel = Cylinder {
                    radius,
                    bore: 0.0,
                    length,
                };
                // It counts with what it weighs more than the aluminium in its place.
                let place = Placed { x, ..upright(y, z) };
                let inertia = steel.inertia(STEEL - ALUMINIUM);
                part(
                    &mut text,
                    &format!("{name}_{k}"),
                    "steel",
                    place,
                    &inertia,
                    &steel.element(0.0),
                    None,
                );
            }
        }
        let rise = self.ahead_m - PLATE_HEIGHT_M;
        let slope_rad = libm::atan2(self.beside_m, rise);
        let length = libm::hypot(self.beside_m, rise) - 0.5 * BLOCK_M[1];
        let middle = 0.5 * length;
        let strut = [STRUT_M[0], STRUT_M[1], length];
        let place = Placed {
            tilt_rad: slope_rad,
            ..upright(
                -middle * libm::sin(slope_rad),
                PLATE_HEIGHT_M + middle * libm::cos(slope_rad),
            )
        };
        let shape = Some((0.0, box_element(strut, MARGIN_M)));
        part(
            &mut text,
            "strut",
            "aluminium",
            place,
            &box_inertia(strut, ALUMINIUM),
            &box_element(strut, 0.0),
            shape,
        );
        let tilted = Placed {
            tilt_rad: self.tilt_rad,
            ..upright(-self.beside_m, self.ahead_m)
        };
        let hole = Cylinder {
            radius: BUSH_RADIUS_M,
            bore: 0.0,
            length: BLOCK_M[2],
        };
        let mut inertia = box_inertia(BLOCK_M, ALUMINIUM);
        for (value, out) in inertia.iter_mut().zip(hole.inertia(ALUMINIUM)) {
            *value -= out;
        }
        let shape = Some((0.0, box_element(BLOCK_M, MARGIN_M)));
        part(
            &mut text,
            "block",
            "aluminium",
            tilted,
            &inertia,
            &box_element(BLOCK_M, 0.0),
            shape,
        );
        let tube = Cylinder {
            radius: BUSH_RADIUS_M,
            bore: 0.5 * BORE_M,
            length: GUIDE_LENGTH_M,
        };
        let shape = Some((0.0, tube.grown(MARGIN_M, MARGIN_M)));
        part(
            &mut text,
            "guide_tube",
            "peek",
            tilted,
            &tube.inertia(PEEK),
            &tube.element(0.0),
            shape,
        );
        for (name, along_m) in [
            ("guide_entry", -0.5 * GUIDE_LENGTH_M),
            ("guide_exit", 0.5 * GUIDE_LENGTH_M),
            ("needle_tip", 0.200 - 0.5 * GUIDE_LENGTH_M),
        ] {
            let place = Placed {
                y: tilted.y - along_m * libm::sin(self.tilt_rad),
                z: tilted.z + along_m * libm::cos(self.tilt_rad),
                ..tilted
            };
            let _ = write!(text, "  <link name=\"{name}\"/>\n{}", joint(name, place));
        }
        text.push_str("</robot>\n");
        text
    }
}

/// A place in the tool's plane, turned about x.
#[derive(Clone, Copy)]
struct Placed {
    x: f64,
    y: f64,
    z: f64,
    tilt_rad: f64,
}

struct Cylinder {
    radius: f64,
    bore: f64,
    length: f64,
}

impl Cylinder {
    /// Mass, and moments about its centre along x, y and its axis.
    fn inertia(&self, density: f64) -> [f64; 4] {
        let squares = self.radius * self.radius + self.bore * self.bore;
        let area = std::f64::consts::PI * (self.radius * self.radius - self.bore * self.bore);
        let mass = density * area * self.length;
        let across = mass * (3.0 * squares + self.length * self.length) / 12.0;
        [mass, across, across, 0.5 * mass * squares]
    }

    fn element(&self, margin_m: f64) -> String {
        self.grown(margin_m, margin_m)
    }

    /// With so much more radius, and length at either end.
    fn grown(&self, radius_m: f64, end_m: f64) -> String {
        format!(
            "<cylinder radius=\"{:.9}\" length=\"{:.9}\"/>",
            self.radius + radius_m,
            self.length + 2.0 * end_m
        )
    }
}

fn box_inertia([a, b, c]: [f64; 3], density: f64) -> [f64; 4] {
    let mass = density * a * b * c;
    let [a, b, c] = [a, b, c].map(|edge| edge * edge);
    [
        mass,
        mass * (b + c) / 12.0,
        mass * (a + c) / 12.0,
        mass * (a + b) / 12.0,
    ]
}

fn box_element(size: [f64; 3], margin_m: f64) -> String {
    let [a, b, c] = size.map(|edge| edge + 2.0 * margin_m);
    format!("<box size=\"{a:.9} {b:.9} {c:.9}\"/>")
}

/// A link with one part about its origin, and the joint that it hangs on. The collision shape is shifted along z.
fn part(
    text: &mut String,
    name: &str,
    material: &str,
    place: Placed,
    [mass, ixx, iyy, izz]: &[f64; 4],
    visual: &str,
    collision: Option<(f64, String)>,
) {
    let _ = write!(
        text,
        "  <link name=\"{name}\">\n    <inertial>\n      <mass value=\"{mass:.9}\"/>\n      \
         <inertia ixx=\"{ixx:.15}\" ixy=\"0\" ixz=\"0\" iyy=\"{iyy:.15}\" iyz=\"0\" izz=\"{izz:.15}\"/>\n    \
         </inertial>\n    <visual>\n      <geometry>{visual}</geometry>\n      <material name=\"{material}\"/>\n    \
         </visual>\n"
    );
    if let Some((shift_m, shape)) = collision {
        let named = name.strip_prefix("guide_").unwrap_or(name);
        let _ = write!(
            text,
            "    <collision name=\"guide.{named}\">\n      <origin xyz=\"0 0 {shift_m:.9}\"/>\n      \
             <geometry>{shape}</geometry>\n    </collision>\n"
        );
    }
    let _ = write!(text, "  </link>\n{}", joint(name, place));
}

fn joint(child: &str, place: Placed) -> String {
    let Placed { x, y, z, tilt_rad } = place;
    format!(
        "  <joint name=\"tool_mount-{child}\" type=\"fixed\">\n    <parent link=\"tool_mount\"/>\n    \
         <child link=\"{child}\"/>\n    <origin xyz=\"{x:.12} {y:.12} {z:.12}\" rpy=\"{tilt_rad:.15} 0 0\"/>\n  </joint>\n"
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::robot::{ToolOverrides, read_tool};
    use needlebench_cell::Tool;
    use needlebench_input::{Location, PackagePaths};

    fn made(place: GuidePlace) -> Tool {
        let overrides = ToolOverrides {
            guide: Some(place),
            ..ToolOverrides::default()
        };
        read("parametric", &overrides)
    }

    fn read(name: &str, overrides: &ToolOverrides) -> Tool {
        let location = Location::of_model(name, "needle_guide", "urdf", Path::new(""));
        read_tool(
            &location,
            &PackagePaths::default(),
            overrides,
            &mut Vec::new(),
        )
        .unwrap()
        .tool
    }

    /// Guide, needle, plate and tube are those of the shipped tools where the numbers are theirs.
    #[test]
    fn shipped_tools_are_numbers_of_it() {
        /// The strut is straight, theirs has a corner and weighs more.
        const MASS_SHARE: f64 = 0.26;
        for (name, place) in [
            ("offset", GuidePlace::OFFSET),
            (
                "perpendicular",
                GuidePlace {
                    ahead_m: 0.070,
                    beside_m: 0.040,
                    tilt_rad: std::f64::consts::FRAC_PI_2,
                },
            ),
        ] {
            let (ours, theirs) = (made(place), read(name, &ToolOverrides::default()));
            for (ours, theirs) in [
                (ours.flange_from_guide_entry, theirs.flange_from_guide_entry),
                (ours.flange_from_guide_exit, theirs.flange_from_guide_exit),
            ] {
                let off = ours.inverse() * theirs;
                assert!(off.translation.vector.norm() < 1e-9, "{name}: {off}");
                assert!(off.rotation.angle() < 1e-9, "{name}: {off}");
            }
            assert_eq!((ours.bore_m, ours.needle), (theirs.bore_m, theirs.needle));
            let share = ours.body.mass_kg / theirs.body.mass_kg - 1.0;
            assert!(share.abs() < MASS_SHARE, "{name}: {share}");
            assert_eq!(ours.guide_solids.len(), 1);
            assert_eq!(ours.solids.len(), 3, "plate, strut, block");
        }
    }

    /// Sums of the parts' masses by their volumes.
    #[test]
    fn masses_are_those_of_the_parts() {
        let found = made(GuidePlace::OFFSET).body.mass_kg;
        let pi = std::f64::consts::PI;
        let plate = 2.70e-3 * pi * 31.5 * 31.5 * 10.0;
        let screws = 4.0 * (7.85e-3 - 2.70e-3) * pi * (25.0 * 6.1 + 9.0 * 4.0);
        let strut = 2.70e-3 * 16.0 * 12.0 * (libm::hypot(70.0, 45.0) - 11.0);
        let block = 2.70e-3 * (22.0 * 22.0 * 40.0 - pi * 36.0 * 40.0);
        let tube = 1.30e-3 * pi * (36.0 - 0.49) * 50.0;
        let grams = plate + screws + strut + block + tube;
        assert!((found * 1e3 - grams).abs() < 1e-4, "{found} {grams}");
    }

    #[test]
    fn the_least_distance_keeps_clear_of_the_plate() {
        for tilt_deg in [0.0_f64, 20.0, 45.0, 90.0, 110.0] {
            let mut place = GuidePlace {
                ahead_m: 0.0,
                beside_m: 0.05,
                tilt_rad: tilt_deg.to_radians(),
            };
            place.ahead_m = place.least_ahead_m();
            let tool = made(place);
            let lowest = |m: f64| (m - PLATE_HEIGHT_M - BEFORE_PLATE_M).abs() < 1e-3;
            let of = |pose: needlebench_kinematics::Pose| pose.translation.vector.z;
            let ends = [
                of(tool.flange_from_guide_entry),
                of(tool.flange_from_guide_exit),
            ];
            assert!(
                ends.into_iter().all(|z| z > PLATE_HEIGHT_M),
                "{tilt_deg}: {ends:?}"
            );
            if tilt_deg == 0.0 {
                assert!(lowest(ends[0]), "{ends:?}");
            }
        }
    }
}
