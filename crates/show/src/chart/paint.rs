//! Colours and strokes.

/// Red, green, blue (sRGB).
pub type Rgb = [u8; 3];

/// Between two colours: the first at 0, the second at 1.
pub fn mixed([first, second]: [Rgb; 2], share: f64) -> Rgb {
    std::array::from_fn(|channel| {
        let (a, b) = (f64::from(first[channel]), f64::from(second[channel]));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between two bytes"
        )]
        let mixed = (a + (b - a) * share).round() as u8;
        mixed
    })
}

/// Colours that people with any colour vision tell apart (Okabe and Ito 2008), the darker ones first:
/// they stand out from a white page.
const SERIES: [Rgb; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [90, 96, 104],
    [230, 159, 0],
    [86, 180, 233],
    [240, 228, 66],
];

/// What something is drawn in. A file shows the colour; a page with a style sheet of its own may
/// give each of them another, for a dark screen for example.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paint {
    /// Text and frames.
    Ink,
    /// Axes and what is said beside.
    Soft,
    /// Lines of a grid.
    Grid,
    /// What the chart stands on.
    Page,
    /// What curves are drawn on.
    Paper,
    /// One of several that are to be told apart; there are eight, and then again from the first.
    Series(usize),
    /// A limit that is not to be passed.
    Limit,
    /// A colour that means something by itself.
    Fixed(Rgb),
}

impl Paint {
    /// The colour in a file.
    pub fn rgb(self) -> Rgb {
        match self {
            Self::Ink => [25, 30, 38],
            Self::Soft => [110, 117, 126],
            Self::Grid => [222, 225, 230],
            Self::Page | Self::Paper => [255, 255, 255],
            Self::Series(index) => SERIES[index % SERIES.len()],
            Self::Limit => [196, 30, 58],
            Self::Fixed(rgb) => rgb,
        }
    }

    /// Name of the custom property of a page's style sheet that has the colour.
    pub(super) fn property(self) -> Option<String> {
        match self {
            Self::Ink => Some("--text".to_owned()),
            Self::Soft => Some("--soft".to_owned()),
            Self::Grid => Some("--rule".to_owned()),
            Self::Page | Self::Paper => Some("--page".to_owned()),
            Self::Limit => Some("--bad".to_owned()),
            Self::Series(index) => Some(format!("--s{}", index % SERIES.len())),
            Self::Fixed(_) => None,
        }
    }
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Its colour.
    pub paint: Paint,
    /// px.
    pub width: f64,
    /// px drawn and px left out in turn; none for a full line.
    pub dash: Option<[f64; 2]>,
}

impl Stroke {
    /// A full line.
    pub fn full(paint: Paint, width: f64) -> Self {
        Self {
            paint,
            width,
            dash: None,
        }
    }

    /// A broken line.
    pub fn dashed(paint: Paint, width: f64) -> Self {
        Self {
            dash: Some([5.0, 4.0]),
            ..Self::full(paint, width)
        }
    }
}

/// Curves that lie on top of each other: the engines of a run, of which any number may agree to the
/// pixel. Each has a colour, and is narrower than the one below it, so that all of them show; beyond
/// the eighth they are broken too.
#[derive(Debug, Clone, Copy)]
pub struct Overlay {
    /// How many there are.
    pub count: usize,
}

impl Overlay {
    const WIDEST: f64 = 4.0;
    const NARROWEST: f64 = 1.4;

    fn width(self, index: usize) -> f64 {
        let steps = self.count.saturating_sub(1).max(1);
        let down = index.min(steps) as f64 / steps as f64;
        if self.count < 2 {
            0.5 * (Self::WIDEST + Self::NARROWEST)
        } else {
            Self::WIDEST + down * (Self::NARROWEST - Self::WIDEST)
        }
    }

    /// Line of the curve with an index.
    pub fn stroke(self, index: usize) -> Stroke {
        let stroke = Stroke::full(Paint::Series(index), self.width(index));
        let turn = (index / SERIES.len()) as f64;
        Stroke {
            dash: (turn > 0.0).then_some([8.0 / turn, 4.0]),
            ..stroke
        }
    }

    /// Radius of its marks, px.
    pub fn radius(self, index: usize) -> f64 {
        1.2 + self.width(index)
    }
}

/// Seen by somebody without red (protanopia) or without green (deuteranopia) receptors:
/// matrices of Viénot, Brettel and Mollon 1999, on linear light.
const VISIONS: [[[f64; 3]; 3]; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.112_38, 0.887_62, 0.0],
        [0.112_38, 0.887_62, 0.0],
        [0.004_01, -0.004_01, 1.0],
    ],
    [
        [0.292_75, 0.707_25, 0.0],
        [0.292_75, 0.707_25, 0.0],
        [-0.022_34, 0.022_34, 1.0],
    ],
];

fn seen(rgb: Rgb, vision: &[[f64; 3]; 3]) -> [f64; 3] {
    let light = rgb.map(|byte| libm::pow(f64::from(byte) / 255.0, 2.2));
    std::array::from_fn(|row| {
        let mixed: f64 = (0..3).map(|k| vision[row][k] * light[k]).sum();
        libm::pow(mixed.max(0.0), 1.0 / 2.2)
    })
}

/// Two colours that somebody takes for one another, whatever the colour vision: full, without red or without green
/// receptors.
pub fn confused(colors: &[Rgb]) -> Option<[Rgb; 2]> {
    /// Two greys that are 20 of 255 apart are told apart side by side.
    const LEAST: f64 = 20.0 / 255.0 * 1.732;
    let apart = |vision, [a, b]: [Rgb; 2]| {
        let (x, y) = (seen(a, vision), seen(b, vision));
        (0..3).map(|k| (x[k] - y[k]).powi(2)).sum::<f64>().sqrt()
    };
    VISIONS.iter().find_map(|vision| {
        let mut pairs = colors.iter().enumerate().flat_map(|(index, a)| {
            let others = colors[..index].iter();
            others.map(move |b| [*a, *b])
        });
        pairs.find(|pair| apart(vision, *pair) <= LEAST)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_told_apart_with_any_colour_vision() {
        assert_eq!(confused(&SERIES), None);
    }

    #[test]
    fn any_number_of_engines_has_lines_of_its_own() {
        for count in [1, 2, 3, 20] {
            let overlay = Overlay { count };
            let strokes: Vec<Stroke> = (0..count).map(|index| overlay.stroke(index)).collect();
            for a in 0..count {
                for b in 0..a {
                    let same = strokes[a].paint.rgb() == strokes[b].paint.rgb()
                        && strokes[a].dash == strokes[b].dash;
                    assert!(!same, "{a} and {b} of {count}");
                }
            }
            assert!(strokes.windows(2).all(|pair| pair[1].width < pair[0].width));
        }
    }
}
