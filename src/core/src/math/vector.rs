//! Vectors in space.

/// A vector in space, along fixed directions or along those of a node.
pub type Vector3 = nalgebra::Vector3<f64>;

/// The zero vector, for constants.
pub const ZERO: Vector3 = Vector3::new(0.0, 0.0, 0.0);

/// Returns the Euclidean length. Unlike `norm`, it takes the square root of the processor.
#[inline(always)]
pub fn length(vector: Vector3) -> f64 {
    vector.dot(&vector).sqrt()
}

/// Returns the part of a vector across a unit normal.
#[inline(always)]
pub fn tangential(vector: Vector3, normal: Vector3) -> Vector3 {
    vector - vector.dot(&normal) * normal
}

/// Returns the unit vector along a vector; zero if it is zero.
#[inline(always)]
pub fn direction(vector: Vector3) -> Vector3 {
    vector / length(vector).max(f64::MIN_POSITIVE)
}

/// Returns two unit tangents; the first as near to the direction of sliding (second component) as the normal permits.
pub fn tangents(normal: Vector3) -> [Vector3; 2] {
    let start = if normal[1].abs() < 0.9 { Vector3::y() } else { Vector3::z() };
    let first = tangential(start, normal);
    let first = first / length(first);
    [first, normal.cross(&first)]
}

/// Returns the vector of a node from values with three rows per node.
#[inline(always)]
pub(crate) fn vector3_at(values: &[f64], node: usize) -> Vector3 {
    Vector3::from_column_slice(&values[3 * node..][..3])
}

/// Sets the vector of a node in values with three rows per node.
#[inline(always)]
pub(crate) fn set_vector3_at(values: &mut [f64], node: usize, vector: Vector3) {
    values[3 * node..][..3].copy_from_slice(vector.as_slice());
}

/// Returns the vector whose components begin at `first` and are `stride` apart.
#[inline(always)]
pub(crate) fn strided_vector3(values: &[f64], first: usize, stride: usize) -> Vector3 {
    Vector3::new(values[first], values[first + stride], values[first + 2 * stride])
}

/// Sets the vector whose components begin at `first` and are `stride` apart.
#[inline(always)]
pub(crate) fn set_strided_vector3(values: &mut [f64], first: usize, stride: usize, vector: Vector3) {
    for (component, value) in vector.iter().enumerate() {
        values[first + component * stride] = *value;
    }
}
