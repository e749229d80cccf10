//! The shipped arms' URDFs as people have them: with a prefix, under another root, with origins of a calibration, in
//! another order, with further links and with the elements of other programs. Their forward kinematics is the product of
//! the written origins, multiplied here.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix4, Vector3};
use needlebench_input::Finding;
use needlebench_kinematics::{JOINT_NAMES, Joints};
use needlebench_robot::{Arm, LoadedRobot};
use needlebench_scenario::{Overrides, load_robot};

use crate::foreign_chains::{Draws, about_x, about_y, about_z, along, back, origin};

/// Products of a dozen transforms over two metres.
const PRODUCT: f64 = 1e-12;
/// Files of each arm.
const FILES: u64 = 24;

/// A joint as it is written.
#[derive(Clone, Debug)]
struct Joint {
    name: String,
    kind: String,
    parent: String,
    child: String,
    xyz: [String; 3],
    rpy: [String; 3],
    /// `<axis>` and `<limit>`.
    more: String,
}

/// A file: links by their names with what is in them, joints, and other elements.
#[derive(Clone, Debug)]
struct File {
    links: Vec<(String, String)>,
    joints: Vec<Joint>,
    others: Vec<String>,
}

fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let (_, rest) = text.split_once(from).unwrap_or_else(|| panic!("{from}"));
    rest.split_once(to).unwrap_or_else(|| panic!("{to}")).0
}

fn three(text: &str) -> [String; 3] {
    let words: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
    words.try_into().unwrap()
}

/// A text without the elements of a kind, which do not stand in one another.
fn without(text: &str, tag: &str) -> String {
    let (open, close) = (format!("<{tag}"), format!("</{tag}>"));
    let mut parts = text.split(&open);
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        kept += part.split_once(&close).unwrap().1;
    }
    kept
}

impl Joint {
    fn fixed(name: &str, parent: &str, child: &str, pose: &Matrix4<f64>) -> Self {
        let written = origin(pose);
        Self {
            name: name.to_owned(),
            kind: "fixed".to_owned(),
            parent: parent.to_owned(),
            child: child.to_owned(),
            xyz: three(between(&written, "xyz=\"", "\"")),
            rpy: three(between(&written, "rpy=\"", "\"")),
            more: String::new(),
        }
    }

    /// The pose that its numbers give.
    fn pose(&self) -> Matrix4<f64> {
        let [[x, y, z], [roll, pitch, yaw]] =
            [&self.xyz, &self.rpy].map(|words| words.clone().map(|word| word.parse().unwrap()));
        along(x, y, z) * about_z(yaw) * about_y(pitch) * about_x(roll)
    }

    fn set(&mut self, pose: &Matrix4<f64>) {
        let written = Self::fixed("", "", "", pose);
        (self.xyz, self.rpy) = (written.xyz, written.rpy);
    }
}

impl File {
    /// The shipped file of an arm.
    fn of(arm: &str) -> Self {
        let path = format!("../../models/{arm}/{arm}.urdf");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
        let text = without(&std::fs::read_to_string(path).unwrap(), "visual");
        let links = text.split("<link name=\"").skip(1).map(|rest| {
            let (name, rest) = rest.split_once('"').unwrap();
            let body = match rest.strip_prefix('>') {
                Some(rest) => rest.split_once("</link>").unwrap().0,
                None => "",
            };
            (name.to_owned(), body.to_owned())
        });
        let joints = text.split("<joint name=\"").skip(1).map(|rest| {
            let rest = rest.split_once("</joint>").unwrap().0;
            Joint {
                name: rest.split_once('"').unwrap().0.to_owned(),
                kind: between(rest, "type=\"", "\"").to_owned(),
                parent: between(rest, "<parent link=\"", "\"").to_owned(),
                child: between(rest, "<child link=\"", "\"").to_owned(),
                xyz: three(between(rest, "<origin xyz=\"", "\"")),
                rpy: three(between(rest, "rpy=\"", "\"")),
                more: match rest.find("<axis") {
                    Some(at) => rest[at..].to_owned(),
                    None => String::new(),
                },
            }
        });
        let file = Self {
            links: links.collect(),
            joints: joints.collect(),
            others: Vec::new(),
        };
        assert_eq!((file.links.len(), file.joints.len()), (11, 10), "{arm}");
        file
    }

