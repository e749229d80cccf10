//! What holds a needle.

use nalgebra::Vector2;

/// A bore with a needle in it: two supports at its ends, and walls between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guide {
    /// Length of the bore, m.
    pub length_m: f64,
    /// How far the needle may move from the middle of the bore, m: half of what the bore is wider.
    pub play_m: f64,
}

/// What holds a needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Holder {
    /// A guide that stays where it is.
    Guide(Guide),
    /// A clamp at the guide's exit: neither displacement nor slope.
    Clamp,
    /// The hub, in a hand that moves on with it: a clamp at the needle's end. The needle's length is from there to the tip, m.
    Hub(f64),
}

/// How the needle lies in the bore, along the direction in which it is bent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seat {
    /// Displacement at the exit, m.
    pub exit_m: Vector2<f64>,
    /// Moment about the exit, beside that of the spring of two supports, N m.
    pub moment_nm: Vector2<f64>,
    /// Slope at the exit.
    pub slope: Vector2<f64>,
}

/// What the rest of the needle answers at the exit, with the spring of two supports: its slope is
/// `slope + slope_by_exit * displacement + slope_by_moment * moment`, and what holds its displacement there is
/// `force + force_by_exit * displacement - slope_by_exit * moment` (Maxwell and Betti).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answer {
    pub slope: Vector2<f64>,
    pub force_n: Vector2<f64>,
    pub by: Held,
}

/// Slope and force at the exit by a displacement and a moment there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Held {
    pub slope_by_exit: f64,
    pub slope_by_moment: f64,
    pub force_by_exit: f64,
}

/// Rounds of the balance between both ends of the bore: most cases need two.
const ROUNDS: usize = 200;

/// Steps until the place of an exit is known, to this part of the play: halves of the play would need 40.
const STEPS: usize = 60;
const EXIT: f64 = 1e-12;

/// A guide with a needle in it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bore {
    length_m: f64,
    pub play_m: f64,
    bending_nm2: f64,
    /// Stiffness against rotation at the exit of a beam on two supports, N m.
    pub rotation_nm: f64,
    /// The same by the length of the bore, N.
    shear_n: f64,
    /// Slope of a needle that leans on one wall at the entry and on the other one at the exit.
    pub lean: f64,
}

/// Where a needle rests in a bore, along a line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rest {
    /// Where the exit's wall is that the entry's wall presses it to, 1 or -1.
    pub side: f64,
    /// Displacement at the exit, m.
    pub exit_m: f64,
    /// Moment at the exit, beside that of the spring of two supports, N m.
    pub moment_nm: f64,
}

impl Rest {
    /// In the middle, free.
    pub const MIDDLE: Self = Self {
        side: 1.0,
        exit_m: 0.0,
        moment_nm: 0.0,
    };
}

/// How a needle lies in a bore, if it is pressed to one wall at the exit and to the other one at the entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Leaning {
    /// It leaves the wall at the entry.
    OnEnds,
    /// It lies on the wall from the entry on (see [`Bore::seat`]).
    OnWall,
    /// It is not pressed there.
    Elsewhere,
}

impl Bore {
    /// Of a guide, and the needle's bending stiffness, N m2.
    pub fn new(guide: &Guide, bending_nm2: f64) -> Self {
        let Guide { length_m, play_m } = *guide;
        let rotation_nm = 3.0 * bending_nm2 / length_m;
        Self {
            length_m,
            play_m,
            bending_nm2,
            rotation_nm,
            shear_n: rotation_nm / length_m,
            lean: 2.0 * play_m / length_m,
        }
    }

    /// A needle that is pressed to the wall on one side (1 or -1) at the exit and on the other one at the entry.
    pub fn leaning(&self, side: f64) -> Rest {
        Rest {
            side,
            exit_m: self.play_m * side,
            moment_nm: self.lean * self.rotation_nm * side,
        }
    }

    /// How it lies there, by force and slope at the exit: nowhere else if it is not pressed to both walls.
    #[inline(always)]
    pub fn leans(&self, side: f64, [force_n, slope]: [f64; 2]) -> Leaning {
        let off = slope * side - self.lean;
        if off < 0.0 || force_n * side > off * self.shear_n {
            Leaning::Elsewhere
        } else if off <= 2.0 * self.lean {
            Leaning::OnEnds
        } else {
            Leaning::OnWall
        }
    }

