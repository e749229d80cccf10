//! A beam element on an elastic foundation, by Hermite's cubics.

/// Displacement and slope of a node, or the force and moment that go with them.
pub(crate) type Pair = [f64; 2];

/// A symmetric matrix of those: its entries 11, 12 and 22.
pub(crate) type Symmetric = [f64; 3];

/// An element by where its second node is, u, and how far it is bent, e: beyond p, where its first node would take that
/// one if it were rigid.
///
/// Its energy is `u' rest u / 2 - u' mixed e + e' bend e / 2`. In short elements `bend` is larger than all else by
/// orders of magnitude, which would cancel in the displacements of both nodes: by 1e-4 of a tip's place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Element {
    pub length_m: f64,
    /// Stiffness of the beam, and of the foundation.
    pub bend: Symmetric,
    /// Of the foundation, column by column.
    pub mixed: [Pair; 2],
    /// Of the foundation, where nothing bends.
    pub rest: Symmetric,
    /// What the foundation on a path exerts, by the path's displacement at the first and at the second node; a straight
    /// line between them.
    pub by_path: [Loads; 2],
}

/// Loads of an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loads {
    /// On u, where nothing bends.
    pub whole: Pair,
    /// On p, where u is held.
    pub first: Pair,
}

impl Element {
    /// Of a length, m, a bending stiffness, N m2, and a foundation, N/m2 (consistent: integrated with the same cubics).
    pub fn new(length_m: f64, bending_nm2: f64, stiffness_n_m2: f64) -> Self {
        let h = length_m;
        let beam = bending_nm2 / (h * h * h);
        let all = stiffness_n_m2 * h;
        let part = all / 420.0;
        let of = |whole: Pair, first: Pair| Loads {
            whole: [all * whole[0], all * h * whole[1]],
            first: [all * first[0], all * h * first[1]],
        };
        Self {
            length_m,
            bend: [
                12.0 * beam + 156.0 * part,
                (-6.0 * beam - 134.0 * part) * h,
                (4.0 * beam + 116.0 * part) * (h * h),
            ],
            mixed: [
                [210.0 * part, -147.0 * part * h],
                [-175.0 * part * h, 126.0 * part * (h * h)],
            ],
            rest: [420.0 * part, -210.0 * part * h, 140.0 * part * (h * h)],
            by_path: [
                of([0.5, -1.0 / 3.0], [0.35, -0.3]),
                of([0.5, -1.0 / 6.0], [0.15, -7.0 / 60.0]),
            ],
        }
    }
}
