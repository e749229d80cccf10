//! Frames of the arm and the goal, by the names that ROS gives them.

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_cell::Robot;
use needlebench_kinematics::{Joints, LINK_NAMES, Pose};
use needlebench_ros::Stamp;
use needlebench_ros::message::{self, Header, TfMessage, TransformStamped};

use crate::motion::Motion;

/// A pose as messages have it.
pub(super) fn pose(of: &Pose) -> message::Pose {
    let q = of.rotation.quaternion();
    message::Pose {
        position: of.translation.vector.into(),
        quat_xyzw: [q.i, q.j, q.k, q.w],
    }
}

/// What is named `frame` at a time.
pub(super) fn header(frame: &str, time_ns: u64) -> Header {
    Header {
        stamp: Stamp::of_ns(time_ns),
        frame_id: frame.to_owned(),
    }
}

fn transform(
    parent: &str,
    child: &str,
    parent_from_child: &Pose,
    time_ns: u64,
) -> TransformStamped {
    TransformStamped {
        header: header(parent, time_ns),
        child_frame_id: child.to_owned(),
        parent_from_child: pose(parent_from_child),
    }
}

/// Frames that do not move: the base in the world, the flange and the guide on the last link, the planned needle.
pub(super) fn fixed(motion: &Motion<'_>) -> TfMessage {
    let arm = motion.real_arm;
    let goal = motion.goal;
    let [entry, exit] = arm.flange_from_guide;
    let tip = Translation3::new(0.0, 0.0, goal.insertion_length_m);
    // Its z is the direction of insertion.
    let along = goal.world_from_guide_exit.rotation;
    let at = |place: &nalgebra::Point3<f64>| Pose::from_parts(place.coords.into(), along);
    let mut all = vec![
        transform("world", "base_link", &arm.world_from_base_link, 0),
        transform("base_link", "base", &Robot::base_link_from_base(), 0),
        transform(LINK_NAMES[5], "tool0", &arm.chain.wrist_3_from_flange, 0),
        transform("tool0", "guide_entry", &entry, 0),
        transform("tool0", "guide_exit", &exit, 0),
        transform(
            "guide_exit",
            "needle_tip",
            &Pose::from_parts(tip, UnitQuaternion::identity()),
            0,
        ),
        transform("world", "planned_target", &at(&goal.target_m), 0),
    ];
    if let Some(entry_m) = &goal.entry_m {
        all.push(transform("world", "planned_entry", &at(entry_m), 0));
    }
    TfMessage(all)
}

/// The moving links, each in the one before it.
pub(super) fn moving(motion: &Motion<'_>, q: &Joints, time_ns: u64) -> TfMessage {
    let joints = motion.real_arm.chain.joints.iter().enumerate();
    let links = joints.map(|(index, joint)| {
        let parent = index
            .checked_sub(1)
            .map_or("base_link", |at| LINK_NAMES[at]);
        let turn = UnitQuaternion::from_axis_angle(&joint.axis, q[index]);
        let parent_from_link = joint.parent_from_joint * turn;
        transform(parent, LINK_NAMES[index], &parent_from_link, time_ns)
    });
    TfMessage(links.collect())
}

/// The pose whose z axis goes from one place to another, at the middle of the two, and their distance.
pub(super) fn between(from: &Vector3<f64>, to: &Vector3<f64>) -> Option<(Pose, f64)> {
    let way = to - from;
    let length_m = way.norm();
    let along = way.try_normalize(1e-9)?;
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    });
    Some((Pose::from_parts((from + way * 0.5).into(), turn), length_m))
}
