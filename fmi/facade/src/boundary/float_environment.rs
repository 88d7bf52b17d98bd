//! Floating-point environment of the caller, which is saved and replaced while the library computes.
//!
//! Importers may run with unmasked exceptions (to find the origin of a NaN), with other rounding modes, or with
//! denormals flushed to zero. Compiled Rust assumes the default environment: it evaluates both branches of a condition
//! where that is faster, and it computes with infinite gaps in lanes that pad a vector register. With unmasked
//! exceptions either would terminate the importer's process, and another rounding mode would change the results.

/// While this guard is alive, exceptions are masked, rounding is to nearest and denormals are kept. Dropping it
/// restores the caller's control and status bits, so that the caller sees no exception flag raised in between.
///
/// On processors other than x86-64 and AArch64 it does nothing.
#[derive(Debug)]
pub(crate) struct StandardFloats {
    of_caller: control::Environment,
}

#[cfg(target_arch = "x86_64")]
mod control {
    /// Control and status register of SSE.
    pub(super) type Environment = u32;

    /// State after power-up (Intel 64 manual, volume 1, section 10.2.3).
    pub(super) const STANDARD: Environment = 0x1F80;

    pub(super) fn read() -> Environment {
        let mut value = 0_u32;
        // SAFETY: `stmxcsr` writes four bytes to the given address and changes nothing else; every x86-64 has it.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value
    }

    pub(super) fn write(value: Environment) {
        // SAFETY: `ldmxcsr` reads four bytes; the value is the standard one, which compiled code assumes, or one that
        // `read` returned for the code that continues with it, so no reserved bit is set.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags)) };
    }
}

#[cfg(target_arch = "aarch64")]
mod control {
    /// Control register FPCR and status register FPSR.
    pub(super) type Environment = [u64; 2];

    /// No traps, to nearest, denormals kept, no flag raised: all bits zero (Arm Architecture Reference Manual for
    /// A-profile, C5.2.8 FPCR and C5.2.10 FPSR).
    pub(super) const STANDARD: Environment = [0, 0];

    pub(super) fn read() -> Environment {
        let (control, status): (u64, u64);
        // SAFETY: reads of two registers that every AArch64 with floating point has; no memory, no condition flags.
        unsafe {
            std::arch::asm!("mrs {}, fpcr", "mrs {}, fpsr", out(reg) control, out(reg) status, options(nomem, nostack, preserves_flags));
        }
        [control, status]
    }

    pub(super) fn write([control, status]: Environment) {
        // SAFETY: the values are the standard ones, which compiled code assumes, or those that `read` returned for the
        // code that continues with them, so no reserved bit is set.
        unsafe {
            std::arch::asm!("msr fpcr, {}", "msr fpsr, {}", in(reg) control, in(reg) status, options(nomem, nostack, preserves_flags));
        }
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod control {
    pub(super) type Environment = ();

    pub(super) const STANDARD: Environment = ();

    pub(super) fn read() {}

    pub(super) fn write((): Environment) {}
}

impl StandardFloats {
    /// Saves the caller's environment and sets the standard one.
    pub(super) fn enter() -> Self {
        let of_caller = control::read();
        control::write(control::STANDARD);
        Self { of_caller }
    }
}

impl Drop for StandardFloats {
    fn drop(&mut self) {
        control::write(self.of_caller);
    }
}