    fn joint(&mut self, name: &str) -> &mut Joint {
        let found = self.joints.iter_mut().find(|joint| joint.name == name);
        found.unwrap_or_else(|| panic!("{name}"))
    }

    fn add(&mut self, joint: Joint, body: &str) {
        self.links.push((joint.child.clone(), body.to_owned()));
        self.joints.push(joint);
    }

    /// Takes a link out that hangs on a fixed joint and carries nothing.
    fn remove(&mut self, link: &str) {
        assert!(self.joints.iter().all(|joint| joint.parent != link));
        self.links.retain(|(name, _)| name != link);
        self.joints.retain(|joint| joint.child != link);
    }

    fn text(&self, draws: &mut Draws, prefix: &str) -> String {
        let links = self.links.iter().map(|(name, body)| match body.as_str() {
            "" => format!("  <link name=\"{prefix}{name}\"/>\n"),
            body => format!("  <link name=\"{prefix}{name}\">{body}</link>\n"),
        });
        let joints = self.joints.iter().map(|joint| {
            let Joint {
                name,
                kind,
                parent,
                child,
                xyz,
                rpy,
                more,
            } = joint;
            let (xyz, rpy) = (xyz.join(" "), rpy.join("  "));
            let [a, b] = [
                format!("<parent link=\"{prefix}{parent}\"/>\n<child link='{prefix}{child}'/>"),
                format!("<origin rpy=\"{rpy}\" xyz=\"{xyz}\" />"),
            ];
            // The order of a joint's elements says nothing either.
            let [a, b] = if draws.next() > 0.0 { [a, b] } else { [b, a] };
            format!("  <joint type=\"{kind}\" name=\"{prefix}{name}\">{a}{b}{more}</joint>\n")
        });
        let mut elements: Vec<String> = links.chain(joints).chain(self.others.clone()).collect();
        shuffle(&mut elements, draws);
        format!(
            "<?xml version=\"1.0\" ?>\n<robot name=\"theirs\">\n{}</robot>\n",
            elements.concat()
        )
    }

    /// From `base_link` to `tool0`: the product of the written origins and of the turns between.
    fn expected(&self, q: &Joints) -> Matrix4<f64> {
        let mut pose = Matrix4::identity();
        let mut at = "tool0";
        while at != "base_link" {
            let joint = self.joints.iter().find(|joint| joint.child == at).unwrap();
            let turn = match JOINT_NAMES.iter().position(|name| *name == joint.name) {
                Some(index) => about_z(q[index]),
                None => Matrix4::identity(),
            };
            pose = joint.pose() * turn * pose;
            at = &joint.parent;
        }
        pose
    }
}

fn shuffle(elements: &mut [String], draws: &mut Draws) {
    for last in (1..elements.len()).rev() {
        let other = draws.below(last + 1);
        elements.swap(last, other);
    }
}

/// Every arm joint's origin off by what a calibration may have, with all its digits.
fn calibrate(file: &mut File, draws: &mut Draws) {
    for name in JOINT_NAMES {
        let joint = file.joint(name);
        let mut small = |share: f64| share * draws.next();
        let moved = along(small(3e-4), small(3e-4), small(3e-4));
        let turned = about_z(small(1e-3)) * about_y(small(1e-3)) * about_x(small(1e-3));
        let pose = joint.pose() * moved * turned;
        joint.set(&pose);
    }
}

const GAZEBO: &str = r#"  <gazebo reference="forearm_link"><selfCollide>true</selfCollide><joint name="spring"/></gazebo>
  <gazebo><plugin filename="libgazebo_ros2_control.so" name="control"><parameters>a.yaml</parameters></plugin></gazebo>
"#;
const TRANSMISSION: &str = r#"  <transmission name="t"><type>transmission_interface/SimpleTransmission</type>
    <joint name="elbow_joint"><hardwareInterface>PositionJointInterface</hardwareInterface></joint>
    <actuator name="m"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>
