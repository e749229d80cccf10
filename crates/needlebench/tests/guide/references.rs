//! References that the program prints.

use std::fs;
use std::process::Command;

use crate::book::workspace;

#[test]
fn references_are_those_of_the_program() {
    for name in ["scenario", "study", "arm", "metrics"] {
        let path = format!("guide/src/reference/{name}.md");
        let output = Command::new(env!("CARGO_BIN_EXE_needlebench"))
            .args(["schema", name, "--markdown"])
            .output()
            .unwrap();
        assert!(output.status.success());
        let printed = String::from_utf8(output.stdout).unwrap();
        let kept = fs::read_to_string(workspace().join(&path)).unwrap();
        // Not `assert_eq`: a thousand lines are no message.
        assert!(
            printed == kept,
            "not what the program says: needlebench schema {name} --markdown > {path}"
        );
    }
}
