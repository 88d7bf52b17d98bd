//! Two structures combined into one, whose contact rows are relative displacements between nodes of the two.

use nalgebra::DMatrix;
use tiprub_core::modes::modal::ModalModel;

/// Concatenates the modes of two structures. Contact rows are first − second, three for each pair of nodes (first, second).
pub fn relative(first: &ModalModel, second: &ModalModel, pairs: &[[usize; 2]]) -> ModalModel {
    let models = [first, second];
    let joined = |values: fn(&ModalModel) -> &Vec<f64>| models.into_iter().flat_map(values).copied().collect();
    let contact_modes = DMatrix::from_fn(3 * pairs.len(), first.len() + second.len(), |row, mode| {
        let (pair, component) = (pairs[row / 3], row % 3);
        match mode.checked_sub(first.len()) {
            None => first.contact_modes[(3 * pair[0] + component, mode)],
            Some(mode) => -second.contact_modes[(3 * pair[1] + component, mode)],
        }
    });
    let [rows, columns] = [first.shapes.shape(), second.shapes.shape()];
    let mut shapes = DMatrix::zeros(rows.0 + columns.0, rows.1 + columns.1);
    shapes.view_mut((0, 0), rows).copy_from(&first.shapes);
    shapes.view_mut(rows, columns).copy_from(&second.shapes);
    ModalModel {
        frequencies: joined(|model| &model.frequencies),
        damping_ratios: joined(|model| &model.damping_ratios),
        contact_modes,
        shapes,
        quasi_static: 0,
    }
}