"#;
const CONTROL: &str = r#"  <ros2_control name="ur" type="system"><hardware><plugin>mock_components/GenericSystem</plugin></hardware>
    <joint name="elbow_joint"><command_interface name="position"><param name="min">-1</param></command_interface>
    <state_interface name="position"/></joint></ros2_control>
"#;
const COMMENT: &str = r#"  <!-- <link name="base_link"/> <joint name="elbow_joint" type="prismatic"> of before -->
"#;
const CAMERA: &str = r#"<visual><geometry><mesh filename="package://camera/meshes/it.dae"/></geometry></visual>
  <collision><geometry><box size="0.02 0.09 0.02"/></geometry></collision>"#;
const GRIPPER: &str = r#"<inertial><origin xyz="0 0 0.04"/><mass value="0.9"/>
  <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="7e-4"/></inertial>
  <collision><origin xyz="0 0 0.05" rpy="0 0 0"/><geometry><cylinder radius="0.04" length="0.1"/></geometry></collision>"#;

/// One of the many forms in which such a file is in use.
fn vary(file: &mut File, draws: &mut Draws) {
    if draws.next() > 0.0 {
        calibrate(file, draws);
    }
    if draws.next() > 0.0 {
        // Without `base_link_inertia`: its half turn is in the shoulder's origin.
        let above = file.joint("base_link-base_link_inertia").pose();
        let pan = file.joint("shoulder_pan_joint");
        "base_link".clone_into(&mut pan.parent);
        let pose = above * pan.pose();
        pan.set(&pose);
        file.remove("base_link_inertia");
    }
    match draws.below(4) {
        0 => {
            let pose = along(draws.next(), draws.next(), 0.8) * draws.turn();
            let joint = Joint::fixed("stand", "world", "base_link", &pose);
            file.links.push(("world".to_owned(), String::new()));
            file.joints.push(joint);
        }
        1 => {
            // `base` as the root, and `base_link` below it.
            let joint = file.joint("base_link-base_fixed_joint");
            let pose = back(&joint.pose());
            joint.set(&pose);
            std::mem::swap(&mut joint.parent, &mut joint.child);
        }
        2 => file.remove("base"),
        _ => {}
    }
    match draws.below(3) {
        0 => {
            // `tool0` on wrist 3 itself.
            let pose = file.joint("wrist_3-flange").pose() * file.joint("flange-tool0").pose();
            let joint = file.joint("flange-tool0");
            "wrist_3_link".clone_into(&mut joint.parent);
            joint.set(&pose);
            file.remove("flange");
        }
        1 => {
            // A frame between, as of a force sensor; `tool0` stays where it is.
            let pose = along(0.0, 0.0, 0.04 * draws.next()) * draws.turn();
            let joint = file.joint("flange-tool0");
            "ft_frame".clone_into(&mut joint.parent);
            let below = back(&pose) * joint.pose();
            joint.set(&below);
            file.add(Joint::fixed("ft", "flange", "ft_frame", &pose), "");
        }
        _ => {}
    }
    if draws.next() > 0.0 {
        let pose = along(0.03 * draws.next(), 0.05, 0.02) * draws.turn();
        file.add(
            Joint::fixed("camera_joint", "tool0", "camera", &pose),
            CAMERA,
        );
    }
    if draws.next() > 0.0 {
        let pose = along(0.0, 0.0, 0.01);
        file.add(Joint::fixed("hand_joint", "tool0", "hand", &pose), GRIPPER);
        file.add(
            Joint::fixed("tip_joint", "hand", "gripper_tcp", &along(0.0, 0.0, 0.15)),
            "",
        );
    }
    if draws.next() > 0.0 {
        for (_, body) in &mut file.links {
            *body = without(body, "collision");
        }
    }
    for name in JOINT_NAMES.into_iter().skip(draws.below(8)) {
        let joint = file.joint(name);
        "continuous".clone_into(&mut joint.kind);
        "<axis xyz=\"0 0 1\"/><limit velocity=\"3.1\" effort=\"28\"/>".clone_into(&mut joint.more);
    }
    for name in JOINT_NAMES {
        let (_, body) = file
            .links
            .iter_mut()
            .find(|(link, _)| *link == "forearm_link")
            .unwrap();
        if draws.next() > 0.8 {
            body.push_str("<visual><geometry><mesh filename=\"package://ur_description/meshes/f.dae\"/></geometry></visual>");
        }
        if draws.next() > 0.0 {
            let more = &mut file.joint(name).more;
            more.push_str("<dynamics damping=\"0\" friction=\"0\"/>");
        }
    }
    for element in [GAZEBO, TRANSMISSION, CONTROL, COMMENT] {
        if draws.next() > 0.0 {
            file.others.push(element.to_owned());
        }
    }
}