    /// Where the needle comes to rest in the bore.
    ///
    /// At both ends it is within the play: either free, or on the wall, which pushes. As a rule it is pressed to one side
    /// at the exit and to the other at the entry, and is a beam on two supports. Where that would press it into the wall
    /// behind the entry, it lies on the wall and leaves it at a distance g' before the exit, with neither slope nor moment
    /// there: off the wall by s at the exit its slope is 3 s / g', and its moment 6 EI s / g'^2 = 2 EI slope^2 / (3 s).
    pub fn seat(&self, answer: &Answer) -> Seat {
        let Self {
            length_m,
            play_m,
            rotation_nm,
            shear_n: shear,
            ..
        } = *self;
        let Held {
            slope_by_exit,
            slope_by_moment,
            force_by_exit,
        } = answer.by;
        let bent = answer.slope.norm();
        if bent == 0.0 {
            return Seat {
                exit_m: Vector2::zeros(),
                moment_nm: Vector2::zeros(),
                slope: Vector2::zeros(),
            };
        }
        let mut exit_m = answer.slope * (play_m / bent);
        let mut entry_m = -exit_m;
        let slope_of = |exit_m: Vector2<f64>, entry_m: Vector2<f64>| {
            let chord = (exit_m - entry_m) / length_m;
            (
                answer.slope + exit_m * slope_by_exit + chord * (slope_by_moment * rotation_nm),
                chord,
            )
        };
        // Energy's second derivatives by the displacement at the entry and at the exit.
        let of_entry = shear * (1.0 - slope_by_moment * rotation_nm) / length_m;
        let of_exit = force_by_exit - 2.0 * shear * slope_by_exit + of_entry;
        for _ in 0..ROUNDS {
            let (slope, chord) = slope_of(exit_m, entry_m);
            let now = within(entry_m, (slope - chord) * shear, of_entry, play_m);
            let (slope, chord) = slope_of(exit_m, now);
            let force_n = answer.force_n + exit_m * force_by_exit
                - chord * (rotation_nm * slope_by_exit)
                - (slope - chord) * shear;
            let next = within(exit_m, force_n, of_exit, play_m);
            let change = (now - entry_m).norm() + (next - exit_m).norm();
            (entry_m, exit_m) = (now, next);
            if change <= 1e-9 * play_m {
                break;
            }
        }
        let (mut slope, chord) = slope_of(exit_m, entry_m);
        let mut moment_nm = chord * rotation_nm;
        // Away from the wall at the entry.
        let away = entry_m * (-1.0 / play_m);
        let is_there = play_m > 0.0 && away.norm() > 1.0 - 1e-9;
        if is_there && slope.dot(&away) > 3.0 * chord.dot(&away) {
            let along = [answer.force_n, answer.slope].map(|each| each.dot(&away));
            let on_wall = self.on_wall(along, &answer.by, 0.0);
            exit_m += away * (on_wall.exit_m - exit_m.dot(&away));
            moment_nm += away * (on_wall.moment_nm - moment_nm.dot(&away));
            slope += away * (on_wall.slope - slope.dot(&away));
        }
        Seat {
            exit_m,
            moment_nm,
            slope,
        }
    }

    /// [`Self::seat`] of a needle that is bent along one line, by force and slope there, and where it rested before.
    /// The balance of both ends has a closed form then.
    #[inline(always)]
    pub fn seat_along(&self, [force_n, slope]: [f64; 2], by: &Held, before: &Rest) -> Rest {
        let Self {
            length_m,
            play_m,
            rotation_nm,
            shear_n: shear,
            ..
        } = *self;
        if slope == 0.0 || play_m == 0.0 {
            return Rest {
                exit_m: 0.0,
                moment_nm: 0.0,
                ..*before
            };
        }
        // Energy's derivatives by the displacement at the entry and at the exit: `pull` without any.
        let of_entry = shear * (1.0 - by.slope_by_moment * rotation_nm) / length_m;
        let of_both = shear * by.slope_by_exit - of_entry;
        let of_exit = by.force_by_exit - 2.0 * shear * by.slope_by_exit + of_entry;
        let pull = [slope * shear, force_n - slope * shear];
        let moved = |pull_n: f64, stiffness_n_m: f64| {
            if stiffness_n_m * play_m > pull_n.abs() {
                -pull_n / stiffness_n_m
            } else {
                -play_m.copysign(pull_n)
            }
        };
        let entry = |exit_m: f64| moved(pull[0] + of_both * exit_m, of_entry);
        // With the entry wherever it comes to rest, the force at the exit rises with its displacement.
        let pressed = [play_m, -play_m]
            .into_iter()
            .find(|exit_m| (pull[1] + of_both * entry(*exit_m) + of_exit * exit_m) * exit_m <= 0.0);
        let [entry_m, exit_m] = if let Some(exit_m) = pressed {
            [entry(exit_m), exit_m]
        } else {
            let both = of_entry * of_exit - of_both * of_both;
            let entry_m = moved(of_exit * pull[0] - of_both * pull[1], both);
            [entry_m, moved(pull[1] + of_both * entry_m, of_exit)]
        };
        let chord = (exit_m - entry_m) / length_m;
        let moment_nm = chord * rotation_nm;
        let side = 1.0_f64.copysign(-entry_m);
        let bent = slope + by.slope_by_exit * exit_m + by.slope_by_moment * moment_nm;
        if entry_m.abs() < play_m || bent * side <= 3.0 * chord * side {
            return Rest {
                side,
                exit_m,
                moment_nm,
            };
        }
        self.lying(side, [force_n, slope], by, before)
    }

