#![no_main]
//! Any bytes as a MetaImage file: an answer or a refusal.

mod scratch;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scratch::read("a.mha", bytes));
