//! The words for everything that a scenario's room holds.

use std::collections::BTreeMap;

use super::ResolvedScenario;
use needlebench_cell::part_in_words;

impl ResolvedScenario {
    /// What people call each body, solid, part of the patient and person, by its name; what has no words
    /// besides its name is left out.
    ///
    /// A person who stands elsewhere for another goal is called by role and number alone: `physician 2`.
    pub fn words(&self) -> BTreeMap<String, String> {
        let bodies = self.cell.bodies.iter();
        let of_bodies = bodies.flat_map(|body| {
            let solids = body.solids.iter().map(|solid| solid.name.as_str());
            std::iter::once(body.name.as_str()).chain(solids)
        });
        let parts = self.phantom.iter().flat_map(|placed| &placed.phantom.parts);
        let of_parts =
            parts.flat_map(|part| std::iter::once(part.name.as_str()).chain(part.organ.as_deref()));
        let mut words: BTreeMap<String, String> = of_bodies
            .chain(of_parts)
            .map(|name| (name.to_owned(), part_in_words(name).into_owned()))
            .collect();
        let mut people = BTreeMap::<&str, String>::new();
        for person in self.people.by_goal.iter().flatten() {
            people
                .entry(&person.name)
                .and_modify(|known| {
                    if *known != person.words {
                        *known = part_in_words(&person.name).replace('_', " ");
                    }
                })
                .or_insert_with(|| person.words.clone());
        }
        words.extend(
            people
                .into_iter()
                .map(|(name, known)| (name.to_owned(), known)),
        );
        words.retain(|name, known| name != known);
        words
    }
}
