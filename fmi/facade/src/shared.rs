//! Functions that exist in both versions of the standard and differ only in their names and C types.

/// Defines the functions for logging, for the end of the life cycle and for saved states; `$boolean` is the C type of truth values.
macro_rules! shared_functions {
    (
        $boolean:ty; $debug:ident $free:ident $exit:ident $terminate:ident $reset:ident
        $get:ident $set:ident $free_state:ident $size:ident $serialize:ident $deserialize:ident
    ) => {
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $debug(
            instance: InstanceHandle,
            loggingOn: $boolean,
            nCategories: usize,
            categories: In<TextArgument>,
        ) -> FmiStatus {
            boundary::set_debug_logging(instance, &order::SET_DEBUG_LOGGING, loggingOn != 0, (categories, nCategories))
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $free(instance: InstanceHandle) {
            release(instance, &order::FREE_INSTANCE);
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $exit(instance: InstanceHandle) -> FmiStatus {
            guard(instance, &order::EXIT_INITIALIZATION_MODE, Slave::exit_initialisation)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $terminate(instance: InstanceHandle) -> FmiStatus {
            guard(instance, &order::TERMINATE, |slave| {
                slave.terminate();
                Ok(())
            })
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $reset(instance: InstanceHandle) -> FmiStatus {
            guard(instance, &order::RESET, |slave| {
                slave.reset();
                Ok(())
            })
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $get(instance: InstanceHandle, state: Out<StateHandle>) -> FmiStatus {
            state::save(instance, &order::GET_FMU_STATE, state)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $set(instance: InstanceHandle, state: StateHandle) -> FmiStatus {
            state::restore(instance, &order::SET_FMU_STATE, state)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $free_state(instance: InstanceHandle, state: Out<StateHandle>) -> FmiStatus {
            state::free(instance, &order::FREE_FMU_STATE, state)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $size(instance: InstanceHandle, state: StateHandle, size: Out<usize>) -> FmiStatus {
            state::size(instance, &order::SERIALIZED_FMU_STATE_SIZE, state, size)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $serialize(
            instance: InstanceHandle,
            state: StateHandle,
            serializedState: Out<u8>,
            size: usize,
        ) -> FmiStatus {
            state::serialise(instance, &order::SERIALIZE_FMU_STATE, state, serializedState, size)
        }

        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $deserialize(
            instance: InstanceHandle,
            serializedState: In<u8>,
            size: usize,
            state: Out<StateHandle>,
        ) -> FmiStatus {
            state::deserialise(instance, &order::DESERIALIZE_FMU_STATE, serializedState, size, state)
        }
    };
}

/// Defines a getter or setter from the C type of its array of values and the call that it makes. `[]` contains the
/// number of values if it is an argument of the function.
macro_rules! accessor {
    ([$($n_values:ident)?] $function:ident $array:ty, $action:expr) => {
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $function(
            instance: InstanceHandle,
            references: In<u32>,
            count: usize,
            values: $array,
            $($n_values: usize,)?
        ) -> FmiStatus {
            let values = (values, [count, $($n_values)?].into_iter().next_back().unwrap_or(count));
            $action(instance, (references, count), values)
        }
    };
}

/// Defines the getters and setters of all types of variables. A row lists the names of the functions, the
/// name of the type, the C type, the type of the values and the conversions. The first row lists the functions for
/// strings, and the name of their array of values for messages.
macro_rules! accessors {
    (
        $n_values:tt $get_string:ident $set_string:ident $argument:literal;
        $($get:ident $set:ident $name:literal $c:ty, $rust:ty, $out:expr, $in:expr;)*
    ) => {
        $(
            $crate::shared::accessor! { $n_values $get Out<$c>, |instance, references, values| {
                let convert: fn($rust) -> $c = $out;
                boundary::get((instance, &order::getter(stringify!($get)), $name), references, values, convert)
            }}
            $crate::shared::accessor! { $n_values $set In<$c>, |instance, references, values| {
                let convert: fn(&$c) -> $rust = $in;
                let target = (instance, &order::setter(stringify!($set)), $name);
                boundary::set(target, references, values, |value| Ok(convert(value)))
            }}
        )*
        $crate::shared::accessor! { $n_values $get_string Out<*const c_char>, |instance, references, values| {
            boundary::strings((instance, &order::getter(stringify!($get_string))), references, values)
        }}
        $crate::shared::accessor! { $n_values $set_string In<TextArgument>, |instance, references, values| {
            let convert = |value: &TextArgument| value.required($argument).map(str::to_owned);
            let target = (instance, &order::setter(stringify!($set_string)), "String");
            boundary::set(target, references, values, convert)
        }}
    };
}

pub(crate) use {accessor, accessors, shared_functions};
