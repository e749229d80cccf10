//! Rows of a solver against the postures of a pose, counted.

use needlebench_kinematics::{Joints, Pose, UrGeometry, ik::wrap_angle};

use super::tracking::miss;

/// A row this near to a posture, rad, is that posture.
const SAME_RAD: f64 = 1e-6;

/// Near a singular posture the rounding of a row's own residual moves it by this, m and rad, over
/// the least singular value of the Jacobian: four roundings of a coordinate.
const ROUNDING: f64 = 1e-15;

/// However singular: a fourth root of a rounding, as where elbow and shoulder meet.
const MOST_RAD: f64 = 1e-3;

/// A row that misses by more, m or rad, is wrong: far above rounding.
pub const WRONG: f64 = 1e-6;

/// A posture by a solver.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    pub joints: Joints,
    /// It stands for all postures that differ in wrist 3 only, wrist 1 making up for it.
    pub free: bool,
}

impl Row {
    /// Whether it is a posture, or a family that has it, within what rounding does there.
    pub fn is(&self, geometry: &UrGeometry, posture: &Joints) -> bool {
        let near = |a: f64, b: f64, within: f64| wrap_angle(a - b).abs() < within;
        if self.free {
            let turn = if libm::cos(posture[4]) > 0.0 {
                1.0
            } else {
                -1.0
            };
            let sum = |q: &Joints| q[1] + q[2] + q[3] + turn * q[5];
            return near(self.joints[0], posture[0], SAME_RAD)
                && near(self.joints[4], posture[4], SAME_RAD)
                && near(sum(&self.joints), sum(posture), SAME_RAD);
        }
        let jacobian = geometry.chain().jacobian(posture);
        let flattest = jacobian.singular_values().min();
        let within = (ROUNDING / flattest).clamp(SAME_RAD, MOST_RAD);
        (0..6).all(|i| near(self.joints[i], posture[i], within))
    }
}

/// What became of some poses.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    pub poses: usize,
    /// Poses all of whose postures have a row.
    pub complete: usize,
    pub postures: usize,
    pub found: usize,
    /// Postures that the rounding of the pose makes miss, and rows for them.
    pub touching: usize,
    pub touching_found: usize,
    pub rows: usize,
    /// Rows that miss by more than [`WRONG`].
    pub wrong: usize,
    /// Worst miss of a row that is not wrong, m or rad.
    pub worst: f64,
    /// Answers that say of themselves what is not so.
    pub false_claims: usize,
}

impl Tally {
    /// Counts the rows of one pose. `touching` need not be found.
    pub fn count(
        &mut self,
        geometry: &UrGeometry,
        pose: &Pose,
        rows: &[Row],
        postures: &[Joints],
        touching: &[Joints],
    ) {
        let is_found = |posture: &&Joints| rows.iter().any(|row| row.is(geometry, posture));
        let found = postures.iter().filter(is_found).count();
        self.poses += 1;
        self.complete += usize::from(found == postures.len());
        self.postures += postures.len();
        self.found += found;
        self.touching += touching.len();
        self.touching_found += touching.iter().filter(is_found).count();
        self.rows += rows.len();
        for row in rows {
            let (miss_m, miss_rad) = miss(geometry, pose, &row.joints);
            let miss = miss_m.max(miss_rad);
            // Written so that NaN is wrong.
            if miss <= WRONG {
                self.worst = self.worst.max(miss);
            } else {
                self.wrong += 1;
            }
        }
    }

    pub const HEADER: &'static str = "poses | complete | postures | found | touching | found | rows | wrong | worst | false claims";

    pub fn line(&self) -> String {
        let percent = 100.0 * self.complete as f64 / self.poses.max(1) as f64;
        format!(
            "{:5} | {percent:6.1} % | {:8} | {:5} | {:8} | {:5} | {:4} | {:5} | {:.0e} | {}",
            self.poses,
            self.postures,
            self.found,
            self.touching,
            self.touching_found,
            self.rows,
            self.wrong,
            self.worst,
            self.false_claims,
        )
    }
}
