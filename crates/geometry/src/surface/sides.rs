//! What a search sees of its two sides: a convex core or the boxes of a surface, and the boxes
//! of the other surface.

use nalgebra::Vector3;

use crate::bounds::BoundingCapsule;
use crate::convex::{ConvexCore, Difference};
use crate::placement::Placement;
use crate::prepared::PreparedShape;
use crate::tree::{Parts, TriangleTree};

/// The side that moves.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Mover<'s> {
    /// A convex core and the axis of a capsule around it, in the core's frame.
    Convex {
        core: &'s ConvexCore,
        bound: BoundingCapsule,
    },
    /// A surface.
    Surface(&'s TriangleTree),
}

impl<'s> Mover<'s> {
    pub fn new(shape: &'s PreparedShape) -> Self {
        match &shape.core {
            ConvexCore::SurfaceHull(tree) => Self::Surface(tree),
            core => Self::Convex {
                core,
                bound: shape.bound,
            },
        }
    }
}

/// A box of each side; a convex core is box 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Boxes {
    pub a: u32,
    pub b: u32,
}

/// Both sides, placed, in the frame of B.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sides<'s> {
    pub a: Mover<'s>,
    pub b: &'s TriangleTree,
    /// The hulls of the two.
    pub hulls: [&'s ConvexCore; 2],
    pub b_from_a: Placement,
    /// A stands for all that it covers on a straight way along this vector, m.
    pub sweep: Vector3<f64>,
}

/// The smallest pieces that boxes are made of.
pub(crate) enum Step<'s> {
    Boxes([Boxes; 2]),
    /// Cores of A with triangles of B.
    Leaves(&'s [[Vector3<f64>; 3]], &'s [[Vector3<f64>; 3]]),
}

/// Vertex of a convex core found last; it only saves time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hint(pub usize);

pub(crate) const ROOTS: Boxes = Boxes { a: 0, b: 0 };

impl<'s> Sides<'s> {
    pub fn moved(&self, way: &Vector3<f64>) -> Self {
        let mut moved = *self;
        moved.b_from_a.translation += way;
        moved
    }

    /// Middle of what encloses A.
    pub(crate) fn centre_a(&self) -> Vector3<f64> {
        self.b_from_a.point(&match &self.a {
            Mover::Convex { bound, .. } => bound.centre,
            Mover::Surface(tree) => tree.root().centre,
        })
    }

    pub fn swept(&self, way: &Vector3<f64>) -> Self {
        Self {
            sweep: *way,
            ..*self
        }
    }

    /// Largest `direction . x` of a box of A.
    #[inline]
    pub fn high_a(&self, part: u32, direction: &Vector3<f64>, hint: &mut Hint) -> f64 {
        let in_a = self.b_from_a.rotation.tr_mul(direction);
        let local = match &self.a {
            Mover::Convex { core, .. } => in_a.dot(&core.support(&in_a, &mut hint.0)),
            Mover::Surface(tree) => tree.block(part).high(&in_a),
        };
        local + direction.dot(&self.b_from_a.translation) + direction.dot(&self.sweep).max(0.0)
    }

    /// A point of the box of A, or one nearby, from which to look at the box of B.
    #[inline]
    fn view_point(&self, boxes: Boxes) -> Vector3<f64> {
        let towards = self.b.block(boxes.b).centre;
        let mut from = match &self.a {
            Mover::Convex { bound, .. } => {
                let centre = self.b_from_a.point(&bound.centre);
                let axis = self.b_from_a.rotation * bound.half_axis;
                let length_squared = axis.norm_squared();
                if length_squared > 0.0 {
                    let along = (towards - centre).dot(&axis) / length_squared;
                    centre + axis * along.clamp(-1.0, 1.0)
                } else {
                    centre
                }
            }
            Mover::Surface(tree) => self.b_from_a.point(&tree.block(boxes.a).centre),
        };
        let length_squared = self.sweep.norm_squared();
        if length_squared > 0.0 {
            let along = (towards - from).dot(&self.sweep) / length_squared;
            from += self.sweep * along.clamp(0.0, 1.0);
        }
        from
    }

    /// Unit vector from a box of A to the nearest point of a box of B, unless they overlap there.
    #[inline]
    pub fn direction(&self, boxes: Boxes) -> Option<Vector3<f64>> {
        let from = self.view_point(boxes);
        (self.b.block(boxes.b).nearest(&from) - from).try_normalize(0.0)
    }

    /// How far a plane across `direction` keeps the boxes apart: a lower bound of the distance.
    #[inline]
    pub fn gap_m(&self, boxes: Boxes, direction: &Vector3<f64>, hint: &mut Hint) -> f64 {
        self.b.block(boxes.b).low(direction) - self.high_a(boxes.a, direction, hint)
    }

    /// The larger box in two, or what is left in boxes that have no parts.
    pub fn open(&self, boxes: Boxes) -> Step<'s> {
        let b = self.b.parts(boxes.b);
        match (&self.a, b) {
            (Mover::Convex { .. }, Parts::Boxes(parts)) => {
                Step::Boxes(parts.map(|b| Boxes { b, ..boxes }))
            }
            (Mover::Convex { .. }, Parts::Triangles(triangles)) => Step::Leaves(&[], triangles),
            (Mover::Surface(tree), b) => match (tree.parts(boxes.a), b) {
                (Parts::Triangles(one), Parts::Triangles(other)) => Step::Leaves(one, other),
                (Parts::Boxes(parts), Parts::Boxes(others)) => {
                    let a_m = tree.block(boxes.a).radius_m();
                    if a_m > self.b.block(boxes.b).radius_m() {
                        Step::Boxes(parts.map(|a| Boxes { a, ..boxes }))
                    } else {
                        Step::Boxes(others.map(|b| Boxes { b, ..boxes }))
                    }
                }
                (Parts::Boxes(parts), Parts::Triangles(_)) => {
                    Step::Boxes(parts.map(|a| Boxes { a, ..boxes }))
                }
                (Parts::Triangles(_), Parts::Boxes(parts)) => {
                    Step::Boxes(parts.map(|b| Boxes { b, ..boxes }))
                }
            },
        }
    }

    /// Calls `visit` with the convex pieces of A among the leaves, each against each triangle of
    /// B, until it returns false.
    pub(crate) fn each_pair(
        &self,
        ones: &[[Vector3<f64>; 3]],
        others: &[[Vector3<f64>; 3]],
        mut visit: impl FnMut(&ConvexCore, &ConvexCore) -> bool,
    ) -> bool {
        let mut against = |core: &ConvexCore| {
            others
                .iter()
                .all(|other| visit(core, &ConvexCore::Triangle(*other)))
        };
        match &self.a {
            Mover::Convex { core, .. } => against(core),
            Mover::Surface(_) => ones.iter().all(|one| against(&ConvexCore::Triangle(*one))),
        }
    }

    pub fn difference<'c>(
        &self,
        a: &'c ConvexCore,
        b: &'c ConvexCore,
        hint: Hint,
    ) -> Difference<'c> {
        Difference::new(a, b, self.b_from_a)
            .swept(self.sweep)
            .with_hint(hint.0)
    }
}
