//! Factory calibration of an arm: the YAML file that ROS's `ur_calibration` writes.
//!
//! ```yaml
//! kinematics:
//!   shoulder: {x: 0, y: 0, z: 0.15197, roll: 0, pitch: 0, yaw: -4.1e-05}
//!   upper_arm: ...   # then forearm, wrist_1, wrist_2, wrist_3
//!   hash: calib_336188160809596540
//! ```
//!
//! Each entry is the pose of a link in its parent at zero joint positions, metres and radians
//! (fixed-axis roll, pitch, yaw as in URDF); the first parent is `base_link_inertia`, which is
//! `base_link` turned by 180 degrees about z. The flange is the frame of `wrist_3`.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;
use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_input::{
    Finding, ModelSource, YamlEntry, YamlNode, YamlValue, commented, nearest_name, parse_yaml,
    read_text, source_of,
};
use needlebench_kinematics::{
    Chain, ChainJoint, JOINT_COUNT, JOINT_LABELS, Pose, UrGeometry, UrModel, base_from_base_link,
    rotation_angle_between,
};

use crate::AppliedCalibration;
use crate::LoadedRobot;

/// Links in the order of the chain, as the file names them.
const LINKS: [&str; JOINT_COUNT] = [
    "shoulder",
    "upper_arm",
    "forearm",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];

const LENGTHS: [&str; 3] = ["x", "y", "z"];
const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];

/// How far a calibrated joint origin may be from the arm's nominal one.
///
/// Nine calibrations of real arms stay within 0.91 mm and 6.8 mrad. The two arms most like each other,
/// UR3 and UR3e, differ by 18.7 mm at wrist 1, so that none passes for another.
const ACCEPTED_M: f64 = 5e-3;
const ACCEPTED_RAD: f64 = 0.03;

/// No link of a UR arm is as long: the number is in another unit.
const LONGEST_M: f64 = 3.0;

/// More than a turn: the number is in another unit.
const LARGEST_RAD: f64 = 6.3;

/// True joint origins of one arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Pose of each link in its parent at zero joint positions; the first parent is
    /// `base_link_inertia`.
    pub origins: [Pose; JOINT_COUNT],
    /// What the driver compares with the controller's own calibration, e.g. `calib_33618...`.
    pub hash: Option<String>,
    /// The file.
    pub source: ModelSource,
}

/// How far joint origins are from others: the worst link's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OriginDeviation {
    /// The link whose origin is farthest off, in units of what is accepted.
    pub link: &'static str,
    /// Distance between the two origins of that link, m.
    pub position_m: f64,
    /// Angle between the two frames of that link, rad.
    pub angle_rad: f64,
}

impl OriginDeviation {
    fn between(a: &Chain, b: &Chain) -> Self {
        (0..JOINT_COUNT)
            .map(|i| {
                let [a, b] = [a, b].map(|chain| &chain.joints[i].parent_from_joint);
                Self {
                    link: LINKS[i],
                    position_m: (a.translation.vector - b.translation.vector).norm(),
                    angle_rad: rotation_angle_between(&a.rotation, &b.rotation),
                }
            })
            .max_by(|a, b| a.severity().total_cmp(&b.severity()))
            .expect("there are six links")
    }

    /// 1 at the limit of what is accepted.
    fn severity(&self) -> f64 {
        (self.position_m / ACCEPTED_M).max(self.angle_rad / ACCEPTED_RAD)
    }

    fn in_words(&self) -> String {
        format!(
            "{:.1} mm and {:.3} rad at {}",
            self.position_m * 1e3,
            self.angle_rad,
            self.link
        )
    }
}

