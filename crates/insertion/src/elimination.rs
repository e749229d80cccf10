//! The needle from its holder to a node, put together into what the next element feels.

use crate::element::{Element, Pair, Symmetric};

/// What is before a node, without the loads of the path: `stiffness * u = right`.
///
/// The path behind the tip is frozen, so this never changes once the tip has passed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Elimination {
    pub stiffness: Symmetric,
    /// By the node's displacement, and by its slope: the force that holds the exit, and the slope there. The same are
    /// what a displacement at the exit, reversed, and a moment there load the node with (Maxwell and Betti).
    columns: [Pair; 2],
    /// By a displacement of 1 m and by a moment of 1 N m at the exit: force and slope there, with the node held.
    held: [Pair; 2],
}

/// What the path and the tip load a node with, in one plane, and force and slope at the exit with the node held.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Load {
    pub right: Pair,
    pub exit: Pair,
}

/// What is before a node, with loads in some planes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reached<const PLANES: usize> {
    pub before: Elimination,
    pub loads: [Load; PLANES],
}

/// The same before anything is known of the path at that node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Open<const PLANES: usize> {
    pub before: Elimination,
    pub loads: [Load; PLANES],
    /// By the path's displacement there.
    pub by_path: Load,
}

/// A further element, eliminated.
struct Passed {
    after: Elimination,
    /// How force and moment on the first node load the second one less than if the element were rigid.
    through: [Pair; 2],
    /// What they do at the exit.
    columns: [Pair; 2],
}

/// Columns by what they are of.
#[inline(always)]
fn sum(columns: [Pair; 2], of: Pair) -> Pair {
    [0, 1].map(|at| columns[0][at] * of[0] + columns[1][at] * of[1])
}

