//! Run-time selection of the instruction set for the hot loops.
//!
//! The loop bodies have the same source for every instruction set and use neither fused multiply-add nor horizontal sums, so
//! wider registers change the speed but not a single bit of the result.

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

impl InstructionSet {
    /// Returns the widest instruction set of the processor.
    pub fn detect() -> Self {
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

    /// Runs `kernel` compiled for this instruction set.
    #[inline]
    pub fn run(self, kernel: impl Kernel) {
        match self {
            Self::Baseline => kernel.run(),
            // SAFETY: the variants are only created by `detect`, after the processor reported the feature.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { with_avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { with_avx512(kernel) },
        }
    }
}

/// A loop nest that is compiled once per instruction set. `run` must be `#[inline(always)]`, which a closure would not be.
pub trait Kernel {
    /// Runs the loops.
    fn run(self);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn with_avx512(kernel: impl Kernel) {
    kernel.run();
}