impl Calibration {
    /// Reads a file; the path is relative to the working directory.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn load(path: &Path) -> Result<Self, Finding> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("the path is relative to the working directory");
            Finding::new(&file, format!("cannot read the calibration: {error}")).hint(hint)
        })?;
        Self::parse(&file, &text)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// What is wrong with it, with its line.
    pub fn parse(file: &str, text: &str) -> Result<Self, Finding> {
        if let Some(hint) = hint_on_other_formats(text) {
            return Err(Finding::new(file, "not a calibration in YAML").hint(hint));
        }
        let root = parse_yaml(file, text)?;
        let reader = Reader { file, text };
        let top = reader.map("", &root)?;
        let Some(kinematics) = top.iter().find(|entry| entry.key == "kinematics") else {
            let finding = reader.at(&root.span, "kinematics", "the key `kinematics` is missing");
            return Err(if top.iter().any(|entry| LINKS.contains(&&*entry.key)) {
                finding.hint("indent the six links below `kinematics:`")
            } else if let Some(near) = nearest_name("kinematics", keys(top)) {
                finding.hint(format!("did you mean `kinematics` by `{near}`?"))
            } else {
                finding.hint("a calibration is the file that ROS's `ur_calibration` writes")
            });
        };
        reader.refuse_unknown("", top, &["kinematics", "hash"])?;
        let entries = reader.map("kinematics", &kinematics.node)?;
        let known: Vec<&str> = LINKS.into_iter().chain(["hash"]).collect();
        reader.refuse_unknown("kinematics", entries, &known)?;
        let mut origins = [Pose::identity(); JOINT_COUNT];
        for (origin, link) in origins.iter_mut().zip(LINKS) {
            let entry = reader.required("kinematics", kinematics, entries, link)?;
            *origin = reader.origin(&format!("kinematics.{link}"), entry)?;
        }
        let hash = entries.iter().chain(top).find(|entry| entry.key == "hash");
        let hash = hash
            .map(|entry| match &entry.node.value {
                YamlValue::Scalar(hash) => Ok(hash.clone()),
                _ => Err(reader.at(&entry.node.span, "hash", "`hash` is not a single word")),
            })
            .transpose()?;
        Ok(Self {
            origins,
            hash,
            source: source_of(file.to_owned(), text.as_bytes()),
        })
    }

    /// The arm as a chain from `base_link`; its flange is `wrist_3`.
    pub fn chain(&self) -> Chain {
        let mut joints = self.origins.map(|parent_from_joint| ChainJoint {
            parent_from_joint,
            axis: Vector3::z_axis(),
        });
        // `base_link_inertia` in `base_link`: half a turn, which is its own inverse.
        joints[0].parent_from_joint = base_from_base_link() * joints[0].parent_from_joint;
        Chain {
            joints,
            wrist_3_from_flange: Pose::identity(),
        }
    }

    /// The text of a file with the joint origins of a chain from `base_link` whose flange is the last
    /// link; reads back to the same numbers but for rounding of the angles (1e-15 rad).
    ///
    /// `comment` stands above it.
    pub fn written(chain: &Chain, comment: &str) -> String {
        use std::fmt::Write;
        let mut text = commented(comment);
        text += "kinematics:\n";
        for (i, link) in LINKS.iter().enumerate() {
            let [x, y, z, roll, pitch, yaw] = origin_in_file(chain, i);
            // Writing to a text cannot fail.
            let _ = write!(text, "  {link}:\n    x: {x}\n    y: {y}\n    z: {z}\n");
            let _ = write!(
                text,
                "    roll: {roll}\n    pitch: {pitch}\n    yaw: {yaw}\n"
            );
        }
        text
    }

    /// How far the origins are from those of an arm with these lengths.
    ///
    /// Frames are compared as rotations: the many triples of roll, pitch and yaw that mean the same
    /// count as the same.
    pub fn deviation_from(&self, geometry: &UrGeometry) -> OriginDeviation {
        OriginDeviation::between(&self.chain(), &geometry.chain())
    }

    /// The arm that the calibration is most likely of, and how far it is from it.
    pub fn nearest_model(&self) -> (UrModel, OriginDeviation) {
        UrModel::ALL
            .map(|model| (model, self.deviation_from(&model.geometry())))
            .into_iter()
            .min_by(|a, b| a.1.severity().total_cmp(&b.1.severity()))
            .expect("there are seven arms")
    }

    /// The chain, if the calibration is one of an arm with these lengths; `arm` names it.
    ///
    /// # Errors
    /// A calibration of another robot.
    pub fn chain_of(&self, arm: &str, geometry: &UrGeometry) -> Result<Chain, Finding> {
        let chain = self.chain();
        let off = OriginDeviation::between(&chain, &geometry.chain());
        // Origins may each be near and yet add up to an arm whose axes are not parallel any more.
        if off.severity() <= 1.0 && UrGeometry::of_chain(&chain).is_ok() {
            return Ok(chain);
        }
        let (nearest, fit) = self.nearest_model();
        let limits = format!(
            "accepted: {:.0} mm and {ACCEPTED_RAD} rad",
            ACCEPTED_M * 1e3
        );
        let (off, near) = (off.in_words(), fit.in_words());
        let finding = |message: String| Finding::new(&self.source.file, message);
        if fit.severity() <= 1.0 && nearest.name() != arm {
            return Err(finding(format!(
                "this is the calibration of another robot, a {nearest} (within {near}); it differs from \
                 the {arm} in use by {off} ({limits})"
            ))
            .hint(format!(
                "give the {arm}'s own calibration, or the arm of this calibration: `--arm {nearest}` with \
                 `ik` and `fk`, `--robot URDF` with every command"
            )));
        }
        let turned = self.with_usual_frames(geometry);
        let likely = if nearest.name() == arm || turned.is_some() {
            String::new()
        } else {
            format!("; the nearest arm is a {nearest}, with a difference of {near}")
        };
        Err(finding(format!(
            "this is not a calibration of the {arm} in use: it differs by {off} ({limits}){likely}"
        ))
        .hint(turned.unwrap_or_else(|| {
            "the poses are each link's in its parent, as ROS's `ur_calibration` writes them"
                .to_owned()
        })))
    }

    /// The same links with their frames turned about their axes as ROS's are, if that makes it a calibration of an arm
    /// with these lengths: which were turned, and the poses that take their place.
    ///
    /// A frame that is turned about its joint's axis and turned back by the next joint's origin moves no flange: both
    /// rotations are about the axis that the joint turns about. It turns the link's own shape. One that is not turned
    /// back shifts the zero of its joint.
    fn with_usual_frames(&self, geometry: &UrGeometry) -> Option<String> {
        let nominal = geometry.chain();
        [TurnedFrame::UndoneByTheNext, TurnedFrame::ShiftsTheZero]
            .into_iter()
            .find_map(|kind| self.with_frames_turned_back(&nominal, kind))
    }

    fn with_frames_turned_back(&self, nominal: &Chain, kind: TurnedFrame) -> Option<String> {
        let mut chain = self.chain();
        let mut turned = Vec::new();
        let mut changed = [false; JOINT_COUNT];
        for joint in 0..JOINT_COUNT - 1 {
            let [own, usual] = [&chain, nominal].map(|it| it.joints[joint].parent_from_joint);
            let off = (usual.rotation.inverse() * own.rotation).to_rotation_matrix();
            let angle = libm::atan2(off[(0, 1)] - off[(1, 0)], off[(0, 0)] + off[(1, 1)]);
            if angle.abs() <= ACCEPTED_RAD {
                continue;
            }
            // What an arm was measured to be off in this angle stays: frames are turned by right angles.
            let right = (angle / FRAC_PI_2).round() * FRAC_PI_2;
            let angle = if (angle - right).abs() <= ACCEPTED_RAD {
                right
            } else {
                angle
            };
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
            chain.joints[joint].parent_from_joint.rotation *= turn;
            changed[joint] = true;
            if kind == TurnedFrame::UndoneByTheNext {
                let next = &mut chain.joints[joint + 1].parent_from_joint;
                *next = Pose::from_parts(Translation3::identity(), turn.inverse()) * *next;
                changed[joint + 1] = true;
            }
            turned.push(format!(
                "{}'s by {:.1} deg",
                LINKS[joint],
                -angle.to_degrees()
            ));
        }
        let off = OriginDeviation::between(&chain, nominal);
        if turned.is_empty() || off.severity() > 1.0 || UrGeometry::of_chain(&chain).is_err() {
            return None;
        }
        let poses = (0..JOINT_COUNT)
            .filter(|&joint| changed[joint])
            .map(|joint| {
                let [x, y, z, roll, pitch, yaw] = origin_in_file(&chain, joint);
                format!(
                    "{}: x: {x}, y: {y}, z: {z}, roll: {roll}, pitch: {pitch}, yaw: {yaw}",
                    LINKS[joint]
                )
            });
        let (turned, poses) = (turned.join(", "), poses.collect::<Vec<_>>().join("; "));
        Some(match kind {
            TurnedFrame::UndoneByTheNext => format!(
                "link frames are rotated about their own axes relative to ROS's ({turned}), compensated by the next origin; \
                 the same arm with ROS's frames has {poses}"
            ),
            TurnedFrame::ShiftsTheZero => format!(
                "link frames are rotated about their own axes relative to ROS's ({turned}), which shifts the zero of these \
                 joints; if the joints read as in ROS, the arm with ROS's frames has {poses}"
            ),
        })
    }

    /// Replaces the joint origins of a robot; geometry and masses stay with their link's frame.
    pub fn apply_to(&self, robot: &mut LoadedRobot) -> Result<(), Finding> {
        let nominal = UrGeometry::of_chain(&robot.chain)
            .map_err(|error| Finding::new(&robot.description.source.file, error.to_string()))?;
        let arm = robot.description.arm_name.clone();
        let chain = self.chain_of(&arm, &nominal)?;
        check_frames(robot, &nominal)?;
        let off = self.deviation_from(&nominal);
        robot.chain.joints = chain.joints;
        robot.description.notes.push(format!(
            "joint origins from the factory calibration {}{}: they differ from the robot's by up \
             to {}",
            self.source.file,
            self.hash
                .as_ref()
                .map_or(String::new(), |hash| format!(" ({hash})")),
            off.in_words()
        ));
        robot.description.calibration = Some(AppliedCalibration {
            hash: self.hash.clone(),
            source: self.source.clone(),
        });
        Ok(())
    }
}

