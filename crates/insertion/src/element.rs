//! A beam element on an elastic foundation, by Hermite's cubics.

use nalgebra::{Matrix2, Vector2};

/// Stiffness of an element between two nodes with a displacement and a slope each, in blocks by node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Element {
    pub k11: Matrix2<f64>,
    pub k12: Matrix2<f64>,
    pub k22: Matrix2<f64>,
    length_m: f64,
    stiffness_n_m2: f64,
}

impl Element {
    /// Of a length, m, a bending stiffness, N m2, and a foundation, N/m2 (consistent: integrated with the same cubics).
    pub fn new(length_m: f64, bending_nm2: f64, stiffness_n_m2: f64) -> Self {
        let h = length_m;
        let beam = bending_nm2 / (h * h * h);
        let rest = stiffness_n_m2 * h / 420.0;
        let block = |b: [f64; 4], r: [f64; 4]| {
            let scale = [1.0, h, h, h * h];
            let [a, b, c, d] = [0, 1, 2, 3].map(|at| (beam * b[at] + rest * r[at]) * scale[at]);
            Matrix2::new(a, b, c, d)
        };
        Self {
            k11: block([12.0, 6.0, 6.0, 4.0], [156.0, 22.0, 22.0, 4.0]),
            k12: block([-12.0, 6.0, -6.0, 2.0], [54.0, -13.0, 13.0, -3.0]),
            k22: block([12.0, -6.0, -6.0, 4.0], [156.0, -22.0, -22.0, 4.0]),
            length_m,
            stiffness_n_m2,
        }
    }

    /// What a foundation at rest on a path exerts on both nodes, by the path's displacement at the first and at the
    /// second: a straight line between them.
    pub fn loads(&self) -> [[Vector2<f64>; 2]; 2] {
        let h = self.length_m;
        let all = self.stiffness_n_m2 * h;
        let of =
            |force: f64, moment: f64| Vector2::new(all * force / 20.0, all * h * moment / 60.0);
        [[of(7.0, 3.0), of(3.0, -2.0)], [of(3.0, 2.0), of(7.0, -3.0)]]
    }
}
