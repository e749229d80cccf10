//! Simulated nodules: analytic solids, sampled within each voxel, blurred and with noise. Nothing here is of the crate.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_imaging::LesionSeed;
use needlebench_numerics::random::NormalPairs;
use needlebench_volume::{Volume, VoxelGrid};

const MM: f64 = 1e-3;

/// Densities of what is not the nodule, HU.
const AIR: f64 = -1000.0;
const LUNG: f64 = -850.0;
const SOFT: f64 = 40.0;
const RIB: f64 = 500.0;

/// Standard deviation of the scanner's blur in the slice, mm.
const PSF_MM: f64 = 0.55;

/// Points that stand for a normal distribution: quantiles in equal shares, scaled to its variance.
const NORMAL: [f64; 6] = [-1.542, -0.752, -0.2345, 0.2345, 0.752, 1.542];

/// What a scan is like.
#[derive(Debug, Clone, Copy)]
pub struct Slices {
    /// What a slice integrates over, mm.
    pub thickness_mm: f64,
    /// From slice to slice, mm.
    pub increment_mm: f64,
}

/// What a nodule is like, and what is around it. Lengths in mm, from the middle of the box.
#[derive(Debug, Clone)]
pub struct Case {
    pub slices: Slices,
    pub pixel_mm: f64,
    pub noise_hu: f64,
    pub nodule_hu: f64,
    /// Of the ball of the same size, before the wall takes its part.
    pub diameter_mm: f64,
    /// Ellipsoids that make up the nodule: middle, and the matrix that turns each into the unit ball.
    lobes: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// From, direction, radius.
    vessels: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
    pub at_wall: bool,
    has_rib: bool,
    at: Vector3<f64>,
    /// Half width of the lung's box, mm.
    half_mm: Vector3<f64>,
    /// Of the sphere that bounds it towards the wall, mm.
    wall_radius_mm: f64,
    seed_mm: Vector3<f64>,
    noise_seed: u64,
}

/// Nodules to draw from.
#[derive(Debug, Clone)]
pub struct Population {
    pub slices: Vec<Slices>,
    pub diameters_mm: [f64; 2],
    pub vessels: [u32; 2],
    pub walls: f64,
    pub ground_glass: f64,
    pub most_elongated: f64,
    pub lobulated: f64,
}

fn direction(random: &mut NormalPairs) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.next_normal()).normalize()
}

impl Population {
    pub fn draw(&self, seed: u64) -> Case {
        let mut random = NormalPairs::new(seed);
        let chance = |random: &mut NormalPairs, share: f64| random.uniform(0.0, 1.0) < share;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small"
        )]
        let pick =
            |random: &mut NormalPairs, count: usize| random.uniform(0.0, count as f64) as usize;
        let slices = self.slices[pick(&mut random, self.slices.len())];
        let [least, most] = self.diameters_mm;
        let diameter_mm = least * libm::pow(most / least, random.uniform(0.0, 1.0));
        let radius_mm = 0.5 * diameter_mm;
        let at_wall = chance(&mut random, self.walls);
        let nodule_hu = if chance(&mut random, self.ground_glass) {
            random.uniform(-600.0, -500.0)
        } else {
            random.uniform(-50.0, 60.0)
        };
        let elongated = |random: &mut NormalPairs| {
            let stretch = random.uniform(1.0, self.most_elongated);
            let other = random.uniform(1.0, stretch);
            let axes = Vector3::new(stretch, other, 1.0);
            let scale = libm::cbrt(axes.iter().product());
            let turn = nalgebra::UnitQuaternion::from_axis_angle(
                &nalgebra::Unit::new_normalize(direction(random)),
                random.uniform(0.0, 3.0),
            );
            (axes / scale, turn.to_rotation_matrix().into_inner())
        };
        let ball = |at: Vector3<f64>, axes: Vector3<f64>, turn: Matrix3<f64>| {
            let unit = Matrix3::from_diagonal(&axes.map(|axis| 1.0 / axis)) * turn.transpose();
            (at, unit)
        };
        let (axes, turn) = elongated(&mut random);
        let mut lobes = vec![ball(Vector3::zeros(), axes * radius_mm, turn)];
        if chance(&mut random, self.lobulated) {
            for _ in 0..3 {
                let aside = direction(&mut random) * (0.6 * radius_mm);
                let size = radius_mm * random.uniform(0.45, 0.65);
                lobes.push(ball(
                    aside,
                    Vector3::from_element(size),
                    Matrix3::identity(),
                ));
            }
        }
        let half_mm = (diameter_mm * 0.5 + 32.0).max(43.0);
        let half_mm = Vector3::new(half_mm, half_mm, half_mm);
        let wall_radius_mm = 2.2 * half_mm.x;
        let jitter = Vector3::from_fn(|_, _| random.uniform(-4.0, 4.0));
        let mut at = Vector3::new(0.0, 0.0, 0.0) + jitter;
        if at_wall {
            // Half to all of it in the lung, at the curved wall.
            let centre = half_mm.x - wall_radius_mm;
            let depth = random.uniform(0.0, 0.9) * radius_mm;
            let aside = (wall_radius_mm - depth).powi(2) - at.y * at.y - at.z * at.z;
            at.x = centre + aside.max(0.0).sqrt();
        }
        let [few, many] = self.vessels;
        let count = few + u32::try_from(pick(&mut random, (many - few + 1) as usize)).unwrap_or(0);
        let mut vessels = Vec::new();
        for _ in 0..count {
            // A vessel is thinner than what it feeds.
            let width_mm = random.uniform(2.0, 5.0_f64.min(0.5 * diameter_mm).max(2.1));
            vessels.push((at, direction(&mut random), 0.5 * width_mm));
        }
        let beside = direction(&mut random) * (0.3 * radius_mm).min(3.0);
        let seed_mm = at + beside * random.uniform(0.0, 1.0);
        Case {
            slices,
            pixel_mm: random.uniform(0.6, 0.9),
            noise_hu: random.uniform(10.0, 40.0),
            nodule_hu,
            diameter_mm,
            lobes,
            vessels,
            at_wall,
            has_rib: chance(&mut random, 0.5),
            at,
            half_mm,
            wall_radius_mm,
            seed_mm,
            noise_seed: seed ^ 0x5eed,
        }
    }
}

