//! Which unit a file is in: its size says whether the stated one can be right.

use nalgebra::Vector3;

use crate::scenario::{LengthUnit, PartTissue};

impl LengthUnit {
    const ALL: [Self; 4] = [Self::Mm, Self::Cm, Self::M, Self::In];

    fn words(self) -> &'static str {
        match self {
            Self::Mm => "millimetres",
            Self::Cm => "centimetres",
            Self::M => "metres",
            Self::In => "inches",
        }
    }
}

impl PartTissue {
    /// Longest edge of the box around such a part: least, usual and most, mm. Wide, as parts may be cut
    /// off or joined; still, one in a wrong unit is mostly outside.
    pub fn sizes_mm(self) -> [f64; 3] {
        match self {
            // From half a chest of a child to a whole tall person.
            Self::Skin => [120.0, 400.0, 2200.0],
            // From one piece of a rib to a spine with its ribs.
            Self::Bone => [8.0, 250.0, 1200.0],
            Self::Vessel => [5.0, 150.0, 1000.0],
            Self::Organ => [15.0, 150.0, 600.0],
            Self::Lung => [60.0, 250.0, 500.0],
            Self::Lesion => [1.0, 20.0, 250.0],
            Self::Beside | Self::Assumed => [10.0, 500.0, 3000.0],
        }
    }
}

/// What something is, and how large such a thing is.
pub(super) struct Kind {
    subject: &'static str,
    noun: &'static str,
    /// Longest edge of the box around it: least, usual and most, mm.
    sizes_mm: [f64; 3],
    /// Whether a smaller one may be meant, if the unit is stated.
    may_be_smaller: bool,
}

impl Kind {
    pub(super) fn part(tissue: PartTissue) -> Self {
        Self {
            subject: "the part",
            noun: match tissue {
                PartTissue::Skin => "a skin",
                PartTissue::Bone => "a bone",
                PartTissue::Vessel => "a vessel",
                PartTissue::Organ => "an organ",
                PartTissue::Lung => "a lung",
                PartTissue::Lesion => "a lesion",
                PartTissue::Beside => "something beside the patient",
                PartTissue::Assumed => "an assumed piece of the body",
            },
            sizes_mm: tissue.sizes_mm(),
            may_be_smaller: false,
        }
    }

    /// Something in a room. Of a file whose unit nobody has stated the thing is no speck: 1 m is 39 inches, and 39 mm if
    /// it is taken for millimetres.
    pub(super) fn obstacle(is_stated: bool) -> Self {
        Self {
            subject: "the obstacle",
            noun: "a thing in a room",
            sizes_mm: [if is_stated { 5.0 } else { 100.0 }, 1000.0, 20_000.0],
            may_be_smaller: !is_stated,
        }
    }
}

/// Message and hint about something from a file, if its size cannot be right in the stated unit. `size` is in the file's
/// numbers.
pub(super) fn wrong_unit(
    kind: &Kind,
    stated: LengthUnit,
    size: &Vector3<f64>,
) -> Option<(String, String)> {
    let &Kind {
        subject,
        noun,
        sizes_mm: [least_mm, usual_mm, most_mm],
        may_be_smaller,
    } = kind;
    let millimetres = |unit: LengthUnit| size.max() * unit.metres() * 1e3;
    let fits = |unit: &LengthUnit| (least_mm..=most_mm).contains(&millimetres(*unit));
    if fits(&stated) {
        return None;
    }
    let box_of = |unit: LengthUnit| {
        let mm = size * (unit.metres() * 1e3);
        format!(
            "{} x {} x {} mm",
            Rounded(mm.x),
            Rounded(mm.y),
            Rounded(mm.z)
        )
    };
    let message = format!(
        "in {} {subject} is {}, but {noun} is {least_mm} to {most_mm} mm",
        stated.words(),
        box_of(stated),
    );
    let smaller = if may_be_smaller && millimetres(stated) < least_mm {
        format!("; if it is that small, set unit = \"{}\"", stated.key())
    } else {
        String::new()
    };
    let mut likely: Vec<LengthUnit> = LengthUnit::ALL.into_iter().filter(fits).collect();
    let unlikeness = |unit: LengthUnit| libm::log(millimetres(unit) / usual_mm).abs();
    likely.sort_by(|a, b| unlikeness(*a).total_cmp(&unlikeness(*b)));
    Some(match likely.split_first() {
        None => (
            message,
            format!("no usual unit makes it plausible: is it the right file?{smaller}"),
        ),
        Some((&best, others)) => {
            let others: Vec<String> = others
                .iter()
                .map(|&unit| format!("; {} would make it {}", unit.words(), box_of(unit)))
                .collect();
            (
                format!(
                    "{message}: it looks like {} ({})",
                    best.words(),
                    box_of(best)
                ),
                format!("set unit = \"{}\"{}{smaller}", best.key(), others.concat()),
            )
        }
    })
}

