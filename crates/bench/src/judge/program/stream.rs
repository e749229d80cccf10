//! Joint positions that a program streams.

use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointState;
use needlebench_urscript::Place;

/// Straight from target to target, each at its time.
#[derive(Debug)]
pub(super) struct Stream {
    start: Joints,
    /// Targets with the times at which they are reached, s from the start.
    targets: Vec<(f64, Joints, Place)>,
    /// How the joints slow down behind the last one.
    tail: Option<Tail>,
}

#[derive(Debug)]
struct Tail {
    velocity: Joints,
    duration_s: f64,
}

impl Stream {
    pub fn new(start: Joints) -> Self {
        Self {
            start,
            targets: Vec::new(),
            tail: None,
        }
    }

    pub fn push(&mut self, to: Joints, time_s: f64, place: Place) {
        self.targets
            .push((self.targets_end_s() + time_s, to, place));
    }

    fn targets_end_s(&self) -> f64 {
        self.targets.last().map_or(0.0, |last| last.0)
    }

    /// Speed at which the last target is reached, rad/s.
    pub fn last_velocity(&self) -> Joints {
        let Some((end_s, end, _)) = self.targets.last() else {
            return Joints::zeros();
        };
        let (from_s, from) = match self.targets.len().checked_sub(2) {
            Some(before) => (self.targets[before].0, self.targets[before].1),
            None => (0.0, self.start),
        };
        (end - from) / (end_s - from_s)
    }

    /// Stops behind the last target, the fastest joint at a deceleration (rad/s^2) and all together.
    pub fn stop(&mut self, deceleration_rad_s2: f64) {
        let velocity = self.last_velocity();
        let duration_s = velocity.amax() / deceleration_rad_s2;
        if duration_s > 0.0 {
            self.tail = Some(Tail {
                velocity,
                duration_s,
            });
        }
    }

    pub fn is_stopped(&self) -> bool {
        self.tail.is_some()
    }

    /// Until the joints stand, s.
    pub fn duration_s(&self) -> f64 {
        self.targets_end_s() + self.tail.as_ref().map_or(0.0, |tail| tail.duration_s)
    }

    pub fn end(&self) -> Joints {
        self.position(self.duration_s())
    }

    fn position(&self, time_s: f64) -> Joints {
        let next = self.targets.partition_point(|target| target.0 < time_s);
        let (from_s, from) = match next.checked_sub(1) {
            Some(before) => (self.targets[before].0, self.targets[before].1),
            None => (0.0, self.start),
        };
        match self.targets.get(next) {
            Some((to_s, to, _)) => {
                let share = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
                from + (to - from) * share
            }
            None => match &self.tail {
                Some(tail) => {
                    let passed_s = (time_s - from_s).min(tail.duration_s);
                    from + tail.velocity * (passed_s - 0.5 * passed_s.powi(2) / tail.duration_s)
                }
                None => from,
            },
        }
    }

    /// State by the differences to one period before and after: a corner is an acceleration over one period.
    pub fn state(&self, time_s: f64, period_s: f64) -> (JointState, Place) {
        let [before, here, after] =
            [time_s - period_s, time_s, time_s + period_s].map(|time_s| self.position(time_s));
        let state = JointState {
            position: here,
            velocity: (after - before) / (2.0 * period_s),
            acceleration: (after - here * 2.0 + before) / period_s.powi(2),
        };
        let next = self.targets.partition_point(|target| target.0 < time_s);
        let target = self.targets.get(next).or(self.targets.last());
        (state, target.map_or(Place::START, |target| target.2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 2e-3;

    #[test]
    fn a_stream_passes_its_targets_and_stops_within_the_way_of_its_deceleration() {
        let mut stream = Stream::new(Joints::zeros());
        let at = |speed: f64, step: u32| Joints::repeat(speed * PERIOD_S * f64::from(step));
        for step in 1..=100 {
            stream.push(at(0.5, step), PERIOD_S, Place::START);
        }
        let (state, _) = stream.state(50.0 * PERIOD_S, PERIOD_S);
        assert!((state.position - at(0.5, 50)).amax() < 1e-12);
        assert!((state.velocity - Joints::repeat(0.5)).amax() < 1e-9);
        assert!(state.acceleration.amax() < 1e-6);
        // From rest at once: half the speed within one period.
        let (state, _) = stream.state(0.0, PERIOD_S);
        assert!((state.acceleration - Joints::repeat(0.5 / PERIOD_S)).amax() < 1e-6);
        stream.stop(2.0);
        // v^2 / 2a.
        let way = stream.end() - at(0.5, 100);
        assert!((way - Joints::repeat(0.5 * 0.5 / 4.0)).amax() < 1e-12);
        assert!((stream.duration_s() - (100.0 * PERIOD_S + 0.25)).abs() < 1e-12);
    }
}
