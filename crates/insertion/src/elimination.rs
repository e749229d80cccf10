//! The needle from its holder to a node, put together into what the next element feels.

use nalgebra::{Matrix2, Matrix2x4, RowVector4, Vector2};

use crate::element::Element;

/// Right sides: the two planes lateral to the needle, a displacement of 1 m at the exit, a moment of 1 N m there.
pub(crate) const EXIT: usize = 2;
pub(crate) const MOMENT: usize = 3;

/// Displacements of a path in the two planes, m.
pub(crate) type Across = [f64; 2];

/// What is before a node: `stiffness * u = right`, and at the exit `exit + turn * u`: the slope, and the force that holds it.
///
/// The path behind the tip is frozen, so this never changes once the tip has passed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Elimination {
    pub stiffness: Matrix2<f64>,
    pub right: Matrix2x4<f64>,
    pub exit: Matrix2x4<f64>,
    pub turn: Matrix2<f64>,
}

/// The tip at a node, before anything is known of the path there and of the force.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tip {
    before: Elimination,
    /// By the path's displacement at the tip.
    by_path: Vector2<f64>,
    exit_by_path: Vector2<f64>,
}

impl Elimination {
    /// Behind the first element, whose first node has the exit's displacement and a spring against rotation, N m; a clamp
    /// without one.
    pub fn first(element: &Element, rotation_nm: Option<f64>, path: [Across; 2]) -> Self {
        let (before, by_path) = Self::first_open(element, rotation_nm, path[0]);
        before.closed(&by_path, path[1])
    }

    fn first_open(element: &Element, rotation_nm: Option<f64>, path: Across) -> (Self, Open) {
        let Element { k11, k12, k22, .. } = *element;
        let [of_first, of_second] = element.loads();
        let plane = |load: Vector2<f64>| {
            Matrix2x4::new(
                load.x * path[0],
                load.x * path[1],
                0.0,
                0.0,
                load.y * path[0],
                load.y * path[1],
                0.0,
                0.0,
            )
        };
        let [mut near, mut far] = of_first.map(plane);
        // A displacement at the exit loads what is beside it.
        near.column_mut(EXIT).copy_from(&(-k11.column(0)));
        far.column_mut(EXIT).copy_from(&(-k12.row(0).transpose()));
        near[(1, MOMENT)] = 1.0;
        // The slope alone is eliminated; a clamp has none.
        let flexible = rotation_nm.map_or(0.0, |rotation_nm| 1.0 / (rotation_nm + k11[(1, 1)]));
        let across = k12.row(1).transpose();
        let slope = near.row(1) * flexible;
        let turn = -across.transpose() * flexible;
        let coupling = k11[(0, 1)];
        let slope_by_path = flexible * of_second[0].y;
        let before = Self {
            stiffness: k22 - across * across.transpose() * flexible,
            right: far - across * slope,
            exit: Matrix2x4::from_rows(&[slope, slope * coupling - near.row(0)]),
            turn: Matrix2::from_rows(&[turn, turn * coupling + k12.row(0)]),
        };
        let by_path = Open {
            right: of_second[1] - across * slope_by_path,
            exit: Vector2::new(slope_by_path, coupling * slope_by_path - of_second[0].x),
        };
        (before, by_path)
    }

    /// Behind a further element.
    pub fn next(&self, element: &Element, path: [Across; 2]) -> Self {
        let (before, by_path) = self.open(element, path[0]);
        before.closed(&by_path, path[1])
    }

    /// With a tip behind a further element.
    pub fn tip(&self, element: &Element, path: Across) -> Tip {
        let (before, by_path) = self.open(element, path);
        Tip {
            before,
            by_path: by_path.right,
            exit_by_path: by_path.exit,
        }
    }

    /// With a tip behind the first element.
    pub fn first_tip(element: &Element, rotation_nm: Option<f64>, path: Across) -> Tip {
        let (before, by_path) = Self::first_open(element, rotation_nm, path);
        Tip {
            before,
            by_path: by_path.right,
            exit_by_path: by_path.exit,
        }
    }

    fn open(&self, element: &Element, path: Across) -> (Self, Open) {
        let Element { k11, k12, k22, .. } = *element;
        let [of_first, of_second] = element.loads();
        let inverse = inverse(&(self.stiffness + k11));
        let back = k12.transpose() * inverse;
        let mut near = self.right;
        let mut far = Matrix2x4::zeros();
        for (plane, &displacement) in path.iter().enumerate() {
            let [first, second] = of_first.map(|load| load * displacement);
            near.column_mut(plane).axpy(1.0, &first, 1.0);
            far.column_mut(plane).copy_from(&second);
        }
        let lean = self.turn * inverse;
        let before = Self {
            stiffness: k22 - back * k12,
            right: far - back * near,
            exit: self.exit + lean * near,
            turn: -(lean * k12),
        };
        let by_path = Open {
            right: of_second[1] - back * of_second[0],
            exit: lean * of_second[0],
        };
        (before, by_path)
    }

    fn closed(mut self, open: &Open, path: Across) -> Self {
        for (plane, &displacement) in path.iter().enumerate() {
            self.right
                .column_mut(plane)
                .axpy(displacement, &open.right, 1.0);
            self.exit
                .column_mut(plane)
                .axpy(displacement, &open.exit, 1.0);
        }
        self
    }

    /// Displacement and slope at the node before an element, by those behind it: `(constant, by what is behind)`.
    pub fn back(&self, element: &Element, path: [Across; 2]) -> (Matrix2x4<f64>, Matrix2<f64>) {
        let inverse = inverse(&(self.stiffness + element.k11));
        let [of_first, of_second] = element.loads();
        let mut near = self.right;
        for (plane, (first, second)) in path[0].into_iter().zip(path[1]).enumerate() {
            let load = of_first[0] * first + of_second[0] * second;
            near.column_mut(plane).axpy(1.0, &load, 1.0);
        }
        (inverse * near, -(inverse * element.k12))
    }
}

/// What a displacement of the path at the second node of an element adds.
struct Open {
    right: Vector2<f64>,
    exit: Vector2<f64>,
}

impl Tip {
    /// Displacement of the tip by each right side, and slope and force at the exit, where the path goes through the tip;
    /// `force` in both planes, N.
    pub fn answers(&self, force: Across) -> (RowVector4<f64>, Matrix2x4<f64>) {
        let inverse = inverse(&self.before.stiffness);
        let mut right = self.before.right;
        for (plane, &force) in force.iter().enumerate() {
            right[(0, plane)] += force;
        }
        let without = inverse * right;
        let by_path = inverse * self.by_path;
        // The path at the tip is the tip's own displacement.
        let displacement = without.row(0) / (1.0 - by_path.x);
        let all = without + by_path * displacement;
        let exit = self.before.exit + self.before.turn * all + self.exit_by_path * displacement;
        (displacement, exit)
    }

    /// What is before the tip's node once its displacement is known.
    pub fn closed(&self, path: Across) -> Elimination {
        let open = Open {
            right: self.by_path,
            exit: self.exit_by_path,
        };
        self.before.closed(&open, path)
    }
}

/// Of a positive definite matrix.
fn inverse(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    let [a, b, c, d] = [matrix.m11, matrix.m12, matrix.m21, matrix.m22];
    Matrix2::new(d, -b, -c, a) / (a * d - b * c)
}
