//! Recordings of breath: made by laws that are known, read from files, and refused.

mod coverage;
mod files;
mod refused;
mod several;
mod synthetic;
