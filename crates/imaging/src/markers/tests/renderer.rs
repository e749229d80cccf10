//! Scans of made-up markers, by counting points: nothing of the fit's model is in here.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_numerics::random::NormalPairs;
use needlebench_volume::{Volume, VoxelGrid};

/// Points per pixel along each direction.
const FINE: usize = 5;

/// Points per slice along its normal.
const DEEP: usize = 11;

/// What is scanned, mm and HU, `ct` axes.
#[derive(Debug, Clone)]
pub struct Scene {
    pub spheres: Vec<(Vector3<f64>, f64, f64)>,
    /// A ring: centre, axis, radius of its middle line and of its wire, HU.
    pub rings: Vec<(Vector3<f64>, Vector3<f64>, [f64; 2], f64)>,
    /// Cylinders: centre, axis, radius, half length, HU.
    pub cylinders: Vec<(Vector3<f64>, Vector3<f64>, [f64; 2], f64)>,
    /// The skin: a cylinder around this line (a point of it and its direction), of this radius; or a plane if infinite.
    pub skin_point: Vector3<f64>,
    pub skin_normal: Vector3<f64>,
    pub skin_axis: Vector3<f64>,
    pub skin_radius: f64,
    pub tissue: f64,
}

impl Scene {
    fn hu(&self, p: &Vector3<f64>) -> f64 {
        for (center, radius, hu) in &self.spheres {
            if (p - center).norm_squared() < radius * radius {
                return *hu;
            }
        }
        for (center, axis, [radius, wire], hu) in &self.rings {
            let offset = p - center;
            let along = offset.dot(axis);
            let across = (offset - axis * along).norm() - radius;
            if along * along + across * across < wire * wire {
                return *hu;
            }
        }
        for (center, axis, [radius, half], hu) in &self.cylinders {
            let offset = p - center;
            let along = offset.dot(axis);
            if along.abs() < *half && (offset - axis * along).norm_squared() < radius * radius {
                return *hu;
            }
        }
        let depth = if self.skin_radius.is_finite() {
            let middle = self.skin_point - self.skin_normal * self.skin_radius;
            let offset = p - middle;
            let offset = offset - self.skin_axis * offset.dot(&self.skin_axis);
            self.skin_radius - offset.norm()
        } else {
            (self.skin_point - p).dot(&self.skin_normal)
        };
        if depth > 0.0 { self.tissue } else { -1000.0 }
    }
}

/// How it is scanned, mm and HU.
#[derive(Debug, Clone)]
pub struct Scanner {
    pub size: [usize; 3],
    pub pixel: f64,
    pub increment: f64,
    pub thickness: f64,
    pub blur: f64,
    pub noise: f64,
    /// Standard deviation of the noise's own blur, pixels.
    pub noise_blur: f64,
    /// Directions of rows and columns of pixels, and of the slices' centres.
    pub axes: Matrix3<f64>,
    /// Dark and bright stripes around the middle, HU.
    pub streaks: f64,
    pub clip: f64,
}

impl Scanner {
    pub fn new(thickness: f64, increment: f64, noise: f64) -> Self {
        let slices = (30.0 / increment).ceil() as usize + 1;
        Self {
            size: [44, 44, slices],
            pixel: 0.7,
            increment,
            thickness,
            blur: 0.55,
            noise,
            noise_blur: 0.7,
            axes: Matrix3::identity(),
            streaks: 0.0,
            clip: 3071.0,
        }
    }

    /// The volume, the middle of its lattice at the origin of the scene.
    pub fn scan(&self, scene: &Scene, random: &mut NormalPairs) -> Volume {
        let steps = self.axes
            * Matrix3::from_diagonal(&Vector3::new(self.pixel, self.pixel, self.increment));
        let middle = Vector3::from(self.size.map(|n| (n as f64 - 1.0) / 2.0));
        let first = -(steps * middle);
        let normal = self.axes.column(0).cross(&self.axes.column(1)).normalize();
        let mut hu = Vec::new();
        for k in 0..self.size[2] {
            let origin = first + steps.column(2) * k as f64;
            let image = self.image(scene, &origin, &normal);
            let noise = self.noise_image(random);
            for (index, value) in image.into_iter().enumerate() {
                let (i, j) = (index % self.size[0], index / self.size[0]);
                let off = [i as f64 - middle.x, j as f64 - middle.y];
                let near = libm::hypot(off[0], off[1]) * self.pixel < 9.0;
                let streak = if near {
                    self.streaks * libm::sin(0.9 * off[0] + 0.37 * off[1])
                } else {
                    0.0
                };
                let value = value + noise[index] + streak;
                hu.push(value.round().clamp(-1024.0, self.clip) as i16);
            }
        }
        Volume {
            grid: VoxelGrid::new(self.size, steps * 1e-3, Point3::from(first * 1e-3)).unwrap(),
            hu,
            slice_thickness_m: Some(self.thickness * 1e-3),
        }
    }

