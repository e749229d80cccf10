//! The `needlebench` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    needlebench::main()
}