    /// The same of a needle that lies on the wall from the entry on, away from which is `side`.
    #[inline(always)]
    pub fn lying(&self, side: f64, [force_n, slope]: [f64; 2], by: &Held, before: &Rest) -> Rest {
        let OnWall {
            exit_m, moment_nm, ..
        } = self.on_wall([force_n * side, slope * side], by, before.exit_m * side);
        Rest {
            side,
            exit_m: exit_m * side,
            moment_nm: moment_nm * side,
        }
    }

    /// A needle that lies on the wall from the entry on, with its exit on the other wall or before it, where it is looked
    /// for from `start_m` on; force and slope along the direction away from the first wall.
    #[inline(always)]
    fn on_wall(&self, along: [f64; 2], by: &Held, start_m: f64) -> OnWall {
        let (found, held_n, _) = self.lifted(self.play_m, along, by);
        if held_n <= 0.0 {
            found
        } else {
            self.before_wall(along, by, start_m)
        }
    }

    /// The same where the wall at the exit would have to pull: by Newton's method, or halves where that leads out.
    #[inline(never)]
    fn before_wall(&self, along: [f64; 2], by: &Held, start_m: f64) -> OnWall {
        let (mut low_m, mut high_m) = (-self.play_m, self.play_m);
        let mut exit_m = if start_m.abs() < self.play_m {
            start_m
        } else {
            0.0
        };
        let mut number = 0;
        loop {
            let (found, held_n, by_exit) = self.lifted(exit_m, along, by);
            if held_n > 0.0 {
                high_m = exit_m;
            } else {
                low_m = exit_m;
            }
            let change_m = -held_n / by_exit;
            number += 1;
            if change_m.abs() <= EXIT * self.play_m || number == STEPS {
                return found;
            }
            exit_m += change_m;
            if !(low_m..=high_m).contains(&exit_m) {
                exit_m = 0.5 * (low_m + high_m);
            }
        }
    }

    /// A needle that lies on the wall from the entry on, with its exit at a displacement: what has to hold it there, N,
    /// and how that grows with the displacement, N/m.
    #[inline(always)]
    fn lifted(&self, exit_m: f64, [force_n, slope]: [f64; 2], by: &Held) -> (OnWall, f64, f64) {
        let by_off = 1.0 / (exit_m + self.play_m);
        // slope = bare + by_moment (rotation slope - 2 EI slope^2 / (3 off))
        let bare = (slope + by.slope_by_exit * exit_m).max(0.0);
        let bend = self.bending_nm2 * by_off / 1.5;
        let b = 1.0 - by.slope_by_moment * self.rotation_nm;
        let root = (b * b + 4.0 * by.slope_by_moment * bend * bare).sqrt();
        let slope = if bare > 0.0 {
            2.0 * bare / (b + root)
        } else {
            0.0
        };
        let wall_nm = bend * slope * slope;
        let moment_nm = self.rotation_nm * slope - wall_nm;
        let lift_n = wall_nm * slope * by_off / 3.0;
        let held_n = force_n + by.force_by_exit * exit_m - by.slope_by_exit * moment_nm - lift_n;
        // The same by the displacement.
        let turn = (by.slope_by_exit + by.slope_by_moment * wall_nm * by_off) / root;
        let wall = bend * slope * (2.0 * turn - slope * by_off);
        let lift = bend * slope * slope * by_off * (turn - slope * by_off * (2.0 / 3.0));
        let by_exit = by.force_by_exit - by.slope_by_exit * (self.rotation_nm * turn - wall) - lift;
        let found = OnWall {
            exit_m,
            moment_nm,
            slope,
        };
        (found, held_n, by_exit)
    }
}

/// Along one direction.
#[derive(Clone, Copy)]
struct OnWall {
    exit_m: f64,
    moment_nm: f64,
    slope: f64,
}

/// A place that a force moves until nothing of it is left, or until the wall bears it.
fn within(
    at_m: Vector2<f64>,
    force_n: Vector2<f64>,
    stiffness_n_m: f64,
    play_m: f64,
) -> Vector2<f64> {
    let free = if stiffness_n_m > 0.0 {
        at_m - force_n / stiffness_n_m
    } else if force_n.norm() > 0.0 {
        force_n * (-play_m / force_n.norm())
    } else {
        at_m
    };
    let far = free.norm();
    if far > play_m {
        free * (play_m / far)
    } else {
        free
    }
}
