//! Former names of commands and options: accepted until the next version, with a note on standard error.

use std::ffi::OsString;

use needlebench_input::schema::FORMER_NAMES_UNTIL;

use crate::output::complain;

/// Commands, former and present name. Each is an `alias` in the command line.
const COMMANDS: [(&str, &str); 2] = [("atlas", "roll-map"), ("record-plan", "plan-excitation")];

/// Options: the command that has them, former and present name. Each is an `alias` of the option.
const OPTIONS: [(&str, &str, &str); 5] = [
    ("run", "--referee", "--reference"),
    ("suggest", "--places", "--placements"),
    ("ct build", "--posture", "--patient-position"),
    ("ct synth", "--no-bed", "--no-couch"),
    ("ct synth", "--touch-mm", "--fle-sd-mm"),
];

/// Prints a note for each former name on a command line, the program's name first.
pub(crate) fn tell_former_names(arguments: &[OsString]) {
    for note in notes(arguments) {
        complain(&note);
    }
}

/// One note for each former name, however often it is given.
fn notes(arguments: &[OsString]) -> Vec<String> {
    let words: Vec<_> = arguments
        .iter()
        .skip(1)
        .map(|word| word.to_string_lossy())
        .take_while(|word| word != "--")
        .collect();
    let command = command(words.iter().map(|word| &**word));
    let is_given = |option: &str| {
        let mut names = words.iter().filter_map(|word| word.split('=').next());
        names.any(|name| name == option)
    };
    let commands = COMMANDS.into_iter().filter(|(old, _)| *old == command);
    let options = OPTIONS
        .into_iter()
        .filter(|(owner, old, _)| *owner == command && is_given(old))
        .map(|(_, old, new)| (old, new));
    commands
        .chain(options)
        .map(|(old, new)| {
            format!("note: {old} is now {new}; the old name is accepted until {FORMER_NAMES_UNTIL}")
        })
        .collect()
}

/// The command, and behind `ct` its subcommand; empty if there is none.
fn command<'w>(mut words: impl Iterator<Item = &'w str>) -> String {
    let mut names: Vec<&str> = Vec::new();
    while let Some(word) = words.next() {
        if word == "--log" {
            // Its value is no command.
            words.next();
        } else if !word.starts_with('-') {
            names.push(word);
            if names != ["ct"] {
                break;
            }
        }
    }
    names.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noted(line: &str) -> Vec<String> {
        let arguments: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        notes(&arguments)
    }

    #[test]
    fn a_former_name_is_noted_once() {
        let referee = "note: --referee is now --reference; the old name is accepted until 0.2.0";
        assert_eq!(noted("needlebench run s.toml --referee"), [referee]);
        assert_eq!(
            noted("needlebench run --referee --referee s.toml"),
            [referee]
        );
        let places = "note: --places is now --placements; the old name is accepted until 0.2.0";
        assert_eq!(noted("needlebench suggest s.toml --places=2"), [places]);
        let atlas = "note: atlas is now roll-map; the old name is accepted until 0.2.0";
        assert_eq!(noted("needlebench --log info atlas s.toml"), [atlas]);
        assert_eq!(
            noted("needlebench ct --log=info synth s.toml --no-bed --touch-mm 1").len(),
            2
        );
    }

    #[test]
    fn present_names_and_other_commands_have_no_note() {
        for line in [
            "needlebench",
            "needlebench ct",
            "needlebench run s.toml --reference",
            "needlebench run atlas",
            "needlebench roll-map s.toml",
            "needlebench check s.toml --referee",
            "needlebench ct info --posture supine",
            "needlebench run s.toml -- --referee",
        ] {
            assert_eq!(noted(line), [""; 0], "{line}");
        }
    }

    #[test]
    fn every_former_name_is_an_alias_of_the_present_one() {
        let program = crate::command_line();
        for (old, new) in COMMANDS {
            let found = program.find_subcommand(old).expect("it is accepted");
            assert_eq!(found.get_name(), new);
        }
        for (owner, old, new) in OPTIONS {
            let command = owner.split(' ').fold(&program, |command, name| {
                command.find_subcommand(name).expect("there is the command")
            });
            let option = command
                .get_arguments()
                .find(|each| each.get_long() == new.strip_prefix("--"))
                .expect("there is the option");
            let aliases = option.get_all_aliases().unwrap_or_default();
            assert!(aliases.contains(&&old[2..]), "{old}");
        }
    }
}
