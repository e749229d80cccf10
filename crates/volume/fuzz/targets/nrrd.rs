#![no_main]
//! Any bytes as a NRRD file: an answer or a refusal.

mod scratch;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scratch::read("a.nrrd", bytes));
