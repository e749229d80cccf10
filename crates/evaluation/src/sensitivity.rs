//! How errors of the joints move the needle's tip.

use nalgebra::Point3;
use needlebench_cell::Cell;
use needlebench_kinematics::Joints;
use needlebench_scenario::Goal;

/// Root of the sum of the squared speeds of the needle's tip under each joint alone, m/rad.
///
/// `|J_tip|` (Frobenius norm of the linear Jacobian of the tip at the end of the planned
/// insertion): with independent errors of standard deviation `s` in every joint the tip's
/// root-mean-square displacement is `s` times this, to first order.
pub fn tip_sensitivity(cell: &Cell, goal: &Goal, joints: &Joints) -> f64 {
    let tip_in_flange =
        cell.tool.flange_from_guide_exit * Point3::new(0.0, 0.0, goal.insertion_length_m);
    let jacobian = cell.robot.chain.jacobian_at(joints, &tip_in_flange.coords);
    jacobian.fixed_rows::<3>(0).norm()
}
