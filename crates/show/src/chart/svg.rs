//! The back end for vector graphics.
//!
//! Texts are in a fixed-width font of the same advance as the one of the raster back end, whichever
//! the reader has, so what does not overlap there does not overlap here.

use std::fmt::Write;

use quick_xml::escape::escape;

use super::drawing::{Anchor, Chart, Mark, Size, Text};
use super::paint::{Paint, Stroke};

/// Fonts with an advance of 0.6 of their size.
const FONTS: &str = "'Noto Sans Mono','DejaVu Sans Mono','Liberation Mono',Menlo,monospace";
/// Advance of a character over the size of the font.
const ADVANCE: f64 = 0.6;
/// Height of the middle of a line over its base line, by the height of the line.
const MIDDLE: f64 = 0.26;

impl Chart {
    /// The chart as an SVG file that needs nothing else.
    pub fn to_svg(&self) -> String {
        let [width, height] = self.size.map(number);
        let opening = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"{FONTS}\" font-size=\"{}\">\n\
             <title>{}</title>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>\n",
            number(font_size(Size::Small)),
            escape(&self.title),
            hex(Paint::Page)
        );
        self.finish(opening, "\n", hex)
    }

    /// The chart as an element of a page whose style sheet gives the font and may give the colours,
    /// in custom properties: `--text`, `--soft`, `--rule`, `--page`, `--bad`, `--s0` to `--s7`.
    pub fn to_inline_svg(&self) -> String {
        let [width, height] = self.size.map(number);
        let opening = format!(
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\" \
             style=\"max-width:{width}px\">",
            escape(&self.title)
        );
        self.finish(opening, "", |paint| match paint.property() {
            Some(name) => format!("var({name},{})", hex(paint)),
            None => hex(paint),
        })
    }

    fn finish(&self, mut out: String, gap: &str, color: impl Fn(Paint) -> String) -> String {
        for (mark, tip) in &self.marks {
            let (name, attributes, inside) = element(mark, &color);
            let tip = tip.as_deref().map_or(String::new(), |tip| {
                format!("<title>{}</title>", escape(tip))
            });
            // Writing to a String cannot fail.
            let _ = if inside.is_empty() && tip.is_empty() {
                write!(out, "<{name} {attributes}/>{gap}")
            } else {
                write!(out, "<{name} {attributes}>{inside}{tip}</{name}>{gap}")
            };
        }
        out.push_str("</svg>");
        out.push_str(gap);
        out
    }
}

/// Name, attributes and contents.
fn element(mark: &Mark, color: &impl Fn(Paint) -> String) -> (&'static str, String, String) {
    let none = String::new();
    match mark {
        Mark::Rectangle { corner, size, fill } => {
            // Neighbours of a map share an edge: smoothing would show the page between them.
            let attributes = format!(
                "x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\" shape-rendering=\"crispEdges\"",
                number(corner[0]),
                number(corner[1]),
                number(size[0].max(0.0)),
                number(size[1].max(0.0)),
                color(*fill)
            );
            ("rect", attributes, none)
        }
        Mark::Frame {
            corner,
            size,
            paint,
        } => {
            let attributes = format!(
                "x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"{}\"",
                number(corner[0] + 0.5),
                number(corner[1] + 0.5),
                number((size[0] - 1.0).max(0.0)),
                number((size[1] - 1.0).max(0.0)),
                color(*paint)
            );
            ("rect", attributes, none)
        }
        Mark::Line { points, stroke } => {
            let attributes = format!(
                "points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" {}",
                joined(points),
                line(stroke, color)
            );
            ("polyline", attributes, none)
        }
        Mark::Polygon { points, fill } => {
            let attributes = format!("points=\"{}\" fill=\"{}\"", joined(points), color(*fill));
            ("polygon", attributes, none)
        }
        Mark::Disc {
            centre,
            radius,
            fill,
        } => {
            let attributes = format!("{} fill=\"{}\"", round(*centre, *radius), color(*fill));
            ("circle", attributes, none)
        }
        Mark::Circle {
            centre,
            radius,
            stroke,
        } => {
            let attributes = format!(
                "{} fill=\"none\" {}",
                round(*centre, *radius),
                line(stroke, color)
            );
            ("circle", attributes, none)
        }
        Mark::Text(text) => {
            let attributes = format!("{} fill=\"{}\"", placed(text), color(Paint::Ink));
            ("text", attributes, escape(&text.text).into_owned())
        }
    }
}

fn placed(text: &Text) -> String {
    let [x, y] = text.at;
    let below = MIDDLE * text.size.line();
    let mut attributes = if text.upwards {
        format!(
            "transform=\"translate({} {}) rotate(-90)\"",
            number(x + below),
            number(y)
        )
    } else {
        format!("x=\"{}\" y=\"{}\"", number(x), number(y + below))
    };
    match text.anchor {
        Anchor::Start => {}
        Anchor::Middle => attributes.push_str(" text-anchor=\"middle\""),
        Anchor::End => attributes.push_str(" text-anchor=\"end\""),
    }
    if text.size != Size::Small {
        let size = number(font_size(text.size));
        // Writing to a String cannot fail.
        let _ = write!(attributes, " font-size=\"{size}\"");
    }
    // Spaces in a row are as wide as they are laid out.
    if text.text.contains("  ") {
        attributes.push_str(" xml:space=\"preserve\"");
    }
    attributes
}

fn font_size(size: Size) -> f64 {
    size.width("0") / ADVANCE
}

fn line(stroke: &Stroke, color: &impl Fn(Paint) -> String) -> String {
    let mut attributes = format!(
        "stroke=\"{}\" stroke-width=\"{}\"",
        color(stroke.paint),
        number(stroke.width)
    );
    if let Some([drawn, left_out]) = stroke.dash {
        // Writing to a String cannot fail.
        let _ = write!(
            attributes,
            " stroke-dasharray=\"{} {}\"",
            number(drawn),
            number(left_out)
        );
    }
    attributes
}

fn round([x, y]: [f64; 2], radius: f64) -> String {
    format!(
        "cx=\"{}\" cy=\"{}\" r=\"{}\"",
        number(x),
        number(y),
        number(radius)
    )
}

fn joined(points: &[[f64; 2]]) -> String {
    let texts: Vec<String> = points
        .iter()
        .map(|[x, y]| format!("{},{}", number(*x), number(*y)))
        .collect();
    texts.join(" ")
}

/// Hundredths of a pixel.
fn number(value: f64) -> String {
    crate::number::rounded(value, 2)
}

fn hex(paint: Paint) -> String {
    let [red, green, blue] = paint.rgb();
    format!("#{red:02x}{green:02x}{blue:02x}")
}
