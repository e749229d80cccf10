//! How the axes of a grid lie in the patient.

use nalgebra::{Matrix3, Vector3};

use crate::VoxelGrid;

/// To which side of the patient i, j and k run: three letters of L, R (left, right), P, A (posterior, anterior),
/// S, I (to the head, to the feet), one of each pair.
///
/// ```
/// use needlebench_volume::Orientation;
///
/// let orientation: Orientation = "RAS".parse()?;
/// assert_eq!(orientation.to_string(), "RAS");
/// assert_eq!(orientation.axes(), [(0, -1.0), (1, -1.0), (2, 1.0)]);
/// assert!("RLS".parse::<Orientation>().is_err());
/// # Ok::<(), needlebench_volume::NoOrientation>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orientation([(usize, f64); 3]);

/// Three letters that are no orientation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "three letters are required, one of L and R, one of P and A, one of S and I: LPS, RAS, LAS, \
     ...; not '{0}'"
)]
pub struct NoOrientation(String);

/// By axis of `ct`: the letters of its positive and negative direction.
const LETTERS: [[char; 2]; 3] = [['L', 'R'], ['P', 'A'], ['S', 'I']];

/// Every order of three axes, that of the axes themselves first.
pub(crate) const PERMUTATIONS: [[usize; 3]; 6] = [
    [0, 1, 2],
    [1, 0, 2],
    [0, 2, 1],
    [2, 1, 0],
    [1, 2, 0],
    [2, 0, 1],
];

impl Orientation {
    /// Of i, j and k: the axis of `ct` along which it runs most, and 1 or -1 for its direction.
    pub fn axes(&self) -> [(usize, f64); 3] {
        self.0
    }

    /// The one that a grid comes nearest to. Each axis of `ct` is taken once.
    pub fn of(grid: &VoxelGrid) -> Self {
        let steps = grid.steps_m();
        let units = Matrix3::from_columns(&[0, 1, 2].map(|axis| {
            let step: Vector3<f64> = steps.column(axis).into_owned();
            step / step.norm()
        }));
        let along =
            |rows: &[usize; 3]| -> f64 { (0..3).map(|axis| units[(rows[axis], axis)].abs()).sum() };
        let mut best = PERMUTATIONS[0];
        for rows in PERMUTATIONS {
            // Of equals the first stays, up to rounding.
            if along(&rows) > along(&best) + 1e-9 {
                best = rows;
            }
        }
        Self([0, 1, 2].map(|axis| (best[axis], units[(best[axis], axis)].signum())))
    }
}

impl std::str::FromStr for Orientation {
    type Err = NoOrientation;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = || NoOrientation(text.chars().take(12).collect());
        let mut axes = [(0, 0.0); 3];
        let mut taken = [false; 3];
        let mut count = 0;
        for letter in text.chars() {
            let letter = letter.to_ascii_uppercase();
            let axis = LETTERS
                .iter()
                .position(|pair| pair.contains(&letter))
                .filter(|axis| !taken[*axis] && count < 3)
                .ok_or_else(wrong)?;
            taken[axis] = true;
            axes[count] = (
                axis,
                if LETTERS[axis][0] == letter {
                    1.0
                } else {
                    -1.0
                },
            );
            count += 1;
        }
        if count == 3 {
            Ok(Self(axes))
        } else {
            Err(wrong())
        }
    }
}

impl std::fmt::Display for Orientation {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        for (axis, direction) in self.0 {
            let letter = LETTERS[axis][usize::from(direction < 0.0)];
            write!(formatter, "{letter}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn letters_are_those_of_the_nearest_axes() {
        let grid =
            |steps: Matrix3<f64>| VoxelGrid::new([4; 3], steps * 1e-3, Point3::origin()).unwrap();
        let letters = |steps| Orientation::of(&grid(steps)).to_string();
        assert_eq!(letters(Matrix3::identity()), "LPS");
        assert_eq!(
            letters(Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, -1.0))),
            "RPI"
        );
        let sagittal = Matrix3::new(0.0, 0.1, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.1);
        assert_eq!(letters(sagittal), "PIR");
        // A gantry tilted by half a right angle and more.
        let tilted = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, -0.72, 1.0);
        assert_eq!(letters(tilted), "LPS");
    }

    #[test]
    fn what_is_no_orientation_is_refused() {
        for text in ["", "LP", "LPSS", "LLS", "XYZ", "RL S"] {
            assert!(text.parse::<Orientation>().is_err(), "{text}");
        }
        assert_eq!("las".parse::<Orientation>().unwrap().to_string(), "LAS");
    }
}
