//! Run-time selection of the instruction set for the hot loops.
//!
//! The loop bodies have the same source for every instruction set and use neither fused multiply-add nor horizontal sums, so
//! wider registers change the speed but not a single bit of the result.

#[cfg(target_arch = "x86_64")]
use super::octet::wide::{Avx2, Avx512};
use super::octet::{Octet, OctetKernel, Portable};

/// Instruction set for which the hot loops are compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    /// Instructions that every target of the build supports (SSE2 on x86-64).
    Baseline,
    /// 256-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 512-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

#[cfg(test)]
thread_local! {
    /// Instruction set that a test uses instead of the widest one, on its thread.
    pub(crate) static CHOSEN: std::cell::Cell<Option<InstructionSet>> = const { std::cell::Cell::new(None) };
}

impl InstructionSet {
    /// Returns the widest instruction set of the processor.
    pub fn detect() -> Self {
        #[cfg(test)]
        if let Some(chosen) = CHOSEN.get() {
            return chosen;
        }
        #[cfg(target_arch = "x86_64")]
        {
            if std::arch::is_x86_feature_detected!("avx512f") {
                return Self::Avx512;
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }

    /// Runs `kernel` with the registers of this instruction set.
    #[inline]
    pub(crate) fn run_octets<K: OctetKernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Baseline => kernel.run::<Portable>(),
            // SAFETY: the variants are only created by `detect`, after the processor reported the feature.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { with_avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { with_avx512(kernel) },
        }
    }

    /// Runs `kernel` compiled for this instruction set.
    #[inline]
    pub fn run(self, kernel: impl Kernel) {
        self.run_octets(AnyWidth(kernel));
    }
}

/// A loop nest that is compiled once per instruction set. `run` must be `#[inline(always)]`, which a closure would not be.
pub trait Kernel {
    /// Runs the loops.
    fn run(self);
}

/// A kernel whose SIMD width the compiler chooses.
struct AnyWidth<K>(K);

impl<K: Kernel> OctetKernel for AnyWidth<K> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(self) {
        self.0.run();
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<K: OctetKernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn with_avx512<K: OctetKernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}
