//! Moves that follow each other without a stop: each begins before the one before it ends.

use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{Joints, Pose};
use needlebench_urscript::Place;

use super::leg::{Leg, NoLine};

/// A move with what is to be known of its end.
#[derive(Debug)]
pub(super) struct Link {
    pub place: Place,
    pub leg: Leg,
    /// Distance of the tool's point from the end at which the next move may begin, m.
    pub blend_m: f64,
    pub flange_from_tcp: Pose,
}

impl Link {
    fn tcp(&self, kinematics: &Kinematics, joints: &Joints) -> nalgebra::Vector3<f64> {
        (kinematics.base_link_from_flange(joints) * self.flange_from_tcp)
            .translation
            .vector
    }

    /// Distance of the tool's point between start and end, m.
    pub fn chord_m(&self, kinematics: &Kinematics) -> f64 {
        let [start, end] = [&self.leg.start, &self.leg.end].map(|q| self.tcp(kinematics, q));
        (end - start).norm()
    }
}

/// Links in their order.
#[derive(Debug, Default)]
pub(super) struct MoveChain {
    links: Vec<Link>,
    starts_s: Vec<f64>,
}

/// Places at which a blend is compared with its sphere.
const PLACES: u32 = 64;

impl MoveChain {
    pub fn last(&self) -> Option<&Link> {
        self.links.last()
    }

    /// From the first start to the last end, s.
    pub fn duration_s(&self) -> f64 {
        let last = self.links.last().zip(self.starts_s.last());
        last.map_or(0.0, |(link, start_s)| start_s + link.leg.duration_s())
    }

    /// Adds a move; it begins so long before the end of the last one that the tool's point stays within the last one's
    /// blend radius of the corner while both move.
    ///
    /// # Errors
    /// [`NoLine`], at the place of the move that it is about.
    pub fn push(&mut self, kinematics: &Kinematics, link: Link) -> Result<(), (Place, NoLine)> {
        let overlap_s = match self.links.last() {
            Some(last) => overlap_s(kinematics, last, &link)?,
            None => 0.0,
        };
        self.starts_s.push(self.duration_s() - overlap_s);
        self.links.push(link);
        Ok(())
    }

    /// State at a time, and the link that is then the last to have begun.
    ///
    /// # Errors
    /// [`NoLine`], at the place of the move that it is about.
    pub fn state(
        &self,
        kinematics: &Kinematics,
        time_s: f64,
    ) -> Result<(JointState, Place), (Place, NoLine)> {
        let begun = self.starts_s.partition_point(|start_s| *start_s <= time_s);
        let last = begun.saturating_sub(1);
        let of = |index: usize| {
            let link: &Link = &self.links[index];
            let state = link.leg.state(kinematics, time_s - self.starts_s[index]);
            state.map_err(|error| (link.place, error))
        };
        let mut found = of(last)?;
        if last > 0 {
            let before = of(last - 1)?;
            found.position += before.position - self.links[last - 1].leg.end;
            found.velocity += before.velocity;
            found.acceleration += before.acceleration;
        }
        Ok((found, self.links[last].place))
    }
}

/// How long before the end of one move the next may begin, s.
///
/// Within the second half of the one the way to go falls ever slower, within the first half of the other the way done
/// grows ever faster; so their sum is nowhere farther from the corner than at the ends. Where the tool's point does not
/// go straight, that is looked at.
fn overlap_s(kinematics: &Kinematics, from: &Link, to: &Link) -> Result<f64, (Place, NoLine)> {
    let radius_m = from.blend_m;
    if radius_m <= 0.0 {
        return Ok(0.0);
    }
    let corner = from.tcp(kinematics, &from.leg.end);
    let off_m = |joints: &Joints| (from.tcp(kinematics, joints) - corner).norm();
    let at = |link: &Link, time_s: f64| {
        let state = link.leg.state(kinematics, time_s);
        state
            .map(|state| state.position)
            .map_err(|error| (link.place, error))
    };
    let end_s = from.leg.duration_s();
    // The time within the radius next to the corner, at most half of the move.
    let within = |link: &Link, to_end: bool| -> Result<f64, (Place, NoLine)> {
        let half_s = 0.5 * link.leg.duration_s();
        let place = |share: f64| {
            let time_s = half_s * share;
            let time_s = if to_end { end_s - time_s } else { time_s };
            at(link, time_s)
        };
        let (mut inside, mut outside) = (0.0, 1.0);
        let mut leaves = false;
        for step in 1..=PLACES {
            let share = f64::from(step) / f64::from(PLACES);
            if off_m(&place(share)?) > radius_m {
                outside = share;
                leaves = true;
                break;
            }
            inside = share;
        }
        if !leaves {
            return Ok(half_s);
        }
        for _ in 0..40 {
            let middle = 0.5 * (inside + outside);
            if off_m(&place(middle)?) > radius_m {
                outside = middle;
            } else {
                inside = middle;
            }
        }
        Ok(half_s * inside)
    };
    let mut overlap_s = within(from, true)?.min(within(to, false)?);
    'shorter: for _ in 0..60 {
        for step in 0..=PLACES {
            let time_s = overlap_s * f64::from(step) / f64::from(PLACES);
            let joints = at(from, end_s - overlap_s + time_s)? + at(to, time_s)? - from.leg.end;
            // Rounding where the blend begins and ends.
            if off_m(&joints) > radius_m * (1.0 + 1e-9) {
                overlap_s *= 0.9;
                continue 'shorter;
            }
        }
        return Ok(overlap_s);
    }
    Ok(0.0)
}
