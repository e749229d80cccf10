//! How far a layout may move.
