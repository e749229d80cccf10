//! Prints the public items of a crate, one a line, from rustdoc's JSON: `.ci/public-api`.
//!
//! Derived traits are named, and of the automatic ones Send and Sync; blanket ones are not. Items hidden from the
//! documentation are no part of what is promised, and are not listed.

use std::path::PathBuf;

/// The compiler's own, and automatic ones that nobody asks for.
const UNNAMED: [&str; 6] = [
    "core::marker::Freeze",
    "core::marker::StructuralPartialEq",
    "core::marker::Unpin",
    "core::marker::UnsafeUnpin",
    "core::panic::unwind_safe::RefUnwindSafe",
    "core::panic::unwind_safe::UnwindSafe",
];

fn main() -> public_api::Result<()> {
    let json = std::env::args_os().nth(1).unwrap_or_default();
    let api = public_api::Builder::from_rustdoc_json(PathBuf::from(json))
        .omit_blanket_impls(true)
        .include_function_parameter_names(true)
        .build()?;
    for item in api.items() {
        let line = item.to_string();
        if !UNNAMED.iter().any(|name| line.starts_with(&format!("impl {name} for"))) {
            println!("{line}");
        }
    }
    Ok(())
}
