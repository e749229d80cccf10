//! A needle and what holds it, from a file or from the command line.

use needlebench_input::schema::written;
use needlebench_insertion::{Gauge, Guide, Holder, Needle, STEEL_PA};

/// The widest play of a needle in its bore, to each side, mm.
const MOST_PLAY_MM: f64 = 1.0;

/// Sizes of a needle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    pub gauge: Option<u8>,
    pub outer_mm: Option<f64>,
    pub inner_mm: Option<f64>,
    pub has_stylet: bool,
    pub young_gpa: Option<f64>,
}

/// What holds a needle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum By {
    Guide,
    Hub,
    Clamp,
}

/// How it is held.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hold {
    pub by: By,
    pub guide_length_mm: Option<f64>,
    pub bore_mm: Option<f64>,
    pub standoff_mm: Option<f64>,
    pub needle_length_mm: Option<f64>,
}

/// What is wrong with them, at the key without its section.
#[derive(Debug)]
pub(super) struct Wrong {
    pub key: &'static str,
    pub message: String,
    pub hint: String,
}

fn wrong(key: &'static str, message: impl Into<String>, hint: impl Into<String>) -> Wrong {
    Wrong {
        key,
        message: message.into(),
        hint: hint.into(),
    }
}

impl Sizes {
    /// The needle.
    pub fn needle(&self) -> Result<Needle, Wrong> {
        const SIZE: &str = "give the gauge, 16 to 22, or the outer diameter in mm";
        let mut needle = match (self.gauge, self.outer_mm) {
            (Some(_), Some(_)) => {
                return Err(wrong(
                    "outer_mm",
                    "the needle has a gauge and an outer diameter",
                    "keep one of them; the inner diameter may stand beside a gauge, for thin walls",
                ));
            }
            (None, None) => return Err(wrong("gauge", "the needle has no size", SIZE)),
            (Some(number), None) => {
                let unknown = || {
                    let message = format!("a gauge of {number} is not in the chart");
                    wrong("gauge", message, SIZE)
                };
                Gauge::new(number).ok_or_else(unknown)?.needle()
            }
            (None, Some(outer_mm)) => {
                if !self.has_stylet && self.inner_mm.is_none() {
                    return Err(wrong(
                        "inner_mm",
                        "without its stylet a needle is as stiff as its wall, and no inner diameter is given",
                        "give the inner diameter, mm, or a gauge",
                    ));
                }
                Needle {
                    outer_m: 1e-3 * outer_mm,
                    inner_m: 0.0,
                    has_stylet: true,
                    young_pa: STEEL_PA,
                }
            }
        };
        needle.has_stylet = self.has_stylet;
        if let Some(inner_mm) = self.inner_mm {
            needle.inner_m = 1e-3 * inner_mm;
        }
        if let Some(young_gpa) = self.young_gpa {
            needle.young_pa = 1e9 * young_gpa;
        }
        if needle.inner_m >= needle.outer_m {
            let message = format!(
                "an inner diameter of {} mm in a needle of {} mm",
                in_mm(needle.inner_m),
                in_mm(needle.outer_m)
            );
            let hint = "the inner diameter is below the outer one";
            return Err(wrong("inner_mm", message, hint));
        }
        Ok(needle)
    }
}

impl Hold {
    /// What holds a needle whose tip gets to a depth, and the distance of it from the skin, m.
    pub fn holder(&self, needle: &Needle, depth_m: f64) -> Result<(Holder, f64), Wrong> {
        let missing =
            |key, what: &str| wrong(key, format!("{what} is not given"), "give it, in mm");
        let not_of = |key, value: Option<f64>, what: &str| match value {
            Some(_) => Err(wrong(
                key,
                what,
                "remove it, or change what holds the needle",
            )),
            None => Ok(()),
        };
        let standoff_m = || {
            let what = "the distance from guide or clamp to the skin";
            let standoff_mm = self
                .standoff_mm
                .ok_or_else(|| missing("standoff_mm", what))?;
            Ok(1e-3 * standoff_mm)
        };
        if self.by != By::Guide {
            let what = "it is of a guide, and none holds the needle";
            not_of("guide_length_mm", self.guide_length_mm, what)?;
            not_of("bore_mm", self.bore_mm, what)?;
        }
        if self.by != By::Hub {
            let what = "it is for a needle that is held at its hub";
            not_of("needle_length_mm", self.needle_length_mm, what)?;
        }
        match self.by {
            By::Clamp => Ok((Holder::Clamp, standoff_m()?)),
            By::Hub => {
                let what = "a hub moves on with the needle: its distance from the skin follows from the length";
                not_of("standoff_mm", self.standoff_mm, what)?;
                let length_mm = self.needle_length_mm.ok_or_else(|| {
                    missing(
                        "needle_length_mm",
                        "the length of the needle from hub to tip",
                    )
                })?;
                if 1e-3 * length_mm <= depth_m {
                    let message = format!(
                        "the needle is {} mm long, and its tip is to be {} mm behind the skin",
                        written(length_mm),
                        in_mm(depth_m)
                    );
                    let hint =
                        "the hub stays outside: the length from hub to tip is above the depth";
                    return Err(wrong("needle_length_mm", message, hint));
                }
                Ok((Holder::Hub(1e-3 * length_mm), 0.0))
            }
            By::Guide => {
                let length_mm = self
                    .guide_length_mm
                    .ok_or_else(|| missing("guide_length_mm", "the length of the guide's bore"))?;
                let bore_mm = self
                    .bore_mm
                    .ok_or_else(|| missing("bore_mm", "the diameter of the guide's bore"))?;
                let outer_mm = 1e3 * needle.outer_m;
                let play_mm = 0.5 * (bore_mm - outer_mm);
                if !(play_mm > 0.0 && play_mm <= MOST_PLAY_MM) {
                    let message = format!(
                        "a bore of {} mm for a needle of {} mm",
                        written(bore_mm),
                        in_mm(needle.outer_m)
                    );
                    let hint = if play_mm > 0.0 {
                        format!("a guide has at most {MOST_PLAY_MM} mm of play to each side")
                    } else {
                        "the needle does not fit: the bore is wider than the needle".to_owned()
                    };
                    return Err(wrong("bore_mm", message, hint));
                }
                let guide = Guide {
                    length_m: 1e-3 * length_mm,
                    play_m: 1e-3 * play_mm,
                };
                Ok((Holder::Guide(guide), standoff_m()?))
            }
        }
    }
}

/// A length in mm, without the digits that conversion makes.
pub(super) fn in_mm(length_m: f64) -> String {
    written((length_m * 1e9).round() / 1e6)
}