/// Around a lung: skin, fat and muscle, mm.
const SHELL_MM: f64 = 12.0;
/// More of the body on the other side: it puts the midline beside the lung, which would else be parted there, mm.
const OTHER_SIDE_MM: f64 = 64.0;
/// Air around the body, mm.
const AROUND_MM: f64 = 6.0;

impl Case {
    pub fn has_vessels(&self) -> bool {
        !self.vessels.is_empty()
    }

    /// From the curved wall to the seed, mm.
    pub fn seed_depth_mm(&self) -> f64 {
        let centre = Vector3::new(self.half_mm.x - self.wall_radius_mm, 0.0, 0.0);
        self.wall_radius_mm - (self.seed_mm - centre).norm()
    }

    pub fn is_ground_glass(&self) -> bool {
        self.nodule_hu < -300.0
    }

    pub fn seed(&self) -> LesionSeed {
        LesionSeed {
            name: "nodule".to_owned(),
            point_m: Point3::from(self.seed_mm * MM),
        }
    }

    fn in_nodule(&self, p: &Vector3<f64>) -> bool {
        let from = p - self.at;
        let mut lobes = self.lobes.iter();
        lobes.any(|(at, unit)| (unit * (from - at)).norm_squared() <= 1.0)
    }

    /// Within the wall as it would be without the nodule.
    fn in_lung(&self, p: &Vector3<f64>) -> bool {
        let centre = Vector3::new(self.half_mm.x - self.wall_radius_mm, 0.0, 0.0);
        (0..3).all(|axis| p[axis].abs() <= self.half_mm[axis])
            && (p - centre).norm_squared() <= self.wall_radius_mm.powi(2)
    }

    /// Density at a place, HU.
    fn hu(&self, p: &Vector3<f64>) -> f64 {
        if self.in_lung(p) {
            if self.in_nodule(p) {
                return self.nodule_hu;
            }
            let in_vessel = self.vessels.iter().any(|(from, along, radius)| {
                let way = p - from;
                let far = way.dot(along);
                far >= 0.0 && (way - along * far).norm_squared() <= radius * radius
            });
            return if in_vessel { SOFT } else { LUNG };
        }
        if self.has_rib && libm::hypot(p.x - self.half_mm.x - 6.0, p.z - self.at.z) <= 4.0 {
            return RIB;
        }
        let outside = p.x > self.half_mm.x + SHELL_MM
            || p.x < -self.half_mm.x - SHELL_MM - OTHER_SIDE_MM
            || p.y.abs() > self.half_mm.y + SHELL_MM;
        if outside { AIR } else { SOFT }
    }

