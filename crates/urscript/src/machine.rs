//! The arm that a program moves, and what the controller believes of it.

use needlebench_kinematics::Pose;

use crate::motion::{Arm, Belief, Motion, MotionKind};
use crate::place::{Place, ScriptError};

/// Most notes of different texts, most lines that one counts, and most that it names.
const MOST_NOTES: usize = 50;
const MOST_COUNTED: usize = 100;
const MOST_LINES: usize = 5;

/// What a program does not say.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Installation {
    /// The tool's point in the flange's frame until the program sets one.
    pub flange_from_tcp: Option<Pose>,
}

/// A note with the lines that it is about.
struct Note {
    text: String,
    lines: Vec<usize>,
}

impl Note {
    fn into_text(self) -> String {
        let some: Vec<String> = self
            .lines
            .iter()
            .take(MOST_LINES)
            .map(usize::to_string)
            .collect();
        let lines = if self.lines.len() == 1 {
            "line"
        } else {
            "lines"
        };
        let more = match self.lines.len().saturating_sub(MOST_LINES) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        format!("{} ({lines} {}{more})", self.text, some.join(", "))
    }
}

/// What a program acts upon.
pub(crate) struct Machine<'a> {
    pub arm: &'a mut dyn Arm,
    installation: &'a Installation,
    pub belief: &'a mut Belief,
    /// The arm is that of a controller which runs.
    is_live: bool,
    /// The arm was given a motion.
    pub has_moved: bool,
    /// The last motion has a blend radius.
    pub is_blended: bool,
    /// Motions that the arm was given.
    pub motions: usize,
    notes: Vec<Note>,
}

impl<'a> Machine<'a> {
    pub fn new(
        arm: &'a mut dyn Arm,
        installation: &'a Installation,
        belief: &'a mut Belief,
    ) -> Self {
        Self {
            arm,
            installation,
            belief,
            is_live: false,
            has_moved: false,
            is_blended: false,
            motions: 0,
            notes: Vec::new(),
        }
    }

    /// For a call on a controller.
    #[must_use]
    pub fn live(mut self) -> Self {
        self.is_live = true;
        self
    }

    /// Adds a note, or its line to the note of the same text.
    pub fn note(&mut self, place: Place, text: &str) {
        let known = self.notes.iter_mut().find(|note| note.text == text);
        if let Some(note) = known {
            if note.lines.len() < MOST_COUNTED && !note.lines.contains(&place.line) {
                note.lines.push(place.line);
            }
        } else if self.notes.len() < MOST_NOTES {
            self.notes.push(Note {
                text: text.to_owned(),
                lines: vec![place.line],
            });
        }
    }

    /// Why something that a program does is not evaluated.
    pub fn refused(&self, place: Place, name: &str, reason: &str) -> ScriptError {
        if self.is_live {
            return ScriptError::new(place, format!("`{name}` {reason}"));
        }
        let message = format!("`{name}` {reason}: only fixed arguments are judged");
        ScriptError::new(place, message)
            .hint("run it with `needlebench robot`, or judge the RTDE log of a run")
    }

    /// The tool's point in the flange's frame.
    pub fn tcp(&self, place: Place) -> Result<Pose, ScriptError> {
        let known = self
            .belief
            .flange_from_tcp
            .or(self.installation.flange_from_tcp);
        known.ok_or_else(|| {
            let message =
                "the program sets no TCP before this, and that of the installation is not known";
            ScriptError::new(place, message)
                .hint("add set_tcp(p[...]) to the program, or say with --tcp which point it is")
        })
    }

    /// Gives the arm a motion.
    pub fn perform(&mut self, motion: &Motion) -> Result<(), ScriptError> {
        self.arm.perform(motion)?;
        self.motions += 1;
        self.has_moved |= !matches!(
            motion.kind,
            MotionKind::Stand { .. } | MotionKind::Stop { .. }
        );
        self.is_blended = match motion.kind {
            MotionKind::Joints { blend_m, .. }
            | MotionKind::Line { blend_m, .. }
            | MotionKind::Circle { blend_m, .. }
            | MotionKind::Process { blend_m, .. } => blend_m > 0.0,
            _ => false,
        };
        Ok(())
    }

    /// The notes, in words.
    pub fn into_notes(self) -> Vec<String> {
        self.notes.into_iter().map(Note::into_text).collect()
    }
}
