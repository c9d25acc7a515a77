//! The hot loops of training on vectors of four doubles where the processor has them; host.
//!
//! The x86-64 baseline has vectors of two. The loops are compiled once more for AVX2 and change no bit: every sum keeps
//! its order, and no multiplication is fused with an addition (AVX2 alone has no such instruction, and Rust never
//! fuses).

/// A loop that is compiled for several kinds of vectors.
pub(super) trait Loop {
    /// The result of the loop.
    type Output;

    /// Runs the loop. It and what it calls in its hot part must be `#[inline(always)]`: what is not inlined stays with
    /// the baseline.
    fn run(self) -> Self::Output;
}

/// Runs the loop on the widest vectors that it is compiled for and the processor has.
pub(super) fn on_wide_vectors<L: Loop>(work: L) -> L::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<L: Loop>(work: L) -> L::Output {
            work.run()
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { avx2(work) };
        }
    }
    work.run()
}
