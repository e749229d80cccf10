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

/// What the rest of the needle answers at the exit: its slope is `slope + by_exit * displacement + by_moment * moment`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answer {
    pub slope: Vector2<f64>,
    pub by_exit: f64,
    pub by_moment: f64,
}

impl Guide {
    /// Stiffness against rotation at the exit of a beam on two supports, N m.
    pub(crate) fn rotation_nm(&self, bending_nm2: f64) -> f64 {
        3.0 * bending_nm2 / self.length_m
    }

    /// Slope of the needle where it leans on one wall at the entry and on the other at the exit.
    pub(crate) fn lean(&self) -> f64 {
        2.0 * self.play_m / self.length_m
    }

    /// Where the needle comes to rest in the bore.
    ///
    /// The force on the tip presses it to one side at the exit and to the other at the entry. With a slope at the exit
    /// below 6 play / length it is a beam on two supports; above, it lies on the wall from the entry on and leaves it at a
    /// distance g' before the exit, with neither slope nor moment there, so that the slope is 6 play / g' and the moment
    /// 12 EI play / g'^2 = EI slope^2 / (3 play). Without enough force to lean on both it is free to turn.
    pub(crate) fn seat(&self, bending_nm2: f64, answer: &Answer) -> Seat {
        let Self { length_m, play_m } = *self;
        let rotation_nm = self.rotation_nm(bending_nm2);
        let bent = answer.slope.norm();
        if bent == 0.0 {
            return Seat {
                exit_m: Vector2::zeros(),
                moment_nm: Vector2::zeros(),
                slope: Vector2::zeros(),
            };
        }
        let along = answer.slope / bent;
        // By the play at the exit alone.
        let bare = bent + answer.by_exit * play_m;
        let leaning_nm = rotation_nm * self.lean();
        let mut slope = bare + answer.by_moment * leaning_nm;
        let mut moment_nm = leaning_nm;
        if slope < self.lean() {
            // No moment at all: what the spring takes is given back.
            slope = bare / (1.0 - answer.by_moment * rotation_nm);
            moment_nm = rotation_nm * slope;
        } else if play_m > 0.0 && slope > 6.0 * play_m / length_m {
            // slope = bare + by_moment (rotation slope - EI slope^2 / (3 play))
            let a = answer.by_moment * bending_nm2 / (3.0 * play_m);
            let b = 1.0 - answer.by_moment * rotation_nm;
            slope = 2.0 * bare / (b + (b * b + 4.0 * a * bare).sqrt());
            moment_nm = rotation_nm * slope - bending_nm2 * slope * slope / (3.0 * play_m);
        }
        Seat {
            exit_m: along * play_m,
            moment_nm: along * moment_nm,
            slope: along * slope,
        }
    }
}
