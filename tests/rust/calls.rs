//! Calls that exist in both standards, with the names of the standard.

macro_rules! calls_of_both {
    (slave: $slave:ident, exit: $exit:ident, reset: $reset:ident, terminate: $terminate:ident, free: $free:ident,
     save: $save:ident, restore: $restore:ident,
     size: $size:ident, serialise: $serialise:ident, deserialise: $deserialise:ident,) => {
        impl $slave<'_> {
            /// Exits Initialization Mode.
            pub fn exit(&self) -> i32 {
                // SAFETY: the instance is alive.
                unsafe { (self.api.$exit)(self.handle) }
            }

            /// Resets the instance.
            pub fn reset(&self) -> i32 {
                // SAFETY: the instance is alive.
                unsafe { (self.api.$reset)(self.handle) }
            }

            /// Terminates the run.
            pub fn terminate(&self) -> i32 {
                // SAFETY: the instance is alive.
                unsafe { (self.api.$terminate)(self.handle) }
            }

            /// Saves into a new state.
            #[track_caller]
            pub fn save(&self) -> StatePointer {
                let mut state = std::ptr::null_mut();
                // SAFETY: a valid location for the state.
                self.expect(unsafe { (self.api.$save)(self.handle, &raw mut state) });
                state
            }

            /// Restores a state.
            pub fn restore(&self, state: StatePointer) -> i32 {
                // SAFETY: the instance is alive; the library must handle any state.
                unsafe { (self.api.$restore)(self.handle, state) }
            }

            /// Returns the bytes of a state.
            #[track_caller]
            pub fn serialise(&self, state: StatePointer) -> Vec<u8> {
                let mut size = 0;
                // SAFETY: a valid location for the size.
                self.expect(unsafe { (self.api.$size)(self.handle, state, &raw mut size) });
                let mut bytes = vec![0; size];
                // SAFETY: an array of that size.
                self.expect(unsafe { (self.api.$serialise)(self.handle, state, bytes.as_mut_ptr(), size) });
                bytes
            }

            /// Deserialises bytes into a new state.
            pub fn deserialise(&self, bytes: &[u8]) -> (i32, StatePointer) {
                let (mut state, size) = (std::ptr::null_mut(), bytes.len());
                // SAFETY: an array of that size, a valid location for the state.
                let status = unsafe { (self.api.$deserialise)(self.handle, bytes.as_ptr(), size, &raw mut state) };
                (status, state)
            }

            /// Returns the messages so far; the journal is empty afterwards.
            pub fn log(&self) -> String {
                // SAFETY: the journal lives as long as this importer, and is only accessed between calls.
                let context = unsafe { &mut *self.context };
                std::mem::take(AsMut::<crate::Journal>::as_mut(context)).text()
            }

            /// Requires OK or Warning.
            #[track_caller]
            pub fn expect(&self, status: i32) {
                assert!(status == crate::OK || status == crate::WARNING, "status {status}: {}", self.log());
            }
        }

        impl Drop for $slave<'_> {
            fn drop(&mut self) {
                // SAFETY: the instance is NULL or alive and no longer used; the context came from a box.
                unsafe {
                    (self.api.$free)(self.handle);
                    drop(Box::from_raw(self.context));
                }
            }
        }
    };
}
