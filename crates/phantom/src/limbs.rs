//! Head and arms: what of the patient, besides the chest, a robot beside the table may hit.
//!
//! Capsules in the phantom's frame. They lie on what the chest lies on and never lower, so where they are
//! depends on the patient position. Lengths and circumferences are measured ones (ANSUR II, see
//! `models/chest_phantom/README.md`); how a raised arm is bent is assumed.

use std::f64::consts::PI;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::Solid;

use super::solids::capsule;
use super::{PhantomParameters, PhantomPart, SKIN_RGBA, Tissue};
use crate::Arms;

/// Height of the suprasternal notch as a share of the half length: where the layout has it.
const NOTCH: f64 = 144.0 / 204.0;

/// A plane that carries the patient, in the phantom's frame.
#[derive(Debug, Clone, Copy)]
pub struct Support {
    /// Downwards.
    pub down: UnitVector3<f64>,
    /// Where the plane is along that, m.
    pub depth_m: f64,
}

impl Support {
    /// A ball's centre moved along the body's front-back axis until the ball lies on the plane; where it
    /// is if that axis is nearer to level than to upright.
    fn rest(&self, centre: Point3<f64>, radius_m: f64) -> Point3<f64> {
        const UPRIGHT: f64 = 0.7;
        if self.down.y.abs() < UPRIGHT {
            return centre;
        }
        let above_m = self.depth_m - radius_m - self.down.dot(&centre.coords);
        centre + Vector3::y() * (above_m / self.down.y)
    }

    /// A ball's centre moved up until the ball is above the plane.
    fn lift(&self, centre: Point3<f64>, radius_m: f64) -> Point3<f64> {
        let below_m = self.down.dot(&centre.coords) + radius_m - self.depth_m;
        centre - self.down.into_inner() * below_m.max(0.0)
    }
}

/// Head and arms of a size, as far as they are wanted.
pub fn limbs(
    parameters: &PhantomParameters,
    arms: Arms,
    head: bool,
    support: &Support,
) -> Vec<PhantomPart> {
    let body = Body {
        parameters,
        support,
    };
    let mut parts = Vec::new();
    if head {
        parts.extend(body.head());
    }
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let pieces = match arms {
            Arms::None => Vec::new(),
            Arms::Beside => body.arm_beside(side, sign),
            Arms::Overhead => body.arm_overhead(side, sign),
        };
        parts.extend(pieces);
    }
    parts
}

struct Body<'a> {
    parameters: &'a PhantomParameters,
    support: &'a Support,
}