    /// The nodule's centroid: of the solid on the lung's side of the wall, without vessels, mm.
    fn centroid_mm(&self) -> Vector3<f64> {
        let step = self.diameter_mm / 60.0;
        let reach = 75;
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for k in -reach..reach {
            for j in -reach..reach {
                for i in -reach..reach {
                    let p = Vector3::new(i, j, k).map(|at| (f64::from(at) + 0.5) * step) + self.at;
                    if self.in_nodule(&p) && self.in_lung(&p) {
                        sum += p;
                        count += 1.0;
                    }
                }
            }
        }
        sum / count
    }

    pub fn true_centre_m(&self) -> Point3<f64> {
        Point3::from(self.centroid_mm() * MM)
    }

    /// What a voxel shows, HU: blurred in the slice, and the mean over the slice.
    fn sampled(&self, at: &Vector3<f64>, depths: &[f64]) -> f64 {
        // Where a coarse look finds one density there is only one.
        let here = self.hu(at);
        let coarse = [-1.6, 0.0, 1.6];
        let is_one = depths.iter().all(|&z| {
            let plane = coarse
                .iter()
                .flat_map(|&y| coarse.map(|x| Vector3::new(x, y, z)));
            plane
                .into_iter()
                .all(|off| (self.hu(&(at + off)) - here).abs() < 1e-9)
        });
        if is_one {
            return here;
        }
        let mut sum = 0.0;
        for &z in depths {
            for y in NORMAL {
                for x in NORMAL {
                    sum += self.hu(&(at + Vector3::new(x * PSF_MM, y * PSF_MM, z)));
                }
            }
        }
        sum / (depths.len() * NORMAL.len() * NORMAL.len()) as f64
    }

    pub fn volume(&self) -> Volume {
        let body = self.half_mm + Vector3::new(SHELL_MM, SHELL_MM, 8.0);
        let around = Vector3::new(AROUND_MM, AROUND_MM, 0.0);
        let spacing = Vector3::new(self.pixel_mm, self.pixel_mm, self.slices.increment_mm);
        let mut random = NormalPairs::new(self.noise_seed);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "voxels"
        )]
        let size = [0, 1, 2].map(|axis| {
            let other = if axis == 0 { OTHER_SIDE_MM } else { 0.0 };
            ((2.0 * (body[axis] + around[axis]) + other) / spacing[axis]) as usize
        });
        // Anywhere between voxels.
        let first = Vector3::from_fn(|axis, _| {
            let other = if axis == 0 { OTHER_SIDE_MM } else { 0.0 };
            -0.5 * (spacing[axis] * (size[axis] - 1) as f64 + other)
                + spacing[axis] * random.uniform(-0.5, 0.5)
        });
        let grid = VoxelGrid::aligned(
            size,
            [0, 1, 2].map(|axis| spacing[axis] * MM),
            Point3::from(first * MM),
        )
        .unwrap();
        let mut hu = Vec::with_capacity(grid.len());
        let near_mm = 0.5 * self.diameter_mm * 1.6 + 14.0;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "parts"
        )]
        let parts = (self.slices.thickness_mm / 0.6).ceil() as usize;
        let depths: Vec<f64> = (0..parts)
            .map(|part| ((part as f64 + 0.5) / parts as f64 - 0.5) * self.slices.thickness_mm)
            .collect();
        let mut white: Vec<f64> = (0..size[0] * size[1])
            .map(|_| random.next_normal())
            .collect();
        for k in 0..size[2] {
            for each in &mut white {
                *each = random.next_normal();
            }
            for j in 0..size[1] {
                for i in 0..size[0] {
                    let at =
                        first + spacing.component_mul(&Vector3::new(i as f64, j as f64, k as f64));
                    let value = if (at - self.at).norm() > near_mm {
                        self.hu(&at)
                    } else {
                        self.sampled(&at, &depths)
                    };
                    // Noise of neighbours goes together.
                    let beside = if i > 0 {
                        white[j * size[0] + i - 1]
                    } else {
                        0.0
                    };
                    let noise = (white[j * size[0] + i] + 0.5 * beside) / 1.118_f64;
                    #[expect(clippy::cast_possible_truncation, reason = "Hounsfield units")]
                    hu.push(
                        (value + self.noise_hu * noise)
                            .round()
                            .clamp(-1024.0, 3000.0) as i16,
                    );
                }
            }
        }
        Volume {
            grid,
            hu,
            slice_thickness_m: Some(self.slices.thickness_mm * MM),
        }
    }
}
