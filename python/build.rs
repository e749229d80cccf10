//! How the module is linked.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // The elementary functions that it brings along are its own: the interpreter has loaded the C library's before.
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "linux") {
        println!("cargo:rustc-link-arg-cdylib=-Wl,-Bsymbolic");
    }
}