fn load(text: &str) -> Result<LoadedRobot, Finding> {
    load_with(text, None)
}

fn load_with(text: &str, prefix: Option<&str>) -> Result<LoadedRobot, Finding> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("theirs.urdf");
    std::fs::write(&file, text).unwrap();
    load_robot(&Overrides {
        robot_urdf: Some(file),
        prefix: prefix.map(str::to_owned),
        ..Overrides::default()
    })
}

#[test]
fn a_variant_has_the_forward_kinematics_of_its_written_origins() {
    let mut worst = 0.0_f64;
    let mut files = 0;
    for (number, arm) in Arm::shipped_names().enumerate() {
        for variant in 0..FILES {
            let mut draws = Draws(variant + 1000 * number as u64 + 7);
            let mut file = File::of(arm);
            vary(&mut file, &mut draws);
            let prefix = ["", "left_", "ur_1_"][draws.below(3)];
            let text = file.text(&mut draws, prefix);
            let robot = load(&text)
                .unwrap_or_else(|finding| panic!("{arm} {variant}: {finding:?}\n{text}"));
            files += 1;
            for _ in 0..40 {
                let q = Joints::from_fn(|_, _| 2.0 * PI * draws.next());
                let off =
                    robot.chain.base_link_from_flange(&q).to_homogeneous() - file.expected(&q);
                worst = worst.max(off.amax());
                assert!(
                    off.amax() < PRODUCT,
                    "{arm} {variant}: {:e} at {q}\n{text}",
                    off.amax()
                );
            }
            // A written origin that is off by a micrometre is seen.
            let moved = file.joint("wrist_2_joint").pose() * along(0.0, 0.0, 1e-6);
            file.joint("wrist_2_joint").set(&moved);
            let zero = Joints::zeros();
            let off =
                robot.chain.base_link_from_flange(&zero).to_homogeneous() - file.expected(&zero);
            assert!(
                off.fixed_view::<3, 1>(0, 3).norm() > 0.9e-6,
                "{arm} {variant}"
            );
        }
    }
    println!("{files} files, worst deviation {worst:e}");
}

/// What is done to a file.
type Change<'a> = &'a dyn Fn(&mut File);

