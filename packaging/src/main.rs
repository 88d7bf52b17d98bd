//! The `tiprub` command line.

use std::{ffi::OsString, process::ExitCode};

use tiprub_packaging::{cli::Cli, command_names, commands};
use tiprub_shell::{Failure, console::Console};

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let asked = Console::new(true, command_names::asks_for_json(&arguments));
    if let Some(failure) = command_names::check_names(&arguments) {
        asked.fail(&failure);
        return ExitCode::from(failure.exit_code());
    }
    let cli: Cli = command_names::parsed(&asked);
    let console = Console::new(cli.quiet, cli.json);
    if stdout_at_start::was_closed() {
        return console.finish(Err(Failure::new(
            "stdout",
            "is closed, so no result can be printed",
            "Open it, or redirect it to /dev/null",
        )));
    }
    console.finish(commands::run(&cli.command, &console))
}

/// Detects a closed stdout before `main`: Rust opens /dev/null in its place, which would silently discard all results.
#[cfg(target_os = "linux")]
mod stdout_at_start {
    use std::sync::atomic::{AtomicBool, Ordering};

    static CLOSED: AtomicBool = AtomicBool::new(false);

    extern "C" fn look() {
        // SAFETY: reads the flags of a descriptor, which need not be open, and accesses no memory.
        let flags = unsafe { libc::fcntl(libc::STDOUT_FILENO, libc::F_GETFD) };
        CLOSED.store(flags == -1, Ordering::Relaxed);
    }

    /// The C library calls the functions in this section before Rust starts.
    #[used]
    #[unsafe(link_section = ".init_array")]
    static LOOK: extern "C" fn() = look;

    pub(crate) fn was_closed() -> bool {
        CLOSED.load(Ordering::Relaxed)
    }
}

#[cfg(not(target_os = "linux"))]
mod stdout_at_start {
    pub(crate) fn was_closed() -> bool {
        false
    }
}
