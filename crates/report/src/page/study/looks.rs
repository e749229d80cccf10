//! The tools and phantoms of the cases on a page.

use std::sync::Arc;

use needlebench_cell::ResolvedScenario;
use needlebench_cell::phantom::Phantom;
use needlebench_cell::scenario::ToolSection;
use serde_json::Value;

use crate::page::pack::Pack;
use crate::page::scene::look;

/// Tools and phantoms besides the base scenario's, at most: a page has a code of a byte for each.
const MOST_LOOKS: usize = 200;
/// Bytes that they may take.
const MOST_BYTES: usize = 1_200_000;
/// Bytes that they and everything before them may take together.
const MOST_BYTES_IN_ALL: usize = 7_000_000;
/// Code of a case whose tool or phantom is not on the page, or is not known.
const ELSEWHERE: u8 = u8::MAX;

/// What a case looks like.
struct Look {
    tool: ToolSection,
    phantom: Option<Arc<Phantom>>,
}

impl Look {
    fn of(resolved: &ResolvedScenario) -> Self {
        Self {
            tool: resolved.scenario.tool.clone(),
            phantom: resolved
                .phantom
                .as_ref()
                .map(|placed| Arc::clone(&placed.phantom)),
        }
    }

    fn is_of(&self, resolved: &ResolvedScenario) -> bool {
        let phantom = resolved.phantom.as_ref().map(|placed| &placed.phantom);
        let same = match (&self.phantom, phantom) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b) || a.parts == b.parts,
            _ => false,
        };
        same && self.tool == resolved.scenario.tool
    }
}

/// The looks of the cases so far; the first is the base scenario's.
pub(super) struct Looks {
    known: Vec<Look>,
    /// By case.
    codes: Vec<u8>,
    /// Of the known ones but the first.
    values: Vec<Value>,
    before: usize,
}

impl Looks {
    pub fn new(base: Option<&ResolvedScenario>, pack: &Pack) -> Self {
        Self {
            known: base.map(Look::of).into_iter().collect(),
            codes: Vec::new(),
            values: Vec::new(),
            before: pack.len(),
        }
    }

    /// Adds a case; none of a layout that cannot exist.
    pub fn push(&mut self, case: Option<&ResolvedScenario>, pack: &mut Pack) {
        let code = case.map_or(ELSEWHERE, |case| self.code(case, pack));
        self.codes.push(code);
    }

    fn code(&mut self, case: &ResolvedScenario, pack: &mut Pack) -> u8 {
        if self.known.is_empty() {
            return ELSEWHERE;
        }
        let mut known = self.known.iter();
        if let Some(at) = known.position(|known| known.is_of(case)) {
            return u8::try_from(at).expect("200 at most");
        }
        let is_full = self.known.len() > MOST_LOOKS
            || pack.len() - self.before > MOST_BYTES
            || pack.len() > MOST_BYTES_IN_ALL;
        if is_full {
            return ELSEWHERE;
        }
        self.values.push(look(case, pack));
        self.known.push(Look::of(case));
        u8::try_from(self.known.len() - 1).expect("200 at most")
    }

    /// The code of each case, and the looks from the second on.
    pub fn finish(self, pack: &mut Pack) -> [Value; 2] {
        [pack.u8s(&self.codes), Value::Array(self.values)]
    }
}
