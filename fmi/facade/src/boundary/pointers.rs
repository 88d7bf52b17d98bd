//! Pointers as C passes them. Each type is a bare pointer in the ABI; only this module relies on the guarantees of the
//! standard (a pointer is valid for as many elements as the accompanying count states, for the duration of the call).

use std::ffi::{CStr, c_char, c_void};
use std::mem::size_of;

use crate::slave::{Refusal, Result};

/// The importer's pointer, which is passed back with every callback and never dereferenced.
pub type ImporterEnvironment = *mut c_void;

/// Array or single value to read from.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub struct In<T>(*const T);

/// Array or single value to write to.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub(crate) struct Out<T>(*mut T);

/// NUL-terminated text.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub struct TextArgument(*const c_char);

/// Checked destination for a known number of values.
#[derive(Debug)]
pub(crate) struct ArrayArgument<T> {
    pointer: *mut T,
    length: usize,
}

fn check<T>(pointer: *const T, count: usize, name: &str) -> Result<()> {
    if pointer.is_null() {
        return Err(Refusal::error(format!(
            "argument {name} is NULL, but its length is given as {count}. Pass an array of that length"
        )));
    }
    if !pointer.is_aligned() {
        return Err(Refusal::error(format!("argument {name} is not aligned for its type. Pass an aligned array")));
    }
    if count > isize::MAX.unsigned_abs() / size_of::<T>().max(1) {
        return Err(Refusal::error(format!(
            "argument {name}: {count} elements do not fit into memory. Pass the actual count"
        )));
    }
    Ok(())
}

impl<T> In<T> {
    /// Returns the array; if `count` is zero, an empty one without touching the pointer.
    ///
    /// # Errors
    /// A pointer that is NULL or misaligned, or more than `limit` elements.
    pub(crate) fn array(&self, count: usize, limit: usize, name: &str) -> Result<&[T]> {
        if count == 0 {
            return Ok(&[]);
        }
        if count > limit {
            return Err(Refusal::error(format!(
                "{count} elements of {name} exceed the limit of this FMU. Pass the actual count"
            )));
        }
        check(self.0, count, name)?;
        // SAFETY: not null, aligned, and by the standard's contract an array of `count` initialised elements that does
        // not change during the call; the borrow ends with the argument, which lives for the call.
        Ok(unsafe { std::slice::from_raw_parts(self.0, count) })
    }

    /// Returns the single value; `None` if the pointer is NULL.
    pub(crate) fn single(&self) -> Option<&T> {
        // SAFETY: null is handled by `as_ref`, misalignment by the filter, and by the standard's contract the pointer is to
        // an initialised value for the duration of the call.
        unsafe { Some(self.0).filter(|pointer| pointer.is_aligned())?.as_ref() }
    }
}

impl<T: Copy> Out<T> {
    /// Returns the destination of `count` values; the pointer is not touched if `count` is zero.
    ///
    /// # Errors
    /// A pointer that is NULL or misaligned.
    pub(crate) fn window(&self, count: usize, name: &str) -> Result<ArrayArgument<T>> {
        if count > 0 {
            check(self.0.cast_const(), count, name)?;
        }
        Ok(ArrayArgument { pointer: self.0, length: count })
    }

    /// Returns the destination of one value.
    ///
    /// # Errors
    /// A pointer that is NULL or misaligned.
    pub(crate) fn single(&self, name: &str) -> Result<ArrayArgument<T>> {
        self.window(1, name)
    }

    /// Writes one value if the pointer is valid.
    pub(crate) fn offer(&self, value: T) {
        if let Ok(window) = self.single("") {
            window.fill(&[value]);
        }
    }

    /// Returns whether the pointer is NULL.
    pub(crate) fn is_null(&self) -> bool {
        self.0.is_null()
    }
}

impl<T: Copy> ArrayArgument<T> {
    /// Writes the values. Nothing is written unless their number equals the length of the destination.
    pub(crate) fn fill(self, values: &[T]) {
        if values.len() == self.length && self.length > 0 {
            // SAFETY: checked not null and aligned, by the standard's contract valid for `length` elements; `copy`
            // permits overlap with the importer's array.
            unsafe { std::ptr::copy(values.as_ptr(), self.pointer, self.length) };
        }
    }

    /// Returns the first value, which by the standard is initialised for in-out arguments.
    pub(crate) fn current(&self) -> Option<T> {
        // SAFETY: checked not null and aligned; in-out arguments are initialised by the importer.
        (self.length > 0).then(|| unsafe { self.pointer.read() })
    }
}

impl TextArgument {
    /// Returns the text; `None` if the pointer is NULL.
    ///
    /// # Errors
    /// Text that is not UTF-8.
    pub(crate) fn read(&self, name: &str) -> Result<Option<&str>> {
        if self.0.is_null() {
            return Ok(None);
        }
        // SAFETY: not null, and by the standard's contract NUL-terminated and unchanged during the call.
        let text = unsafe { CStr::from_ptr(self.0) };
        let text = text.to_str().map_err(|_| Refusal::error(format!("argument {name} is not UTF-8. Pass UTF-8 text")));
        text.map(Some)
    }

    /// Returns the text.
    ///
    /// # Errors
    /// A pointer that is NULL, or text that is not UTF-8.
    pub(crate) fn required(&self, name: &str) -> Result<&str> {
        self.read(name)?.ok_or_else(|| Refusal::error(format!("argument {name} is NULL. Pass a string")))
    }
}
