//! What was made once and may be wanted again.

use std::sync::{Arc, Mutex, PoisonError};

/// The things made last, by what they were made from. A bounded number: what has not been wanted for
/// long is made again.
#[derive(Debug)]
pub(crate) struct Shelf<K, V>(Mutex<Vec<(K, Arc<V>)>>);

/// Things on one shelf: more levels than a factor of a study mostly has.
const ROOM: usize = 32;

impl<K, V> Default for Shelf<K, V> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<K, V> Shelf<K, V> {
    /// What was made from the key for which `is_it` holds, or what `make` gives, which is kept. What
    /// cannot be made is not kept. Two threads may make the same at the same time.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn get<E>(
        &self,
        is_it: impl Fn(&K) -> bool,
        make: impl FnOnce() -> Result<(K, V), E>,
    ) -> Result<Arc<V>, E> {
        if let Some(found) = self.find(&is_it) {
            return Ok(found);
        }
        let (key, made) = make()?;
        let made = Arc::new(made);
        let mut things = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        things.retain(|(key, _)| !is_it(key));
        if things.len() == ROOM {
            things.remove(0);
        }
        things.push((key, Arc::clone(&made)));
        Ok(made)
    }

    fn find(&self, is_it: impl Fn(&K) -> bool) -> Option<Arc<V>> {
        let mut things = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let at = things.iter().rposition(|(key, _)| is_it(key))?;
        // The one wanted last stands at the end.
        if at + 1 < things.len() {
            let thing = things.remove(at);
            things.push(thing);
        }
        things.last().map(|(_, made)| Arc::clone(made))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn get(shelf: &Shelf<usize, usize>, key: usize, made: &mut usize) -> usize {
        let result = shelf.get(
            |each| *each == key,
            || {
                *made += 1;
                Ok::<_, ()>((key, key * key))
            },
        );
        *result.unwrap()
    }

    #[test]
    fn what_was_made_is_not_made_again() {
        let (shelf, mut made) = (Shelf::default(), 0);
        for _ in 0..3 {
            for key in 0..ROOM {
                assert_eq!(get(&shelf, key, &mut made), key * key);
            }
        }
        assert_eq!(made, ROOM);
    }

    #[test]
    fn a_shelf_has_bounded_room_and_keeps_what_is_wanted() {
        let (shelf, mut made) = (Shelf::default(), 0);
        for key in 1..10 * ROOM {
            get(&shelf, 0, &mut made);
            get(&shelf, key, &mut made);
        }
        assert_eq!(made, 10 * ROOM, "the one in use stays");
        assert_eq!(shelf.0.lock().unwrap().len(), ROOM);
    }

    #[test]
    fn what_cannot_be_made_is_tried_again() {
        let shelf: Shelf<usize, usize> = Shelf::default();
        assert_eq!(shelf.get(|_| true, || Err("no")), Err("no"));
        assert_eq!(
            shelf.get(|_| true, || Ok::<_, ()>((1, 2))).as_deref(),
            Ok(&2)
        );
    }
}