impl Body<'_> {
    fn notch_m(&self) -> f64 {
        NOTCH * 0.5e-3 * self.parameters.length_mm
    }

    fn upper_arm_radius_m(&self) -> f64 {
        1e-3 * self.parameters.limbs.upper_arm_circumference_mm / (2.0 * PI)
    }

    fn forearm_radius_m(&self) -> f64 {
        1e-3 * self.parameters.limbs.forearm_circumference_mm / (2.0 * PI)
    }

    /// Distance of a hanging arm's upper end from the mid-sagittal plane, m.
    fn shoulder_m(&self) -> f64 {
        0.5e-3 * self.parameters.limbs.shoulder_breadth_mm - self.upper_arm_radius_m()
    }

    /// Skull, which lies on the support, and neck with the lower face.
    fn head(&self) -> Vec<PhantomPart> {
        let sizes = &self.parameters.limbs;
        let [breadth_m, length_m, above_notch_m, around_m] = [
            sizes.head_breadth_mm,
            sizes.head_length_mm,
            sizes.notch_to_vertex_mm,
            sizes.neck_circumference_mm,
        ]
        .map(|mm| 1e-3 * mm);
        let radius_m = 0.5 * breadth_m;
        let half_m = (0.5 * length_m - radius_m).max(0.0);
        let vertex_m = self.notch_m() + above_notch_m;
        let middle = Point3::new(0.0, 0.0, vertex_m - radius_m);
        // As a ball it would lie as deep as its lowest end does.
        let reach_m = radius_m + half_m * self.support.down.y.abs();
        let middle = self
            .support
            .lift(self.support.rest(middle, reach_m), reach_m);
        let ends = [-half_m, half_m].map(|along_m| middle + Vector3::y() * along_m);

        let neck_radius_m = around_m / (2.0 * PI);
        let in_chest = Point3::new(0.0, 0.0, self.notch_m());
        let in_skull = middle - Vector3::z() * (0.5 * radius_m);
        let neck = [in_chest, in_skull].map(|end| self.support.lift(end, neck_radius_m));
        vec![
            part("head".to_owned(), "head", ends, radius_m),
            part("neck".to_owned(), "head", neck, neck_radius_m),
        ]
    }

    /// Along the body: at its side, the palm to it.
    fn arm_beside(&self, side: &str, sign: f64) -> Vec<PhantomPart> {
        let sizes = &self.parameters.limbs;
        let (upper_m, fore_m) = (self.upper_arm_radius_m(), self.forearm_radius_m());
        let beside_m = self
            .shoulder_m()
            .max(0.5e-3 * self.parameters.breadth_mm + upper_m);
        let elbow_z_m = self.notch_m() - 1e-3 * sizes.upper_arm_length_mm;
        let finger_z_m = elbow_z_m - 1e-3 * (sizes.forearm_length_mm + sizes.hand_length_mm);
        let at = |x_m: f64, z_m: f64| Point3::new(sign * x_m, 0.0, z_m);
        let shoulder = at(self.shoulder_m(), self.notch_m() - upper_m);
        let elbow = at(beside_m, elbow_z_m);
        let finger = at(beside_m, finger_z_m + fore_m);
        vec![
            self.piece(side, "upper", [shoulder, elbow], upper_m),
            self.piece(side, "forearm", [elbow, finger], fore_m),
        ]
    }

    /// Raised beside the head, bent at the elbow, each hand over the other forearm above the head.
    fn arm_overhead(&self, side: &str, sign: f64) -> Vec<PhantomPart> {
        /// A raised shoulder lies nearer to the middle and to the head than a hanging one; and the elbows'
        /// room from the head (assumed), m.
        const SHOULDER_IN_M: f64 = 0.025;
        const SHOULDER_UP_M: f64 = 0.035;
        const ELBOW_FROM_HEAD_M: f64 = 0.04;
        /// Share of the half breadth and of the notch's height at which the folds of the armpit, latissimus
        /// and pectoral, leave the chest, and their thickness as a share of the arm's (assumed).
        const FOLD: [f64; 3] = [0.62, 0.30, 0.75];

        let sizes = &self.parameters.limbs;
        let (upper_m, fore_m) = (self.upper_arm_radius_m(), self.forearm_radius_m());
        let at = |x_m: f64, z_m: f64| Point3::new(sign * x_m, 0.0, z_m);

        let shoulder_x_m = self.shoulder_m() - SHOULDER_IN_M;
        let shoulder_z_m = self.notch_m() - upper_m + SHOULDER_UP_M;
        let elbow_x_m = 0.5e-3 * sizes.head_breadth_mm + upper_m + ELBOW_FROM_HEAD_M;
        let humerus_m = 1e-3 * sizes.upper_arm_length_mm - upper_m;
        let elbow_z_m = shoulder_z_m + other_side(humerus_m, elbow_x_m - shoulder_x_m);
        // The wrists meet in the middle.
        let wrist_z_m = elbow_z_m + other_side(1e-3 * sizes.forearm_length_mm, elbow_x_m - fore_m);
        let (shoulder, elbow) = (at(shoulder_x_m, shoulder_z_m), at(elbow_x_m, elbow_z_m));
        let wrist = at(fore_m, wrist_z_m);
        let hand = wrist + (wrist - elbow).normalize() * (0.5e-3 * sizes.hand_length_mm);

        let [breadth, height, thickness] = FOLD;
        let fold = at(
            breadth * 0.5e-3 * self.parameters.breadth_mm,
            height * self.notch_m(),
        );
        vec![
            self.piece(side, "upper", [shoulder, elbow], upper_m),
            self.piece(side, "forearm", [elbow, hand], fore_m),
            self.piece(side, "axilla", [shoulder, fold], thickness * upper_m),
        ]
    }

    fn piece(&self, side: &str, name: &str, ends: [Point3<f64>; 2], radius_m: f64) -> PhantomPart {
        let lie = |end: Point3<f64>| {
            let resting = self.support.rest(end, radius_m);
            self.support.lift(resting, radius_m)
        };
        let organ = format!("arm_{side}");
        part(format!("{organ}.{name}"), &organ, ends.map(lie), radius_m)
    }
}

/// A right triangle's other side: of a bone of some length, how far it leads along the body.
fn other_side(length_m: f64, across_m: f64) -> f64 {
    (length_m * length_m - across_m * across_m).max(0.0).sqrt()
}

fn part(name: String, organ: &str, ends: [Point3<f64>; 2], radius_m: f64) -> PhantomPart {
    let [from, to] = ends;
    let solid: Solid = capsule(name.clone(), from, to, radius_m);
    PhantomPart {
        name,
        tissue: Tissue::Skin,
        organ: Some(organ.to_owned()),
        solid,
        color_rgba: SKIN_RGBA,
    }
}
