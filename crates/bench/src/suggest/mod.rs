//! Proposals for a scenario: where a needle may enter for a target, and where the robot may stand for its goals.
//!
//! Both are found on a stated grid, evaluated by the code that `check` and static cases of studies have, and ranked by
//! stated terms: nothing here has rules of its own about routes or clearances. Only postures are evaluated, unless
//! motions are requested.

mod entries;
mod grid;
mod places;

pub use entries::{
    BentMargins, ENTRY_TERMS, Entry, EntryRule, EntrySample, EntrySearch, EntryTerm, TissueMargin,
    plan_entry, suggest_entries,
};
pub use places::{
    Place, PlaceGoal, PlaceSample, PlaceSearch, at_place, plan_place, suggest_places,
};
