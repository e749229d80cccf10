//! A ball as a scanner shows it: blurred across the slice by a Gaussian, along its normal by the slice's profile.

use needlebench_numerics::normal;

/// Distance between the columns of a table, mm: 0.2 % of the density is what interpolation is off by.
const ACROSS_MM: f64 = 0.1;

/// Distance between the rows of a table, mm.
const ALONG_MM: f64 = 0.05;

/// Nodes of the integral over a disc's chords.
const NODES: usize = 24;

/// Changes of radius and blur that derivatives are taken over, mm.
const CHANGE_MM: f64 = 0.02;

/// Share of the ball at a place, and its derivatives, per mm.
#[derive(Debug, Clone, Copy, Default)]
pub struct Share {
    /// 1 deep inside, 0 outside.
    pub value: f64,
    /// By the distance across.
    pub across: f64,
    /// By the distance along the slice's normal.
    pub along: f64,
    /// By the radius.
    pub radius: f64,
    /// By the blur's standard deviation.
    pub blur: f64,
}

/// A ball of one radius under one blur, by distance from its centre across and along the slice's normal.
#[derive(Debug)]
pub struct BlurredSphere {
    columns: usize,
    rows: usize,
    thickness_mm: f64,
    /// Density, then its integral from the centre's plane, then that integral's derivatives.
    cells: Vec<Cell>,
}

/// Density of a slice of no thickness; the integral of it from the centre's plane, and that one's derivatives.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    density: f64,
    sum: f64,
    across: f64,
    radius: f64,
    blur: f64,
}

impl BlurredSphere {
    /// Of `radius_mm`, seen with `blur_mm` (standard deviation) in slices of `thickness_mm`.
    pub fn new(radius_mm: f64, blur_mm: f64, thickness_mm: f64) -> Self {
        let reach_mm = radius_mm + 5.0 * blur_mm + 0.5;
        let columns = (reach_mm / ACROSS_MM).ceil() as usize + 2;
        let rows = ((radius_mm + 0.2) / ALONG_MM).ceil() as usize + 2;
        let sums = |radius_mm, blur_mm| Sums::new(columns, rows, radius_mm, blur_mm);
        let at = sums(radius_mm, blur_mm);
        let wider = sums(radius_mm + CHANGE_MM, blur_mm);
        let softer = sums(radius_mm, blur_mm + CHANGE_MM);
        let mut cells = vec![Cell::default(); columns * rows];
        for row in 0..rows {
            for column in 0..columns {
                let index = row * columns + column;
                let (before, after) = (column.max(1) - 1, (column + 1).min(columns - 1));
                let steps = (after - before) as f64 * ACROSS_MM;
                let across =
                    (at.sums[row * columns + after] - at.sums[row * columns + before]) / steps;
                cells[index] = Cell {
                    density: at.densities[index],
                    sum: at.sums[index],
                    across: if column == 0 { 0.0 } else { across },
                    radius: (wider.sums[index] - at.sums[index]) / CHANGE_MM,
                    blur: (softer.sums[index] - at.sums[index]) / CHANGE_MM,
                };
            }
        }
        Self {
            columns,
            rows,
            thickness_mm,
            cells,
        }
    }

    /// At a place so far from the centre across the slice and along its normal.
    pub fn share(&self, across_mm: f64, along_mm: f64) -> Share {
        let half = 0.5 * self.thickness_mm;
        if across_mm >= (self.columns - 2) as f64 * ACROSS_MM {
            return Share::default();
        }
        let upper = self.cell(across_mm, along_mm + half);
        let lower = self.cell(across_mm, along_mm - half);
        let scale = 1.0 / self.thickness_mm;
        Share {
            value: (upper.sum - lower.sum) * scale,
            across: (upper.across - lower.across) * scale,
            along: (upper.density - lower.density) * scale,
            radius: (upper.radius - lower.radius) * scale,
            blur: (upper.blur - lower.blur) * scale,
        }
    }

    fn cell(&self, across_mm: f64, along_mm: f64) -> Cell {
        let x = across_mm / ACROSS_MM;
        let y = (along_mm.abs() / ALONG_MM).min((self.rows - 2) as f64);
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f64, y - row as f64);
        let index = row * self.columns + column;
        let (a, b) = (&self.cells[index], &self.cells[index + 1]);
        let (c, d) = (
            &self.cells[index + self.columns],
            &self.cells[index + self.columns + 1],
        );
        let mix = |of: fn(&Cell) -> f64| {
            let near = of(a) + fx * (of(b) - of(a));
            let far = of(c) + fx * (of(d) - of(c));
            near + fy * (far - near)
        };
        // Integrals from the centre's plane change their sign with the side; the density does not.
        let side = along_mm.signum();
        Cell {
            density: mix(|cell| cell.density),
            sum: side * mix(|cell| cell.sum),
            across: side * mix(|cell| cell.across),
            radius: side * mix(|cell| cell.radius),
            blur: side * mix(|cell| cell.blur),
        }
    }
}

