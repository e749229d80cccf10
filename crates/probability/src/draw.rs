//! Draws of a law: each a function of the seed and its number alone.

use nalgebra::{Vector3, Vector6};
use needlebench_numerics::normal;
use needlebench_numerics::random::{NormalPairs, SplitMix64};

use crate::bend::{BendDirection, turned};
use crate::breath::Body;
use crate::law::Law;

/// One needle in one patient: how far its path is off the planned one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathDraw {
    /// Entry, real minus planned, without bend and breath, m.
    pub entry_m: Vector3<f64>,
    /// Tip, the same.
    pub tip_m: Vector3<f64>,
    /// Displacement of chest wall and lung, m.
    pub breath_m: [Vector3<f64>; 2],
    /// Curve of the bend, and cosine and sine of how it is turned.
    pub(crate) curve: usize,
    pub(crate) turn: [f64; 2],
}

impl PathDraw {
    /// How far the needle is off its planned place relative to a body, at a fraction of the planned depth, m.
    pub fn at(&self, law: &Law, fraction: f64, body: Body) -> Vector3<f64> {
        let bend_m = law.bend().map_or_else(Vector3::zeros, |bend| {
            let bent = turned(bend.at(self.curve, fraction), self.turn);
            Vector3::new(0.0, bent.x, bent.y)
        });
        self.straight_m(fraction, body) + bend_m
    }

    /// The same without the bend.
    #[inline]
    pub(crate) fn straight_m(&self, fraction: f64, body: Body) -> Vector3<f64> {
        self.entry_m * (1.0 - fraction) + self.tip_m * fraction - self.breath_m[body.index()]
    }
}

/// The values that make a draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Values {
    /// Standard normal: of entry and tip, of the breath's level, of its drift.
    pub linear: [f64; 6],
    pub level: f64,
    pub drift: f64,
    /// State of the breath, and the phase of a failed hold, 0 to 1.
    pub hold: usize,
    pub phase: f64,
    pub curve: usize,
    pub turn: [f64; 2],
}

/// Kinds of variables: each has its own sequence, so that a law without bends has the same arms.
#[derive(Clone, Copy)]
enum Stream {
    Linear = 1,
    Breath = 2,
    Bend = 3,
    Boundary = 4,
    /// Draws of importance sampling, and of its search.
    Moved = 5,
    Search = 6,
}

/// Draws of a seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Streams {
    starts: [u64; 7],
}

impl Streams {
    pub fn new(seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        Self {
            starts: std::array::from_fn(|_| random.next_u64()),
        }
    }

    /// Where the sequence of a draw starts: the numbers of SplitMix64 are as good a hash as they are random.
    fn start(&self, stream: Stream, index: u64) -> u64 {
        let at = self.starts[stream as usize].wrapping_add(index);
        SplitMix64::new(at).next_u64()
    }

    pub fn values(&self, law: &Law, index: u64) -> Values {
        let mut normals = NormalPairs::new(self.start(Stream::Linear, index));
        let mut values = Values {
            linear: std::array::from_fn(|_| normals.next_normal()),
            level: 0.0,
            drift: 0.0,
            hold: 0,
            phase: 0.0,
            curve: 0,
            turn: [1.0, 0.0],
        };
        if law.breathes() {
            let mut breath = NormalPairs::new(self.start(Stream::Breath, index));
            values.hold = chosen(law, breath.uniform(0.0, 1.0));
            values.phase = breath.uniform(0.0, 1.0);
            values.level = breath.next_normal();
            values.drift = breath.next_normal();
        }
        if let Some(bend) = law.bend() {
            let mut random = NormalPairs::new(self.start(Stream::Bend, index));
            values.curve = nth(bend.count(), random.uniform(0.0, 1.0));
            values.turn = match bend.direction() {
                BendDirection::Known { spread_rad } => {
                    cosine_and_sine(spread_rad * random.next_normal())
                }
                BendDirection::Unknown => any_direction(&mut random),
            };
        }
        values
    }

    /// Random numbers of a moved draw.
    pub fn moved(&self, index: u64) -> NormalPairs {
        NormalPairs::new(self.start(Stream::Moved, index))
    }

    /// Random numbers of a draw of the search for points of failure.
    pub fn search(&self, index: u64) -> NormalPairs {
        NormalPairs::new(self.start(Stream::Search, index))
    }

    /// Sequence of the boundary of a structure.
    pub fn boundary(&self, structure: usize) -> u64 {
        self.start(Stream::Boundary, structure as u64)
    }
}

/// Boundary shifts of one draw in standard deviations, one per structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shifts<'a> {
    /// Start of each structure's sequence.
    pub starts: &'a [u64],
    pub index: u64,
    /// By how much one of them is moved.
    pub moved: Option<(usize, f64)>,
}

impl Shifts<'_> {
    /// Standard normal.
    pub fn of(&self, structure: usize) -> f64 {
        let drawn = normal::quantile(self.unit(structure));
        match self.moved {
            Some((moved, by)) if moved == structure => drawn + by,
            _ => drawn,
        }
    }

    /// Uniform in (0, 1).
    fn unit(&self, structure: usize) -> f64 {
        SplitMix64::new(self.starts[structure].wrapping_add(self.index)).open_unit()
    }

    /// Whether the value is below a limit, without computing it: false if that takes a computation.
    pub fn is_below(&self, structure: usize, limit: f64) -> bool {
        /// Standard deviations, and a share of the distribution that is below.
        const COARSE: (f64, f64) = (3.5, 0.9997);
        self.moved.is_none_or(|(moved, _)| moved != structure)
            && limit > COARSE.0
            && self.unit(structure) < COARSE.1
    }
}

/// State of the breath by a share in [0, 1).
pub(crate) fn chosen(law: &Law, share: f64) -> usize {
    let mut sum = 0.0;
    let holds = law.holds();
    let found = holds.iter().position(|hold| {
        sum += hold.weight;
        share < sum
    });
    // Rounding of the sum.
    found.unwrap_or(holds.len() - 1)
}

/// One of so many by a share in [0, 1].
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and the count"
)]
pub(crate) fn nth(count: usize, share: f64) -> usize {
    ((share * count as f64) as usize).min(count - 1)
}

pub(crate) fn cosine_and_sine(angle_rad: f64) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(angle_rad);
    [cosine, sine]
}

/// Cosine and sine of an angle that is uniform, from a point in the unit disc.
pub(crate) fn any_direction(random: &mut NormalPairs) -> [f64; 2] {
    loop {
        let [x, y] = [(); 2].map(|()| random.uniform(-1.0, 1.0));
        let square = x * x + y * y;
        if square > 1e-300 && square < 1.0 {
            let length = square.sqrt();
            return [x / length, y / length];
        }
    }
}

/// The path that values make.
pub(crate) fn path(law: &Law, values: &Values) -> PathDraw {
    let off_m = law.root_m() * Vector6::from(values.linear) + law.mean_m();
    let hold = &law.holds()[values.hold];
    let fullness = if hold.failed_m.is_some() {
        let sine = libm::sin(std::f64::consts::PI * values.phase);
        let square = sine * sine;
        square * square
    } else {
        0.0
    };
    PathDraw {
        entry_m: off_m.fixed_rows::<3>(0).into_owned(),
        tip_m: off_m.fixed_rows::<3>(3).into_owned(),
        breath_m: hold.displacement_m(values.level, values.drift, fullness),
        curve: values.curve,
        turn: values.turn,
    }
}

/// Draw `index` of a law.
pub fn draw(law: &Law, seed: u64, index: u64) -> PathDraw {
    path(law, &Streams::new(seed).values(law, index))
}
