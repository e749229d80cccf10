//! Builds the crate anew when a shipped model changes or a folder is added: the compiler does not look.

fn main() {
    println!("cargo:rerun-if-changed=../../models");
    println!("cargo:rerun-if-changed=build.rs");
}
