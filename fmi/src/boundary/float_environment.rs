//! Floating-point environment of the caller, put aside while the library computes.
//!
//! Importers run with exceptions unmasked (to find the origin of a NaN), with other rounding modes, or with denormals
//! flushed to zero. Compiled Rust assumes the default environment: it evaluates both branches of a condition where that
//! is faster, and infinite gaps of lanes that pad a vector register are arithmetic without consequence. Under unmasked
//! exceptions either would end the importer's process, and under another rounding mode results would differ.

/// While this lives, exceptions are masked, rounding is to nearest and denormals are kept; then the caller's control and
/// status bits are back, so that no exception flag raised in between is seen outside.
///
/// On processors other than x86-64 nothing is changed.
#[derive(Debug)]
pub(crate) struct StandardFloats {
    #[cfg(target_arch = "x86_64")]
    of_caller: u32,
}

#[cfg(target_arch = "x86_64")]
mod control {
    /// Control and status register of SSE after power-up (Intel 64 manual, volume 1, section 10.2.3).
    pub(super) const STANDARD: u32 = 0x1F80;

    pub(super) fn read() -> u32 {
        let mut value = 0_u32;
        // SAFETY: `stmxcsr` writes four bytes to the place given and changes nothing else; every x86-64 has it.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value
    }

    pub(super) fn write(value: u32) {
        // SAFETY: `ldmxcsr` reads four bytes; the value is the standard one, which compiled code assumes, or one that
        // `read` gave for the code that goes on with it, hence no reserved bit is set.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags)) };
    }
}

impl StandardFloats {
    /// Put the caller's environment aside.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn enter() -> Self {
        let of_caller = control::read();
        control::write(control::STANDARD);
        Self { of_caller }
    }

    /// Put the caller's environment aside.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn enter() -> Self {
        Self {}
    }
}

impl Drop for StandardFloats {
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        control::write(self.of_caller);
    }
}