    fn image(&self, scene: &Scene, origin: &Vector3<f64>, normal: &Vector3<f64>) -> Vec<f64> {
        let [nx, ny, _] = self.size;
        let fine = self.pixel / FINE as f64;
        let (across, down) = (self.axes.column(0) * fine, self.axes.column(1) * fine);
        // A margin for the blur.
        let margin = (5.0 * self.blur / fine).ceil() as usize;
        let (width, height) = (
            (nx - 1) * FINE + 1 + 2 * margin,
            (ny - 1) * FINE + 1 + 2 * margin,
        );
        let corner = origin - (across + down) * margin as f64;
        let mut points = vec![0.0; width * height];
        for deep in 0..DEEP {
            let along = self.thickness * ((deep as f64 + 0.5) / DEEP as f64 - 0.5);
            for y in 0..height {
                for x in 0..width {
                    let p = corner + across * x as f64 + down * y as f64 + normal * along;
                    points[y * width + x] += scene.hu(&p) / DEEP as f64;
                }
            }
        }
        let kernel: Vec<f64> = (0..=2 * margin)
            .map(|n| libm::exp(-0.5 * ((n as f64 - margin as f64) * fine / self.blur).powi(2)))
            .collect();
        let sum: f64 = kernel.iter().sum();
        let mut rows = vec![0.0; width * ny];
        for j in 0..ny {
            for x in 0..width {
                rows[j * width + x] = (0..kernel.len())
                    .map(|n| kernel[n] * points[(j * FINE + n) * width + x])
                    .sum::<f64>()
                    / sum;
            }
        }
        let mut image = Vec::with_capacity(nx * ny);
        for j in 0..ny {
            for i in 0..nx {
                image.push(
                    (0..kernel.len())
                        .map(|n| kernel[n] * rows[j * width + i * FINE + n])
                        .sum::<f64>()
                        / sum,
                );
            }
        }
        image
    }

    fn noise_image(&self, random: &mut NormalPairs) -> Vec<f64> {
        const REACH: usize = 4;
        let [nx, ny, _] = self.size;
        let width = nx + 2 * REACH;
        let white: Vec<f64> = (0..width * (ny + 2 * REACH))
            .map(|_| random.next_normal())
            .collect();
        let mut kernel = Vec::new();
        for dy in 0..=2 * REACH {
            for dx in 0..=2 * REACH {
                let d2 = (dx as f64 - REACH as f64).powi(2) + (dy as f64 - REACH as f64).powi(2);
                kernel.push(libm::exp(-0.5 * d2 / self.noise_blur.powi(2)));
            }
        }
        let power = kernel.iter().map(|k| k * k).sum::<f64>().sqrt();
        let side = 2 * REACH + 1;
        (0..nx * ny)
            .map(|index| {
                let (i, j) = (index % nx, index / nx);
                let sum: f64 = (0..side * side)
                    .map(|n| kernel[n] * white[(j + n / side) * width + i + n % side])
                    .sum();
                self.noise * sum / power
            })
            .collect()
    }
}

/// A marker on skin at a place below a pixel and a direction drawn at random.
pub struct Trial {
    pub scene: Scene,
    pub truth: Vector3<f64>,
}

/// A bare ball on curved skin.
pub(crate) fn ball_on_skin(
    diameter: f64,
    hu: f64,
    skin_radius: f64,
    random: &mut NormalPairs,
) -> Trial {
    let truth = Vector3::from_fn(|_, _| random.uniform(-0.5, 0.5))
        .component_mul(&Vector3::new(0.7, 0.7, 5.0));
    // Any direction, but for the top of the head.
    let angle = random.uniform(0.0, std::f64::consts::TAU);
    let up = random.uniform(-0.5, 0.5);
    let level = (1.0 - up * up).sqrt();
    let normal = Vector3::new(level * libm::cos(angle), level * libm::sin(angle), up);
    let axis = normal
        .cross(&Vector3::new(-normal.y, normal.x, 0.0))
        .normalize();
    Trial {
        scene: Scene {
            spheres: vec![(truth, 0.5 * diameter, hu)],
            rings: Vec::new(),
            cylinders: Vec::new(),
            skin_point: truth - normal * 0.5 * diameter,
            skin_normal: normal,
            skin_axis: axis,
            skin_radius,
            tissue: 40.0,
        },
        truth,
    }
}