/// What a link frame does that is turned about its joint's axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TurnedFrame {
    /// Nothing: the next origin turns it back, with what it carries.
    UndoneByTheNext,
    /// The joint reads another angle at the same place.
    ShiftsTheZero,
}

/// Place and fixed-axis angles of a joint's origin as a file has them, m and rad; the chain's are from `base_link`.
fn origin_in_file(chain: &Chain, joint: usize) -> [f64; 6] {
    let mut origin = chain.joints[joint].parent_from_joint;
    if joint == 0 {
        origin = base_from_base_link() * origin;
    }
    let [x, y, z] = origin.translation.vector.into();
    let (roll, pitch, yaw) = origin.rotation.euler_angles();
    [x, y, z, roll, pitch, yaw]
}

/// Refuses a robot whose link frames are not `ur_description`'s: the calibration would move its
/// links to other places.
fn check_frames(robot: &LoadedRobot, nominal: &UrGeometry) -> Result<(), Finding> {
    let expected = nominal.chain();
    let off = OriginDeviation::between(&robot.chain, &expected);
    let other_axis = (0..JOINT_COUNT).find(|&i| {
        let [a, b] = [&robot.chain, &expected].map(|chain| chain.joints[i].axis);
        a.cross(&b).norm() > 1e-6 || a.dot(&b) < 0.0
    });
    let what = match other_axis {
        _ if off.severity() > 1.0 => format!("they differ by {}", off.in_words()),
        Some(joint) => format!("{} does not rotate about z", JOINT_LABELS[joint]),
        None => return Ok(()),
    };
    Err(Finding::new(
        &robot.description.source.file,
        format!("a calibration cannot be applied: the URDF's link frames are not ROS's ({what})"),
    )
    .key("--calibration")
    .hint("use a URDF made from ROS's ur_description, or write the calibrated origins into it"))
}

