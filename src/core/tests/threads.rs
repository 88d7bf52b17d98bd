//! Steps do not allocate in any thread. The allocator counts for the whole process, so this program runs without the test harness, whose main
//! thread also allocates.

use std::alloc::{GlobalAlloc, Layout, System as SystemAllocator};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use tiprub_core::CoSimulation;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::TimeSettings;
use tiprub_test_models::{bumps, go, reference, rich_blade, set};

struct Counting;

static ARMED: AtomicBool = AtomicBool::new(false);
static COUNT: AtomicUsize = AtomicUsize::new(0);

// SAFETY: forwards to the system allocator; the counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    // SAFETY: the caller's guarantees are those of the system allocator.
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if ARMED.load(Ordering::Relaxed) {
            COUNT.fetch_add(1, Ordering::Relaxed);
        }
        // SAFETY: as above.
        unsafe { SystemAllocator.alloc(layout) }
    }
    // SAFETY: as above.
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { SystemAllocator.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn main() {
    let mut scene = bumps(rich_blade(11));
    scene.settings.time = TimeSettings { scheme: Scheme::Galerkin, step: 4e-5, ..TimeSettings::default() };
    for threads in [1, 2, 4] {
        let mut simulation = tiprub_core::Simulation::new(&scene).unwrap();
        simulation.set_integer(reference(&simulation, "threads"), threads).unwrap();
        simulation.initialise(0.0).unwrap();
        COUNT.store(0, Ordering::Relaxed);
        ARMED.store(true, Ordering::Relaxed);
        for n in 0..200_u32 {
            if n % 20 < 3 {
                set(&mut simulation, "casing_radius_change", 1e-6 * f64::from(n % 7));
            }
            go(&mut simulation, [1e-5, 1e-4, 4e-5, 3.3e-5][(n % 4) as usize]);
        }
        ARMED.store(false, Ordering::Relaxed);
        assert_eq!(COUNT.load(Ordering::Relaxed), 0, "{threads} threads");
        assert!(simulation.system().ledger().friction_loss.value() > 0.0, "no contact");
        assert!(simulation.take_notes().is_empty(), "warnings allocate");
    }
}