#[inline(always)]
fn plus(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

#[inline(always)]
fn less(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

/// The inverse, and what it is to be multiplied by.
fn adjoint([a, b, c]: Symmetric) -> (Symmetric, f64) {
    ([c, -b, a], 1.0 / (a * c - b * b))
}

fn inverse(matrix: Symmetric) -> Symmetric {
    let (adjoint, scale) = adjoint(matrix);
    adjoint.map(|each| each * scale)
}

fn times([a, b, c]: Symmetric, x: Pair) -> Pair {
    [a * x[0] + b * x[1], b * x[0] + c * x[1]]
}

/// What acts on a node, where a rigid element of a length takes it.
fn moved(right: Pair, length_m: f64) -> Pair {
    [right[0], right[1] - length_m * right[0]]
}

impl Elimination {
    /// Behind the first element, with the loads by the path's displacement at both its nodes.
    fn first(element: &Element, rotation_nm: Option<f64>) -> (Self, [Load; 2]) {
        let Element {
            bend: [b11, b12, b22],
            mixed: [[m11, m21], [m12, m22]],
            rest,
            length_m: h,
            ..
        } = *element;
        // By u, and by p and u.
        let both = [[b11 - m11, b12 - m21], [b12 - m12, b22 - m22]];
        let own = [
            both[0][0] - m11 + rest[0],
            both[0][1] - m12 + rest[1],
            both[1][1] - m22 + rest[2],
        ];
        // The exit moves p by (1, 0), its slope by (h, 1).
        let [exit, across] = [both[0], [0, 1].map(|at| h * both[0][at] + both[1][at])];
        let coupling = h * b11 + b12;
        let rotation = h * coupling + h * b12 + b22;
        // The slope alone is eliminated; a clamp has none.
        let flexible = rotation_nm.map_or(0.0, |rotation_nm| 1.0 / (rotation_nm + rotation));
        let by_moment = across.map(|each| each * flexible);
        let by_exit = [0, 1].map(|at| exit[at] - coupling * by_moment[at]);
        let loads = element.by_path.map(|loads| {
            let turned = h * loads.first[0] + loads.first[1];
            Load {
                right: [0, 1].map(|at| loads.whole[at] - loads.first[at] + by_moment[at] * turned),
                exit: [
                    coupling * flexible * turned - loads.first[0],
                    flexible * turned,
                ],
            }
        });
        let before = Self {
            stiffness: [
                own[0] - across[0] * by_moment[0],
                own[1] - across[0] * by_moment[1],
                own[2] - across[1] * by_moment[1],
            ],
            columns: [[-by_exit[0], by_moment[0]], [-by_exit[1], by_moment[1]]],
            held: [
                [b11 - coupling * coupling * flexible, -flexible * coupling],
                [flexible * coupling, flexible],
            ],
        };
        (before, loads)
    }

    #[inline(always)]
    fn moved(&self, element: &Element) -> Symmetric {
        let ([a, b, c], h) = (self.stiffness, element.length_m);
        [a, b - h * a, c + (h * h * a - (h + h) * b)]
    }

    /// Behind a further element.
    #[inline(always)]
    fn next(&self, element: &Element) -> Passed {
        let s = self.moved(element);
        // One step waits for the other by the stiffness alone: its products are made beside the division.
        let ([a, b, c], scale) = adjoint([0, 1, 2].map(|at| s[at] + element.bend[at]));
        let bend = [a * scale, b * scale, c * scale];
        let near = [[s[0], s[1]], [s[1], s[2]]];
        let near = [0, 1].map(|of| plus(near[of], element.mixed[of]));
        let products = [[a, b], [b, c]].map(|row| sum(near, row));
        let through = products.map(|column| column.map(|each| each * scale));
        let [force, moment] = self.columns;
        let moment = [0, 1].map(|of| moment[of] - element.length_m * force[of]);
        let moved = [force, moment];
        let columns = [[bend[0], bend[1]], [bend[1], bend[2]]].map(|row| sum(moved, row));
        let [by_exit, by_moment] = [0, 1].map(|of| sum(columns, [force[of], moment[of]]));
        let whole = [s[0] + element.rest[0], s[1] + element.rest[1]];
        let bent = sum(near, [products[0][0], products[1][0]]);
        let turned = products[0][1] * near[0][1] + products[1][1] * near[1][1];
        let after = Self {
            stiffness: [
                whole[0] - bent[0] * scale,
                whole[1] - bent[1] * scale,
                s[2] + element.rest[2] - turned * scale,
            ],
            columns: [0, 1].map(|at| less(moved[at], sum(moved, [through[0][at], through[1][at]]))),
            held: [less(self.held[0], by_exit), plus(self.held[1], by_moment)],
        };
        Passed {
            after,
            through,
            columns,
        }
    }

    /// With a displacement and a moment at the exit beside a load.
    #[inline(always)]
    pub fn seated(&self, load: &Load, [exit_m, moment_nm]: Pair) -> Load {
        let by = |column: Pair| column[1] * moment_nm - column[0] * exit_m;
        Load {
            right: plus(load.right, self.columns.map(by)),
            exit: plus(load.exit, sum(self.held, [exit_m, moment_nm])),
        }
    }

    /// Force and slope at the exit with the node somewhere.
    #[inline(always)]
    pub fn at_exit(&self, load: &Load, u: Pair) -> Pair {
        plus(load.exit, sum(self.columns, u))
    }

    /// Where the node is under a load.
    pub fn under(&self, right: Pair) -> Pair {
        times(inverse(self.stiffness), right)
    }

    /// Where the node before an element is, by that behind it and what loads the former; `path` is that at both.
    pub fn back(&self, element: &Element, right: Pair, path: [f64; 2], behind: Pair) -> Pair {
        let s = self.moved(element);
        let bend = inverse([0, 1, 2].map(|at| s[at] + element.bend[at]));
        let near = [[s[0], s[1]], [s[1], s[2]]];
        let near = [0, 1].map(|of| plus(near[of], element.mixed[of]));
        let right = moved(right, element.length_m);
        let load = plus(right, sum(element.by_path.map(|loads| loads.first), path));
        let pull = [0, 1].map(|at| near[at][0] * behind[0] + near[at][1] * behind[1] - load[at]);
        let bent = times(bend, pull);
        let [place, slope] = [0, 1].map(|at| behind[at] - bent[at]);
        [place - element.length_m * slope, slope]
    }
}

impl<const PLANES: usize> Reached<PLANES> {
    /// Behind a further element, by the path's displacements at its first node, m.
    #[inline(always)]
    pub fn next(&self, element: &Element, path_m: [f64; PLANES]) -> Open<PLANES> {
        let passed = self.before.next(element);
        Open {
            loads: std::array::from_fn(|plane| {
                passed.load(element, &self.loads[plane], path_m[plane])
            }),
            by_path: passed.by_path(element),
            before: passed.after,
        }
    }
}

impl<const PLANES: usize> Open<PLANES> {
    /// Behind the first element, whose first node has the exit's displacement and a spring against rotation, N m; a
    /// clamp without one.
    pub fn first(element: &Element, rotation_nm: Option<f64>, path_m: [f64; PLANES]) -> Self {
        let (before, [first, by_path]) = Elimination::first(element, rotation_nm);
        Self {
            before,
            loads: path_m.map(|path_m| Load::default().closed(&first, path_m)),
            by_path,
        }
    }

    /// With the path at the node.
    #[inline(always)]
    pub fn closed(&self, path_m: [f64; PLANES]) -> Reached<PLANES> {
        Reached {
            before: self.before,
            loads: std::array::from_fn(|plane| {
                self.loads[plane].closed(&self.by_path, path_m[plane])
            }),
        }
    }
}

impl Passed {
    /// What of a load before the element, and of the path at its first node, comes through it.
    #[inline(always)]
    fn load(&self, element: &Element, before: &Load, path_m: f64) -> Load {
        let right = moved(before.right, element.length_m);
        let loads = &element.by_path[0];
        let [whole, first] =
            [loads.whole, loads.first].map(|by| [0, 1].map(|at| right[at] + by[at] * path_m));
        self.through(whole, first, before)
    }

    /// The same of a path of 1 m at its second node.
    #[inline(always)]
    fn by_path(&self, element: &Element) -> Load {
        let loads = &element.by_path[1];
        self.through(loads.whole, loads.first, &Load::default())
    }

    #[inline(always)]
    fn through(&self, whole: Pair, first: Pair, before: &Load) -> Load {
        Load {
            right: less(whole, sum(self.through, first)),
            exit: plus(before.exit, sum(self.columns, first)),
        }
    }
}

impl Load {
    fn closed(&self, by_path: &Self, path_m: f64) -> Self {
        Self {
            right: [0, 1].map(|at| self.right[at] + by_path.right[at] * path_m),
            exit: [0, 1].map(|at| self.exit[at] + by_path.exit[at] * path_m),
        }
    }

    /// With a force across the node, N.
    pub fn pushed(&self, force_n: f64) -> Self {
        Self {
            right: [self.right[0] + force_n, self.right[1]],
            ..*self
        }
    }
}

/// The tip at a node, where the path goes through it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tip {
    before: Elimination,
    by_path: Load,
    /// Its displacement by force and moment.
    place: Pair,
    by_moment: f64,
}

impl Tip {
    #[inline(always)]
    pub fn new<const PLANES: usize>(open: &Open<PLANES>) -> Self {
        let Open {
            before, by_path, ..
        } = *open;
        let [a, b, c] = before.stiffness;
        // The path at the tip is the tip's own displacement.
        let [force, moment] = by_path.right;
        let scale = 1.0 / ((a - force) * c - (b - moment) * b);
        Self {
            before,
            by_path,
            place: [c * scale, -b * scale],
            by_moment: 1.0 / c,
        }
    }

    /// Displacement of the tip, m, and force and slope at the exit, under a load, a force across the tip, N, and a
    /// displacement, m, and a moment, N m, at the exit.
    #[inline(always)]
    pub fn answer(&self, load: &Load, force_n: f64, exit: Pair) -> (f64, Pair) {
        let without = Load::default().pushed(force_n);
        let acting = self.before.seated(&without, exit);
        let [force, moment] = plus(load.right, acting.right);
        let tip_m = self.place[0] * force + self.place[1] * moment;
        let [_, b, _] = self.before.stiffness;
        let slope = (moment + (self.by_path.right[1] - b) * tip_m) * self.by_moment;
        let load = Load {
            right: [force, moment],
            exit: plus(load.exit, acting.exit),
        };
        let load = load.closed(&self.by_path, tip_m);
        (tip_m, self.before.at_exit(&load, [tip_m, slope]))
    }
}
