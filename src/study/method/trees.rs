//! The order conditions of rooted trees, through order [`MAX_ORDER`].
//!
//! A tree of `n` vertices demands `Σ b_i Φ_i = 1/γ`. A vertex of the tree is a derivative of a right-hand side, and its
//! children are the values that are put into it. One tableau serves any system `ẏ = f(y)`: 37 trees. A pair serves
//! `q̇ = v`, `v̇ = f(q, v)`: a vertex is a position or a velocity, and a position has at most one child, a velocity.
//!
//! Source: Hairer, Lubich and Wanner, *Geometric Numerical Integration* (2006), ch. III.1 and III.2.

use super::super::tableau::{Pair, Tableau};
use super::given::fraction;

/// The highest order that is examined.
pub const MAX_ORDER: u32 = 6;

/// Largest error of a condition, relative to the sum of the sizes of its terms. Coefficients with 12 digits pass.
const TOLERANCE: f64 = 1e-10;

/// A tree, evaluated at every stage.
#[derive(Clone)]
struct Tree {
    /// Whether the root is a position.
    is_position: bool,
    vertices: u32,
    /// `γ`.
    density: f64,
    /// `Φ` at the stages.
    weights: Vec<f64>,
    /// The same with the absolute values of all coefficients.
    sizes: Vec<f64>,
    name: String,
}

/// The order of a method, and the first condition that fails.
pub(super) struct Order {
    pub(super) order: u32,
    pub(super) failing: Option<String>,
}

/// Examines all trees of one tableau, or of a pair.
pub(super) fn order(pair: &Pair) -> Order {
    let is_single = pair.is_runge_kutta();
    let tableau = |tree: &Tree| {
        if tree.is_position && !is_single {
            pair.q()
        } else {
            pair.v()
        }
    };
    let ones = vec![1.0; pair.stages()];
    let mut trees: Vec<Tree> = Vec::new();
    for vertices in 1..=MAX_ORDER {
        let root = |is_position: bool| Tree {
            is_position,
            vertices: 1,
            density: 1.0,
            weights: ones.clone(),
            sizes: ones.clone(),
            name: String::new(),
        };
        let smaller: Vec<Tree> = trees.iter().map(|it| grafted(it, tableau(it))).collect();
        let mut found = Vec::new();
        grow(&root(false), &smaller, vertices, &mut found);
        if !is_single {
            let velocities = smaller
                .iter()
                .filter(|it| !it.is_position && it.vertices + 1 == vertices);
            found.extend(velocities.map(|child| joined(&root(true), child)));
            if vertices == 1 {
                found.push(root(true));
            }
        }
        for tree in &mut found {
            tree.density *= f64::from(vertices);
            let letter = match (is_single, tree.is_position) {
                (true, _) => "",
                (false, true) => "q",
                (false, false) => "v",
            };
            tree.name = format!("{letter}[{}]", tree.name);
            let b = tableau(tree).b();
            let sum = |of: &[f64]| b.iter().zip(of).map(|(b, it)| b * it).sum::<f64>();
            let size: f64 = b.iter().zip(&tree.sizes).map(|(b, it)| b.abs() * it).sum();
            let (value, wanted) = (sum(&tree.weights), 1.0 / tree.density);
            if (value - wanted).abs() > TOLERANCE * (size + wanted) {
                let (value, wanted) = (fraction(value), fraction(wanted));
                return Order {
                    order: vertices - 1,
                    failing: Some(format!(
                        "order {vertices}: the tree {} gives {value}, not {wanted}",
                        tree.name
                    )),
                };
            }
        }
        trees.extend(found);
    }
    Order {
        order: MAX_ORDER,
        failing: None,
    }
}

/// The tree as a child: its weights are sums over the stages below.
fn grafted(tree: &Tree, tableau: &Tableau) -> Tree {
    let rows = |of: &[f64], size: fn(f64) -> f64| -> Vec<f64> {
        let row = |row: &Vec<f64>| row.iter().zip(of).map(|(a, it)| size(*a) * it).sum();
        tableau.a().iter().map(row).collect()
    };
    Tree {
        weights: rows(&tree.weights, |a| a),
        sizes: rows(&tree.sizes, f64::abs),
        ..tree.clone()
    }
}

/// A root with one more child.
fn joined(root: &Tree, child: &Tree) -> Tree {
    let product = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(a, b)| a * b).collect();
    Tree {
        is_position: root.is_position,
        vertices: root.vertices + child.vertices,
        density: root.density * child.density,
        weights: product(&root.weights, &child.weights),
        sizes: product(&root.sizes, &child.sizes),
        name: format!("{}{}", root.name, child.name),
    }
}

/// Adds children from the list, in its order, until the tree has all its vertices.
fn grow(tree: &Tree, children: &[Tree], vertices: u32, found: &mut Vec<Tree>) {
    if tree.vertices == vertices {
        found.push(tree.clone());
        return;
    }
    for (first, child) in children.iter().enumerate() {
        if tree.vertices + child.vertices <= vertices {
            grow(&joined(tree, child), &children[first..], vertices, found);
        }
    }
}
