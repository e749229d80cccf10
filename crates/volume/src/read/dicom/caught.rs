//! Decoders of others, which may panic over damaged streams: caught, and nothing printed of it.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// Calls `work`; none where it panics.
///
/// The hook that prints a panic is the whole program's: it is told, thread by thread, to keep silent here.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    HOOK.call_once(|| {
        let printing = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !IS_CAUGHT.get() {
                printing(panic);
            }
        }));
    });
    IS_CAUGHT.set(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    IS_CAUGHT.set(false);
    outcome.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_no_answer_and_the_next_call_works() {
        let nothing: Vec<u8> = Vec::new();
        assert_eq!(caught(|| nothing[std::hint::black_box(3)]), None);
        assert_eq!(caught(|| 7), Some(7));
        assert!(!IS_CAUGHT.get());
    }
}
