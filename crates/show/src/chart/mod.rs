//! Charts in the plane.
//!
//! A [`Chart`] is a value: marks in pixels, in the order in which they lie on each other, made by the
//! functions of this module from axes, panels and legends. Two back ends draw it: `Chart::to_svg`
//! for a file and [`Chart::to_inline_svg`] for a page, and `Chart::to_image` for a PNG file. Both
//! place everything the same, texts included: the raster back end writes with the glyphs that the
//! 3D pictures use, the vector back end names fonts of the same advance. The same results give the
//! same bytes on every machine: no system font, window or clock is asked.
//!
//! The drawing is our own. `plotters` 0.3 was tried: with its two back ends and `ab_glyph` for the texts
//! it takes about 14 CPU-seconds more to build in release, needs a font file of its own, and knows
//! neither the ellipses, weighted bars, bands and maps that most of these charts are made of nor a
//! layout that keeps texts apart; axes and ticks, which it does know, are a file of ours.

mod axis;
mod drawing;
mod legend;
mod marker;
mod paint;
mod panel;
mod plots;
mod raster;
mod svg;
mod weighted_bars;

pub use axis::{Axis, Scale, round_step};
pub use drawing::{Anchor, Chart, Mark, Size, Text};
pub use legend::{LEGEND_ROW_PX, Sample, legend, legend_column};
pub use marker::Marker;
pub use paint::{Overlay, Paint, Rgb, Stroke, confused, mixed};
pub use panel::Panel;
pub use plots::{Curve, DotMark, DotRow, Entry, bar_plot, curve_plot, dot_plot};
pub use weighted_bars::{WeightedBars, WeightedRow, weighted_bars};
