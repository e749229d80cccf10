#![no_main]
//! Any bytes as a NIfTI file: an answer or a refusal.

mod scratch;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scratch::read("a.nii.gz", bytes));
