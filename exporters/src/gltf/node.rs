//! The transform of the node that shows the splats.

use super::document::{Document, Node};
use crate::math::quaternion;
use crate::{Error, Result, Transform};
use std::path::Path;

/// Largest relative difference of two scales, or cosine between two axes, that f32 matrices may have.
const TOLERANCE: f64 = 1e-5;

/// The rotation of a node keeps its bits while its norm is within this of 1.
const UNIT_TOLERANCE: f64 = 1e-9;

/// `world_from_node` of the only node with the mesh; `None` if no node shows it.
///
/// # Errors
/// [`Error::Unsupported`] for several nodes and for transforms that are not similarities, [`Error::Invalid`] for broken
/// trees.
pub fn world_from_mesh(document: &Document, mesh: u32, path: &Path) -> Result<Option<Transform>> {
    let nodes = &document.nodes;
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            match parents.get_mut(child as usize) {
                Some(parent @ None) => *parent = Some(i),
                _ => {
                    return Err(invalid!(path, "node {i}: child {child} does not exist or has two parents"));
                }
            }
        }
    }
    let mut showing = nodes.iter().enumerate().filter(|(_, n)| n.mesh == Some(mesh));
    let Some((mut at, node)) = showing.next() else {
        return Ok(None);
    };
    if let Some((other, _)) = showing.next() {
        return Err(unsupported!(path, "nodes {at} and {other} both show the splats, supported: one node"));
    }
    let mut world = similarity(node).map_err(|e| unsupported!(path, "node {at}: {e}"))?;
    for _ in 0..nodes.len() {
        let Some(parent) = parents[at] else {
            return Ok(Some(world));
        };
        at = parent;
        let outer = similarity(&nodes[at]).map_err(|e| unsupported!(path, "node {at}: {e}"))?;
        world = outer.after(&world);
    }
    Err(Error::invalid(path, "nodes that are their own ancestors"))
}

/// The transform of a node relative to its parent; the error says why it is not a similarity.
pub fn similarity(node: &Node) -> Result<Transform, String> {
    if let Some(matrix) = &node.matrix {
        if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
            return Err("both a matrix and translation, rotation or scale".to_owned());
        }
        return from_matrix(matrix);
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let mut rotation = [w, x, y, z];
    let norm = quaternion::norm(rotation);
    if norm.is_nan() || (norm - 1.0).abs() > 1e-2 {
        return Err(format!("rotation {:?} is not a unit quaternion", node.rotation));
    }
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        rotation = rotation.map(|v| v / norm);
    }
    let scales = node.scale.unwrap_or([1.0; 3]);
    let scale = uniform(scales).ok_or_else(|| format!("scale {scales:?} is not uniform and positive"))?;
    let translation = node.translation.unwrap_or_default();
    finite(Transform { scale, rotation, translation })
}

fn finite(transform: Transform) -> Result<Transform, String> {
    let valid = transform.translation.iter().all(|v| v.is_finite()) && transform.scale.is_finite();
    if valid { Ok(transform) } else { Err(format!("{transform:?} is not finite")) }
}

/// The scale, if all three are equal and positive.
fn uniform(scales: [f64; 3]) -> Option<f64> {
    let first = scales[0];
    let alike = scales.iter().all(|s| *s > 0.0 && (s - first).abs() <= TOLERANCE * first);
    alike.then_some(first)
}

fn from_matrix(m: &[f64; 16]) -> Result<Transform, String> {
    let no = || "its matrix is not a rotation times a positive uniform scale with a translation".to_owned();
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let columns = [0, 4, 8].map(|c| [m[c], m[c + 1], m[c + 2]]);
    let lengths = columns.map(|c| dot(c, c).sqrt());
    let scale = uniform(lengths).ok_or_else(no)?;
    let [x, y, z] = [0, 1, 2].map(|i| columns[i].map(|v| v / lengths[i]));
    let across = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    let skew = [dot(x, y), dot(y, z), dot(z, x), dot(across, z) - 1.0];
    let last_row = [m[3], m[7], m[11], m[15] - 1.0];
    // A mirror has -2 as the last number of `skew`.
    if !skew.iter().all(|v| v.abs() <= TOLERANCE) || !last_row.iter().all(|v| v.abs() <= TOLERANCE) {
        return Err(no());
    }
    let rotation = quaternion::from_axes([x, y, z]);
    finite(Transform { scale, rotation, translation: [m[12], m[13], m[14]] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(t: &Transform) -> [f64; 16] {
        let column = |axis: [f64; 3]| quaternion::turned(t.rotation, axis).map(|v| v * t.scale);
        let mut m = [0.0; 16];
        for (i, axis) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
            m[4 * i..4 * i + 3].copy_from_slice(&column(axis));
        }
        m[12..15].copy_from_slice(&t.translation);
        m[15] = 1.0;
        m
    }

    #[test]
    fn similarity_matrices_decompose() {
        for rotation in
            [[0.5, -0.1, 0.7, 0.5], [0.1, 0.9, -0.3, 0.3], [-0.2, 0.1, 0.8, -0.1], [0.0, 0.0, 0.1, -0.99]]
        {
            let norm = quaternion::norm(rotation);
            let rotation = rotation.map(|v| v / norm);
            let transform = Transform { scale: 2.5, rotation, translation: [1.0, -2.0, 3.0] };
            let m = matrix(&transform);
            let found = similarity(&Node { matrix: Some(m), ..Node::default() }).unwrap();
            for p in [[1.0, 0.0, 0.0], [0.3, -0.7, 2.0]] {
                let [a, b] = [found, transform].map(|t| t.transform_point(p));
                // Needed 2e-15.
                assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-12), "{found:?} {transform:?}");
            }
            for (at, value) in [(0, m[0] + 0.1), (15, 2.0), (3, 0.5), (12, f64::NAN)] {
                let mut broken = m;
                broken[at] = value;
                assert!(similarity(&Node { matrix: Some(broken), ..Node::default() }).is_err(), "{at}");
            }
            let mut mirrored = m;
            mirrored[0..3].iter_mut().for_each(|v| *v = -*v);
            assert!(similarity(&Node { matrix: Some(mirrored), ..Node::default() }).is_err());
        }
    }

    #[test]
    fn parent_transforms_apply_and_invalid_trees_are_refused() {
        let path = Path::new("n");
        let half_turn = Node {
            rotation: Some([0.0, 1.0, 0.0, 0.0]),
            scale: Some([2.0; 3]),
            children: vec![1],
            ..Node::default()
        };
        let leaf = Node { mesh: Some(0), translation: Some([1.0, 0.0, 0.0]), ..Node::default() };
        let document = Document { nodes: vec![half_turn, leaf], ..Document::default() };
        let world = world_from_mesh(&document, 0, path).unwrap().unwrap();
        assert_eq!(world.transform_point([1.0, 1.0, 0.0]), [-4.0, 2.0, 0.0]);
        assert_eq!(world_from_mesh(&document, 1, path).unwrap(), None);
        type Break = fn(&mut Vec<Node>);
        let breaks: [Break; 6] = [
            |n| n[1].children = vec![0],
            |n| n[0].children = vec![1, 1],
            |n| n[0].children = vec![7],
            |n| n[0].mesh = Some(0),
            |n| n[0].scale = Some([1.0, -1.0, 1.0]),
            |n| n[0].rotation = Some([0.0; 4]),
        ];
        for (i, change) in breaks.iter().enumerate() {
            let mut broken = document.clone();
            change(&mut broken.nodes);
            assert!(world_from_mesh(&broken, 0, path).is_err(), "{i}");
        }
    }
}