/// What is said of files that people mistake for the calibration.
fn hint_on_other_formats(text: &str) -> Option<&'static str> {
    let start = text.trim_start_matches('\u{feff}').trim_start();
    if start.starts_with('<') {
        return Some("it is XML: a URDF is given with --robot");
    }
    // The controller's own file, `.urcontrol/calibration.conf`.
    if start.starts_with('[') || text.contains("delta_theta") {
        return Some(
            "the controller's own calibration.conf has other numbers: ROS's `ur_calibration` \
             makes the YAML file from them",
        );
    }
    None
}

fn keys(entries: &[YamlEntry]) -> impl Iterator<Item = &str> {
    entries.iter().map(|entry| entry.key.as_str())
}

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn at(&self, span: &Range<usize>, key: &str, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message)
            .key(key)
            .at(self.text, span.clone())
    }

    fn map<'n>(&self, key: &str, node: &'n YamlNode) -> Result<&'n [YamlEntry], Finding> {
        let YamlValue::Map(entries) = &node.value else {
            let (key, what) = if key.is_empty() {
                ("kinematics", "the file")
            } else {
                (key, "it")
            };
            return Err(self
                .at(&node.span, key, format!("{what} has no keys and values"))
                .hint("`kinematics:`, and below it the six links, each with x, y, z, roll, pitch, yaw"));
        };
        Ok(entries)
    }

    fn refuse_unknown(
        &self,
        parent: &str,
        entries: &[YamlEntry],
        known: &[&str],
    ) -> Result<(), Finding> {
        let Some(entry) = entries.iter().find(|entry| !known.contains(&&*entry.key)) else {
            return Ok(());
        };
        let unknown = &entry.key;
        // What the file already has was not meant.
        let missing = known
            .iter()
            .copied()
            .filter(|key| !keys(entries).any(|k| k == *key));
        let hint = match nearest_name(unknown, missing) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("known keys: {}", known.join(", ")),
        };
        Err(self
            .at(
                &entry.key_span,
                &joined(parent, unknown),
                format!("unknown key `{unknown}`"),
            )
            .hint(hint))
    }

    fn required<'n>(
        &self,
        parent: &str,
        at: &YamlEntry,
        entries: &'n [YamlEntry],
        key: &str,
    ) -> Result<&'n YamlEntry, Finding> {
        entries
            .iter()
            .find(|entry| entry.key == key)
            .ok_or_else(|| {
                self.at(
                    &at.key_span,
                    &joined(parent, key),
                    format!("the key `{key}` is missing"),
                )
            })
    }

    fn origin(&self, link: &str, entry: &YamlEntry) -> Result<Pose, Finding> {
        let entries = self.map(link, &entry.node)?;
        let known: Vec<&str> = LENGTHS.into_iter().chain(ANGLES).collect();
        self.refuse_unknown(link, entries, &known)?;
        let mut numbers = [0.0; 6];
        for (number, key) in numbers.iter_mut().zip(&known) {
            let found = self.required(link, entry, entries, key)?;
            *number = self.number(&joined(link, key), &found.node)?;
        }
        for (key, value) in known.iter().zip(numbers) {
            let length = LENGTHS.contains(key);
            let (limit, unit, given, in_unit) = if length {
                (LONGEST_M, "m", "mm", value / 1e3)
            } else {
                (LARGEST_RAD, "rad", "degrees", value.to_radians())
            };
            if value.abs() > limit {
                let found = self.required(link, entry, entries, key)?;
                let what = if length { "lengths" } else { "angles" };
                return Err(self
                    .at(
                        &found.node.span,
                        &joined(link, key),
                        format!(
                            "a {key} of {value} {unit} is implausible for a link: is it in {given}?"
                        ),
                    )
                    .hint(format!(
                        "{what} are in {unit}: {value} {given} are {in_unit:.6} {unit}"
                    )));
            }
        }
        let [x, y, z, roll, pitch, yaw] = numbers;
        Ok(Pose::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }

    fn number(&self, key: &str, node: &YamlNode) -> Result<f64, Finding> {
        let YamlValue::Scalar(text) = &node.value else {
            return Err(self.at(&node.span, key, format!("`{key}` is not a number")));
        };
        // YAML writes `.nan` and `-.inf`.
        let plain = text
            .trim()
            .to_lowercase()
            .replace(".nan", "nan")
            .replace(".inf", "inf");
        match plain.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(_) => Err(self.at(
                &node.span,
                key,
                format!("`{key}` is {text}, which is not finite"),
            )),
            Err(_) => Err(self
                .at(
                    &node.span,
                    key,
                    format!("`{key}` is `{text}`, which is not a number"),
                )
                .hint("write a plain number with a decimal point, such as 1.5708 or -4.1e-05")),
        }
    }
}

fn joined(parent: &str, key: &str) -> String {
    if parent.is_empty() {
        key.to_owned()
    } else {
        format!("{parent}.{key}")
    }
}