/// To three digits or so.
struct Rounded(f64);

impl std::fmt::Display for Rounded {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = if self.0.abs() < 1.0 {
            3
        } else {
            usize::from(self.0.abs() < 100.0)
        };
        write!(formatter, "{:.digits$}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guess(tissue: PartTissue, stated: LengthUnit, size: [f64; 3]) -> Option<(String, String)> {
        wrong_unit(&Kind::part(tissue), stated, &Vector3::from(size))
    }

    #[test]
    fn plausible_sizes_pass() {
        for (tissue, size) in [
            (PartTissue::Skin, [330.0, 230.0, 500.0]),
            (PartTissue::Bone, [60.0, 9.0, 9.0]),
            (PartTissue::Lesion, [8.0, 8.0, 9.0]),
            (PartTissue::Lung, [150.0, 200.0, 260.0]),
        ] {
            assert_eq!(guess(tissue, LengthUnit::Mm, size), None);
        }
        assert_eq!(
            guess(PartTissue::Skin, LengthUnit::Cm, [33.0, 23.0, 50.0]),
            None
        );
    }

    #[test]
    fn centimetres_and_metres_are_guessed_and_not_assumed() {
        let (message, hint) = guess(PartTissue::Skin, LengthUnit::Mm, [32.0, 21.0, 40.0]).unwrap();
        assert!(message.contains("is 32.0 x 21.0 x 40.0 mm"), "{message}");
        assert!(
            message.contains("looks like centimetres (320 x 210 x 400 mm)"),
            "{message}"
        );
        assert!(
            hint.starts_with("set unit = \"cm\"; inches would"),
            "{hint}"
        );
        let (_, hint) = guess(PartTissue::Skin, LengthUnit::Mm, [0.32, 0.21, 0.4]).unwrap();
        assert_eq!(hint, "set unit = \"m\"");
        let (_, hint) = guess(PartTissue::Skin, LengthUnit::M, [320.0, 210.0, 400.0]).unwrap();
        assert_eq!(hint, "set unit = \"mm\"");
        let (_, hint) = guess(PartTissue::Lesion, LengthUnit::Mm, [0.02, 0.018, 0.02]).unwrap();
        assert_eq!(hint, "set unit = \"m\"");
    }

    #[test]
    fn size_that_no_unit_explains_is_told_too() {
        let (message, hint) = guess(PartTissue::Skin, LengthUnit::Mm, [1e-6; 3]).unwrap();
        assert!(!message.contains("looks like"), "{message}");
        assert!(hint.contains("right file"), "{hint}");
    }

    #[test]
    fn things_that_would_be_specks_are_asked_about() {
        let guess = |is_stated, stated, size: [f64; 3]| {
            wrong_unit(&Kind::obstacle(is_stated), stated, &Vector3::from(size))
        };
        // A C-arm in metres, and in inches.
        let (message, hint) = guess(false, LengthUnit::Mm, [0.9, 0.3, 1.4]).unwrap();
        assert!(
            message.contains("looks like metres (900 x 300 x 1400 mm)"),
            "{message}"
        );
        assert!(
            hint.starts_with("set unit = \"m\"") && hint.ends_with("unit = \"mm\""),
            "{hint}"
        );
        let (_, hint) = guess(false, LengthUnit::Mm, [35.4, 11.8, 55.1]).unwrap();
        assert!(hint.starts_with("set unit = \"in\""), "{hint}");
        assert_eq!(guess(true, LengthUnit::Mm, [35.4, 11.8, 55.1]), None);
        // What no room has, whoever states it.
        assert!(guess(true, LengthUnit::Mm, [0.9, 0.3, 1.4]).is_some());
        assert!(guess(true, LengthUnit::M, [900.0, 300.0, 1400.0]).is_some());
        assert_eq!(guess(false, LengthUnit::Mm, [900.0, 300.0, 1400.0]), None);
    }
}
