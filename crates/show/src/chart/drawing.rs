//! A chart as a value: marks in the plane, in the order in which they lie on each other.

use needlebench_render::TextSize;

use super::paint::{Paint, Stroke};

/// Size of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Axes and legends.
    Small,
    /// Titles.
    Large,
}

impl Size {
    pub(super) fn font(self) -> TextSize {
        match self {
            Self::Small => TextSize::SMALL,
            Self::Large => TextSize::LARGE,
        }
    }

    /// Height of a line, px.
    pub fn line(self) -> f64 {
        self.font().line_px() as f64
    }

    /// Width of a text, px.
    pub fn width(self, text: &str) -> f64 {
        self.font().extent_px(text)[0] as f64
    }
}

/// Where a text stands from its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// Text in one line.
#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// The point: x by `anchor`, y the middle of the line. px.
    pub at: [f64; 2],
    /// Where the text stands from it.
    pub anchor: Anchor,
    /// Its size.
    pub size: Size,
    /// Turned to run upwards, about its point.
    pub upwards: bool,
    /// The text.
    pub text: String,
}

impl Text {
    /// Upper left and lower right corner, px.
    pub fn corners(&self) -> [[f64; 2]; 2] {
        let (width, half) = (self.size.width(&self.text), 0.5 * self.size.line());
        let before = match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5 * width,
            Anchor::End => width,
        };
        let [x, y] = self.at;
        if self.upwards {
            [[x - half, y - width + before], [x + half, y + before]]
        } else {
            [[x - before, y - half], [x - before + width, y + half]]
        }
    }
}

/// Something that is drawn. Places and sizes are in px, from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A filled rectangle.
    Rectangle {
        /// Upper left corner.
        corner: [f64; 2],
        /// Width and height.
        size: [f64; 2],
        /// Its colour.
        fill: Paint,
    },
    /// The edge of a rectangle.
    Frame {
        /// Upper left corner.
        corner: [f64; 2],
        /// Width and height.
        size: [f64; 2],
        /// Its line.
        paint: Paint,
    },
    /// A line through points.
    Line {
        /// The points, all finite.
        points: Vec<[f64; 2]>,
        /// Its look.
        stroke: Stroke,
    },
    /// A filled polygon, convex.
    Polygon {
        /// Its corners, in turn.
        points: Vec<[f64; 2]>,
        /// Its colour.
        fill: Paint,
    },
    /// A filled disc.
    Disc {
        /// Its middle.
        centre: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Its colour.
        fill: Paint,
    },
    /// A circle.
    Circle {
        /// Its middle.
        centre: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Its line.
        stroke: Stroke,
    },
    /// A text.
    Text(Text),
}

/// A finished chart: `Chart::to_svg` and `Chart::to_image` draw it.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Width and height, px.
    pub size: [f64; 2],
    /// What it shows, for those who do not see it.
    pub title: String,
    /// The marks, each with what a pointer over it is told, if anything.
    pub marks: Vec<(Mark, Option<String>)>,
}

impl Chart {
    /// An empty chart.
    pub fn new(size: [f64; 2], title: impl Into<String>) -> Self {
        Self {
            size,
            title: title.into(),
            marks: Vec::new(),
        }
    }

    /// Adds a mark.
    pub fn add(&mut self, mark: Mark) {
        self.marks.push((mark, None));
    }

    /// Adds a mark that says more to a pointer over it.
    pub fn add_with_tip(&mut self, mark: Mark, tip: impl Into<String>) {
        self.marks.push((mark, Some(tip.into())));
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, corner: [f64; 2], size: [f64; 2], fill: Paint) {
        self.add(Mark::Rectangle { corner, size, fill });
    }

    /// Draws the edge of a rectangle.
    pub fn frame(&mut self, corner: [f64; 2], size: [f64; 2], paint: Paint) {
        self.add(Mark::Frame {
            corner,
            size,
            paint,
        });
    }

    /// Draws a straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], stroke: Stroke) {
        self.add(Mark::Line {
            points: vec![from, to],
            stroke,
        });
    }

    /// Fills a disc.
    pub fn disc(&mut self, centre: [f64; 2], radius: f64, fill: Paint) {
        self.add(Mark::Disc {
            centre,
            radius,
            fill,
        });
    }

    /// Draws a circle.
    pub fn circle(&mut self, centre: [f64; 2], radius: f64, stroke: Stroke) {
        self.add(Mark::Circle {
            centre,
            radius,
            stroke,
        });
    }

    /// Writes a line of text; `at` is where it begins, ends or has its middle, at half its height.
    pub fn write(&mut self, anchor: Anchor, at: [f64; 2], text: impl Into<String>) {
        self.add(Mark::Text(Text {
            at,
            anchor,
            size: Size::Small,
            upwards: false,
            text: text.into(),
        }));
    }

    /// Writes a title that begins at a point.
    pub fn write_large(&mut self, at: [f64; 2], text: impl Into<String>) {
        self.add(Mark::Text(Text {
            at,
            anchor: Anchor::Start,
            size: Size::Large,
            upwards: false,
            text: text.into(),
        }));
    }

    /// Writes a line of text that runs upwards, with its middle at a point.
    pub fn write_upwards(&mut self, at: [f64; 2], text: impl Into<String>) {
        self.add(Mark::Text(Text {
            at,
            anchor: Anchor::Middle,
            size: Size::Small,
            upwards: true,
            text: text.into(),
        }));
    }

    /// All texts.
    pub fn texts(&self) -> impl Iterator<Item = &Text> {
        self.marks.iter().filter_map(|(mark, _)| match mark {
            Mark::Text(text) => Some(text),
            _ => None,
        })
    }

    /// Why it cannot be read, if it cannot: nothing is written, or a text leaves the chart or covers another.
    pub fn illegible(&self) -> Option<String> {
        let texts: Vec<&Text> = self.texts().filter(|text| !text.text.is_empty()).collect();
        if texts.is_empty() {
            return Some("nothing is written".to_owned());
        }
        texts.iter().enumerate().find_map(|(index, text)| {
            let [[left, top], [right, bottom]] = text.corners();
            let inside =
                left >= 0.0 && top >= 0.0 && right <= self.size[0] && bottom <= self.size[1];
            if !inside {
                return Some(format!("`{}` leaves the chart", text.text));
            }
            texts[..index].iter().find_map(|other| {
                let [[l, t], [r, b]] = other.corners();
                let apart = right <= l || r <= left || bottom <= t || b <= top;
                (!apart).then(|| format!("`{}` covers `{}`", text.text, other.text))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(anchor: Anchor, upwards: bool) -> Text {
        Text {
            at: [100.0, 200.0],
            anchor,
            size: Size::Small,
            upwards,
            text: "four".to_owned(),
        }
    }

    #[test]
    fn corners_are_those_of_the_turned_text() {
        let width = Size::Small.width("four");
        assert_eq!(
            text(Anchor::End, false).corners(),
            [[100.0 - width, 192.0], [100.0, 208.0]]
        );
        assert_eq!(
            text(Anchor::Start, true).corners(),
            [[92.0, 200.0 - width], [108.0, 200.0]]
        );
    }
}
