//! Products with sums, rounded once.

use fearless_simd::prelude::*;

/// `self * factor + term`.
pub(super) trait Fused<S: Simd>: SimdFloat<S> {
    /// Rounded once on every processor, in software where it cannot: results are the same to the last bit. In a page
    /// (WebAssembly) rounded twice, which is several times as small and as fast: pages say what a table says, but
    /// nothing is computed from what they say.
    #[inline(always)]
    fn fused(self, factor: impl SimdInto<Self, S>, term: impl SimdInto<Self, S>) -> Self {
        if cfg!(target_arch = "wasm32") {
            self.mul_add(factor, term)
        } else {
            self.mul_add_precise(factor, term)
        }
    }
}

impl<S: Simd, V: SimdFloat<S>> Fused<S> for V {}