/// Densities by distance across and along, and their integrals along.
struct Sums {
    densities: Vec<f64>,
    sums: Vec<f64>,
}

impl Sums {
    fn new(columns: usize, rows: usize, radius_mm: f64, blur_mm: f64) -> Self {
        let mut densities = vec![0.0; columns * rows];
        let mut sums = vec![0.0; columns * rows];
        for row in 0..rows {
            let along_mm = row as f64 * ALONG_MM;
            let disc_mm = (radius_mm * radius_mm - along_mm * along_mm)
                .max(0.0)
                .sqrt();
            for column in 0..columns {
                let index = row * columns + column;
                densities[index] = disc_density(disc_mm, blur_mm, column as f64 * ACROSS_MM);
                if row > 0 {
                    let before = index - columns;
                    let mean = 0.5 * (densities[before] + densities[index]);
                    sums[index] = sums[before] + ALONG_MM * mean;
                }
            }
        }
        Self { densities, sums }
    }
}

/// Of a disc blurred by a Gaussian, so far from its centre: chords across, their blurred lengths summed.
fn disc_density(radius_mm: f64, blur_mm: f64, across_mm: f64) -> f64 {
    let low = (-radius_mm).max(across_mm - 5.0 * blur_mm);
    let high = radius_mm.min(across_mm + 5.0 * blur_mm);
    if high <= low {
        return 0.0;
    }
    // By the angle at the centre, at which the chords' lengths have no corner.
    let angle = |x: f64| libm::atan2(x, (radius_mm * radius_mm - x * x).max(0.0).sqrt());
    let (from, to) = (angle(low), angle(high));
    let step = (to - from) / NODES as f64;
    let sum: f64 = (0..NODES)
        .map(|node| {
            let (x, half_chord) = libm::sincos(from + (node as f64 + 0.5) * step);
            let (x, half_chord) = (radius_mm * x, radius_mm * half_chord);
            let t = (x - across_mm) / blur_mm;
            let chord = 2.0 * normal::probability_below(half_chord / blur_mm) - 1.0;
            libm::exp(-0.5 * t * t) * chord * half_chord
        })
        .sum();
    sum * step / (blur_mm * (std::f64::consts::TAU).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_mass_is_that_of_the_ball_and_its_derivatives_are_differences() {
        let (radius, blur, thickness) = (2.5, 0.55, 2.0);
        let sphere = BlurredSphere::new(radius, blur, thickness);
        let mut mass = 0.0;
        let step = 0.05;
        for i in 0..120 {
            let across = (f64::from(i) + 0.5) * step;
            for k in -90..90 {
                let along = (f64::from(k) + 0.5) * step;
                mass += std::f64::consts::TAU
                    * across
                    * step
                    * step
                    * sphere.share(across, along).value;
            }
        }
        let volume = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        assert!((mass / volume - 1.0).abs() < 2e-3, "{mass} {volume}");

        let (across, along) = (2.13, 1.37);
        let at = sphere.share(across, along);
        let h = 0.1;
        let by_across = (sphere.share(across + h, along).value
            - sphere.share(across - h, along).value)
            / (2.0 * h);
        let by_along = (sphere.share(across, along + h).value
            - sphere.share(across, along - h).value)
            / (2.0 * h);
        assert!(
            (at.across / by_across - 1.0).abs() < 0.02,
            "{} {by_across}",
            at.across
        );
        assert!(
            (at.along / by_along - 1.0).abs() < 0.02,
            "{} {by_along}",
            at.along
        );
        let wider = BlurredSphere::new(radius + 0.05, blur, thickness)
            .share(across, along)
            .value;
        assert!(((wider - at.value) / 0.05 / at.radius - 1.0).abs() < 0.05);
        let softer = BlurredSphere::new(radius, blur + 0.05, thickness)
            .share(across, along)
            .value;
        assert!(((softer - at.value) / 0.05 / at.blur - 1.0).abs() < 0.1);
    }
}
