//! Vectors in space.

/// A vector in space, along fixed directions or along those of a node.
pub type Vector3 = nalgebra::Vector3<f64>;

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

/// Returns two unit tangents; the first as near to the direction of sliding (second component) as the normal permits.
pub fn tangents(normal: Vector3) -> [Vector3; 2] {
    let start = if normal[1].abs() < 0.9 { Vector3::y() } else { Vector3::z() };
    let first = tangential(start, normal);
    let first = first / length(first);
    [first, normal.cross(&first)]
}

/// Returns the three components of a node from values with three rows per node.
#[inline(always)]
pub fn vector3_at(values: &[f64], node: usize) -> Vector3 {
    Vector3::from_column_slice(&values[3 * node..][..3])
}
