//! Free space and lines of sight of the people around the arm.

use super::{MOVING, SHARE_RESOLUTION};
use crate::metric::entry::Better::More;
use crate::metric::entry::Source::Configuration;
use crate::metric::entry::{Metric, Show};
use crate::metric::quantity::Quantity::{Angle, Ratio};
use crate::metric::readers::{preference, room};
use needlebench_cell::part_in_words;

pub(super) const PEOPLE: &[Metric] = &[
    Metric::new(
        "free_fraction",
        "free space",
        "fraction of the hemisphere about the entry point that is free of arm and tool",
        Ratio,
        Configuration(|each| room(each, |room| room.free_fraction)),
    )
    .better(More, SHARE_RESOLUTION)
    .ranked("free_fraction")
    .pareto()
    .show(Show::Percent)
    .summary(5, "Free space")
    .criterion("min_free_fraction", MOVING, |criteria| {
        criteria.min_free_fraction
    }),
    Metric::new(
        "sight_fraction",
        "line of sight",
        "fraction of people's lines of sight to entry point and needle that arm and tool do not \
         block, of those that are free without them",
        Ratio,
        Configuration(|each| room(each, |room| room.sight_fraction)),
    )
    .better(More, SHARE_RESOLUTION)
    .ranked("sight_fraction")
    .pareto()
    .show(Show::Percent)
    .summary(6, "Line of sight")
    .criterion("min_sight_fraction", MOVING, |criteria| {
        criteria.min_sight_fraction
    }),
    Metric::new(
        "hand_cone",
        "hand cone",
        "half-angle of the largest free cone behind the guide, a certified lower bound",
        Angle,
        Configuration(|each| room(each, |room| room.hand_cone_half_angle_rad)),
    )
    // 1 degree.
    .better(More, 0.0175)
    .ranked("hand_cone_deg")
    .pareto()
    .summary(7, "Hand cone (deg)")
    .criterion("min_hand_cone_deg", MOVING, |criteria| {
        criteria.min_hand_cone_deg.map(f64::to_radians)
    })
    .detail(|each, _, _| {
        let blocker = each
            .room
            .as_ref()
            .and_then(|room| room.hand_cone_blocker.as_ref());
        blocker.map_or(String::new(), |blocker| {
            format!("blocked by {}", part_in_words(blocker))
        })
    }),
    Metric::new(
        "preference",
        "physician's preferences",
        "degree to which the physician's stated preferences are met, 0 to 1",
        Ratio,
        Configuration(preference),
    )
    .better(More, SHARE_RESOLUTION)
    .ranked("preference"),
];
