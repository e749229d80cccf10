//! What was made once and may be wanted again.

use std::sync::{Arc, Mutex, PoisonError};

/// The things made last, by what they were made from. A bounded number: what has not been wanted for
/// long is made again.
#[derive(Debug)]
pub(crate) struct Cache<K, V>(Mutex<Vec<(K, Arc<V>)>>);

/// Things in one cache: more levels than a factor of a study mostly has.
const CAPACITY: usize = 32;

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<K, V> Cache<K, V> {
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
        if things.len() == CAPACITY {
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

    fn get(cache: &Cache<usize, usize>, key: usize, made: &mut usize) -> usize {
        let result = cache.get(
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
        let (cache, mut made) = (Cache::default(), 0);
        for _ in 0..3 {
            for key in 0..CAPACITY {
                assert_eq!(get(&cache, key, &mut made), key * key);
            }
        }
        assert_eq!(made, CAPACITY);
    }

    #[test]
    fn a_cache_is_bounded_and_keeps_what_is_wanted() {
        let (cache, mut made) = (Cache::default(), 0);
        for key in 1..10 * CAPACITY {
            get(&cache, 0, &mut made);
            get(&cache, key, &mut made);
        }
        assert_eq!(made, 10 * CAPACITY, "the one in use stays");
        assert_eq!(cache.0.lock().unwrap().len(), CAPACITY);
    }

    #[test]
    fn what_cannot_be_made_is_tried_again() {
        let cache: Cache<usize, usize> = Cache::default();
        assert_eq!(cache.get(|_| true, || Err("no")), Err("no"));
        assert_eq!(
            cache.get(|_| true, || Ok::<_, ()>((1, 2))).as_deref(),
            Ok(&2)
        );
    }
}
