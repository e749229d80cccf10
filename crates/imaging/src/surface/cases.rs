//! Which edges of a cell its sheets of surface cross, for each of the 256 ways in which corners are inside.

use std::sync::OnceLock;

/// Corners count x, y, z from the lowest bit. An edge runs along an axis from a corner: `axis * 4 + u + 2 v`, with u and
/// v the corner's places along the next two axes.
pub(crate) const EDGES: usize = 12;

/// No sheet crosses an edge.
pub(crate) const NO_SHEET: u8 = u8::MAX;

/// The sheets of a cell.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// The sheet that crosses each edge.
    pub sheet_of_edge: [u8; EDGES],
    /// How many there are: four at most.
    pub sheets: u8,
}

/// The corners at the lower and the upper end of an edge.
pub fn ends(edge: usize) -> [usize; 2] {
    let axis = edge / 4;
    let [u, v] = [edge & 1, edge >> 1 & 1];
    let low = u << ((axis + 1) % 3) | v << ((axis + 2) % 3);
    [low, low | 1 << axis]
}

/// The edge between two corners that differ along one axis.
fn edge_between(a: usize, b: usize) -> usize {
    let axis = (a ^ b).trailing_zeros() as usize;
    let low = a & b;
    axis * 4 + (low >> ((axis + 1) % 3) & 1) + 2 * (low >> ((axis + 2) % 3) & 1)
}

/// Corners around the face on one side of an axis, counter-clockwise seen along the axis from its end.
fn face_corners(axis: usize, side: usize) -> [usize; 4] {
    let [u, v] = [1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3)];
    let base = side << axis;
    [base, base | u, base | u | v, base | v]
}

/// On a face whose corners are inside across a diagonal only, the pairs of edges that one sheet each crosses: those
/// beside either corner inside. Both cells at the face see the same. None for other faces.
pub(crate) fn pairs_on_face(
    corners_inside: u8,
    axis: usize,
    side: usize,
) -> Option<[[usize; 2]; 2]> {
    let corners = face_corners(axis, side);
    let inside = corners.map(|corner| corners_inside >> corner & 1 == 1);
    let first = match inside {
        [true, false, true, false] => 0,
        [false, true, false, true] => 1,
        _ => return None,
    };
    Some(
        [first, first + 2]
            .map(|at| [at + 3, at + 1].map(|other| edge_between(corners[at], corners[other % 4]))),
    )
}

/// The sheets for corners that are inside, a bit each.
pub fn case(corners_inside: u8) -> &'static Case {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    &CASES.get_or_init(|| (0..=u8::MAX).map(sheets).collect())[usize::from(corners_inside)]
}

fn sheets(corners_inside: u8) -> Case {
    let is_inside = |corner: usize| corners_inside >> corner & 1 == 1;
    let crossed = |edge: usize| {
        let [a, b] = ends(edge);
        is_inside(a) != is_inside(b)
    };
    // Edges of one sheet get one number: the least of them.
    let mut group: [usize; EDGES] = std::array::from_fn(|edge| edge);
    let mut join = |a: usize, b: usize| {
        let [from, to] = [group[a].max(group[b]), group[a].min(group[b])];
        for each in &mut group {
            if *each == from {
                *each = to;
            }
        }
    };
    for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
        if let Some(pairs) = pairs_on_face(corners_inside, axis, side) {
            for [a, b] in pairs {
                join(a, b);
            }
            continue;
        }
        let corners = face_corners(axis, side);
        let edges = [0, 1, 2, 3].map(|at| edge_between(corners[at], corners[(at + 1) % 4]));
        let mut on_face = edges.into_iter().filter(|&edge| crossed(edge));
        if let (Some(a), Some(b)) = (on_face.next(), on_face.next()) {
            join(a, b);
        }
    }
    let mut sheet_of_edge = [NO_SHEET; EDGES];
    let mut sheets = 0;
    for edge in (0..EDGES).filter(|&edge| crossed(edge)) {
        if group[edge] == edge {
            sheet_of_edge[edge] = sheets;
            sheets += 1;
        } else {
            sheet_of_edge[edge] = sheet_of_edge[group[edge]];
        }
    }
    Case {
        sheet_of_edge,
        sheets,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_crossed_edge_has_a_sheet_and_others_have_none() {
        let mut most = 0;
        for corners in 0..=u8::MAX {
            let case = case(corners);
            for edge in 0..EDGES {
                let [a, b] = ends(edge).map(|corner| corners >> corner & 1);
                assert_eq!(case.sheet_of_edge[edge] != NO_SHEET, a != b);
                assert!(a == b || case.sheet_of_edge[edge] < case.sheets);
            }
            // A sheet is bounded by three edges at least.
            for sheet in 0..case.sheets {
                let edges = case.sheet_of_edge.iter().filter(|&&each| each == sheet);
                assert!(edges.count() >= 3);
            }
            most = most.max(case.sheets);
        }
        assert_eq!(most, 4);
        assert_eq!(case(0b0000_0001).sheets, 1);
        // Corners across the cell's diagonal.
        assert_eq!(case(0b1000_0001).sheets, 2);
    }

    #[test]
    fn edges_and_their_ends_name_each_other() {
        for edge in 0..EDGES {
            let [low, high] = ends(edge);
            assert_eq!(edge_between(low, high), edge);
            assert_eq!((low ^ high).count_ones(), 1);
        }
    }
}
