//! How results are shown, whatever they are of: numbers in words, lines and tables as wide as the terminal,
//! documents of headings and tables, texts of users in Markdown, and charts in pixels and in vectors.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod block;
pub mod chart;
pub mod layout;
pub mod markdown;
pub mod number;
mod table;

pub use comfy_table::{Cell, CellAlignment, Color};

pub use block::{Block, blocks_text, has_words, heading};
pub use table::{Table, plain_table};