/// What a file lacks is said, with the joint and what to do.
#[test]
fn what_a_variant_lacks_is_said() {
    let limit = |more: &'static str| {
        move |file: &mut File| more.clone_into(&mut file.joint("elbow_joint").more)
    };
    let finger = |file: &mut File| {
        let mut joint = Joint::fixed("finger_joint", "tool0", "finger", &along(0.0, 0.0, 0.1));
        "prismatic".clone_into(&mut joint.kind);
        "<axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"0.04\" effort=\"9\" velocity=\"1\"/>\
         <mimic joint=\"other_finger\" multiplier=\"-1\"/>"
            .clone_into(&mut joint.more);
        file.add(joint, "");
    };
    let cases: [(Change, &str, &str); 7] = [
        (
            &limit("<axis xyz=\"0 0 1\"/><limit lower=\"-3\" upper=\"3\" effort=\"28\"/>"),
            "<limit> has no `velocity`",
            "",
        ),
        (
            &limit("<axis xyz=\"0 0 1\"/><limit upper=\"3\" effort=\"28\" velocity=\"3\"/>"),
            "the <limit> of joint 'elbow_joint' has no `lower`",
            "a revolute joint needs lower and upper, in radians",
        ),
        (
            &limit("<axis xyz=\"0 0 1\"/>"),
            "joint 'elbow_joint' has no <limit>",
            "effort (N m), velocity (rad/s)",
        ),
        (
            &finger,
            "joint 'finger_joint' moves but is not one of the arm's six",
            "make it fixed",
        ),
        (
            &|file| file.remove("tool0"),
            "it has no link 'tool0'",
            "the flange frame",
        ),
        (
            &|file| "prismatic".clone_into(&mut file.joint("elbow_joint").kind),
            "joint 'elbow_joint' is not revolute",
            "type=\"revolute\"",
        ),
        (
            &|file| "left".clone_into(&mut file.joint("wrist_2_joint").name),
            "it has no joint 'wrist_2_joint'",
            "joints need ROS's UR names",
        ),
    ];
    for arm in Arm::shipped_names() {
        for (change, message, hint) in &cases {
            let mut file = File::of(arm);
            change(&mut file);
            let text = file.text(&mut Draws(3), "");
            let finding = load(&text).unwrap_err();
            assert!(finding.message.contains(message), "{arm}: {finding}");
            let told = finding.hint.clone().unwrap_or_default();
            assert!(told.contains(hint), "{arm}: {finding}");
            assert!(finding.file.ends_with("theirs.urdf"), "{finding}");
        }
        // With the prefix said, what moves beside the arm stands still, and a note says so.
        let mut file = File::of(arm);
        finger(&mut file);
        let text = file.text(&mut Draws(4), "left_");
        let robot = load_with(&text, Some("left_")).unwrap();
        let notes = &robot.description.notes;
        let note = "fixed at 0: finger_joint";
        assert!(notes.iter().any(|told| told.contains(note)), "{notes:?}");
    }
}

/// A six-joint arm with a spherical wrist, of no maker in particular.
fn spherical_wrist(names: [&str; 6]) -> String {
    let places: [(Vector3<f64>, Vector3<f64>); 6] = [
        (Vector3::new(0.0, 0.0, 0.3), Vector3::z()),
        (Vector3::new(0.1, 0.0, 0.15), Vector3::y()),
        (Vector3::new(0.0, 0.0, 0.5), Vector3::y()),
        (Vector3::new(0.2, 0.0, 0.04), Vector3::x()),
        (Vector3::new(0.3, 0.0, 0.0), Vector3::y()),
        (Vector3::new(0.08, 0.0, 0.0), Vector3::x()),
    ];
    let mut text = "<robot name=\"theirs\"><link name=\"base_link\"/>\n".to_owned();
    let mut parent = "base_link".to_owned();
    for (index, (name, (place, axis))) in names.into_iter().zip(places).enumerate() {
        let child = format!("link_{}", index + 1);
        writeln!(
            text,
            "<link name=\"{child}\"><inertial><mass value=\"3\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" \
             iyz=\"0\" izz=\"0.01\"/></inertial></link><joint name=\"{name}\" type=\"revolute\">\
             <parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\
             <axis xyz=\"{} {} {}\"/><limit lower=\"-3\" upper=\"3\" effort=\"90\" velocity=\"3\"/></joint>",
            place.x, place.y, place.z, axis.x, axis.y, axis.z
        )
        .unwrap();
        parent = child;
    }
    text + "<link name=\"tool0\"/><joint name=\"flange\" type=\"fixed\"><parent link=\"link_6\"/><child link=\"tool0\"/>\
            <origin rpy=\"0 1.5707963267948966 0\"/></joint></robot>\n"
}

#[test]
fn the_six_joints_of_another_maker_are_refused() {
    let own = [
        "joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6",
    ];
    let finding = load(&spherical_wrist(own)).unwrap_err();
    assert!(
        finding
            .message
            .contains("not a UR arm: its moving joints are joint_1, joint_2"),
        "{finding}"
    );
    let hint = finding.hint.unwrap();
    assert!(
        hint.contains("the six-joint arms of Universal Robots"),
        "{hint}"
    );
    // By the names alone it is none either.
    let finding = load(&spherical_wrist(JOINT_NAMES)).unwrap_err();
    assert!(
        finding
            .message
            .contains("the joint origins are not those of a UR arm"),
        "{finding}"
    );
    assert!(finding.hint.unwrap().contains("six-joint UR arms"));
}
