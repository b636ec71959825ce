//! A polytope covered by disjoint boxes.

use std::collections::BinaryHeap;

use super::hat::normal_mass;
use super::simplex::{Direction, Polytope, Reach, Sides, Simplex};
use crate::region::REACH;

/// Every side lies this far outside what it bounds, for rounding.
const PADDING: f64 = 1e-11;

/// The boxes, at most `most`, that hold every point of a polytope within [`REACH`] in each coordinate. The box of the
/// largest probability is split, again and again, and what is left of each half is shrunk to the polytope. Boxes
/// that lie within the polytope are not split. None where the polytope is empty.
pub(super) fn partition(polytope: &Polytope, most: usize) -> Vec<Sides> {
    let mut cutter = Cutter { polytope, simplex: Simplex::new(polytope) };
    let (mut heap, mut within) = (BinaryHeap::new(), Vec::new());
    let mut keep = |heap: &mut BinaryHeap<Node>, node: Node| {
        if node.rows.is_empty() {
            within.push(node.sides)
        } else {
            heap.push(node)
        }
        within.len() + heap.len()
    };
    if let Some(root) = cutter.root() {
        keep(&mut heap, root);
    }
    while let Some(node) = heap.pop() {
        let mut count = 0;
        for mut child in cutter.split(&node) {
            cutter.drop_rows(&mut child);
            count = keep(&mut heap, child);
        }
        if count >= most {
            break;
        }
    }
    within.extend(heap.into_iter().map(|node| node.sides));
    within
}

/// A box, and what tightening its halves can start from.
#[derive(Clone, Debug)]
struct Node {
    sides: Sides,
    /// The probability of each axis's interval.
    masses: Vec<f64>,
    /// The rows of the polytope that cut the box.
    rows: Vec<u32>,
    /// How the reach along each direction was found: 2k of them, the axes' down and up.
    ends: Vec<End>,
}

#[derive(Clone, Debug)]
struct End {
    basis: Vec<u32>,
    /// The farthest point, if it is known.
    point: Option<Vec<f64>>,
}

impl Node {
    fn mass(&self) -> f64 {
        self.masses.iter().product()
    }

    /// The largest value that normal . y takes in the box.
    fn largest(&self, normal: &[f64]) -> f64 {
        let ends = self.sides.low.iter().zip(&self.sides.high);
        normal.iter().zip(ends).map(|(c, (low, high))| (c * low).max(c * high)).sum()
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Node) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Node {}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Node) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// By probability.
impl Ord for Node {
    fn cmp(&self, other: &Node) -> std::cmp::Ordering {
        self.mass().total_cmp(&other.mass())
    }
}

struct Cutter<'a> {
    polytope: &'a Polytope,
    simplex: Simplex<'a>,
}

impl Cutter<'_> {
    /// The box around the polytope.
    fn root(&mut self) -> Option<Node> {
        let k = self.polytope.dimensions;
        let sides = Sides { low: vec![-REACH; k], high: vec![REACH; k] };
        let ends = directions(k).map(|d| End { basis: self.simplex.corner(d), point: None }).collect();
        let masses = vec![normal_mass(-REACH, REACH); k];
        let rows = (0..self.polytope.rooms.len() as u32).collect();
        let mut root = self.tightened(Node { sides, masses, rows, ends })?;
        self.drop_rows(&mut root);
        Some(root)
    }

    /// What is left of the halves of a box that is halved across the axis where least is left.
    fn split(&mut self, node: &Node) -> Vec<Node> {
        let splits = (0..self.polytope.dimensions).map(|axis| {
            let halves = [false, true].map(|upper| self.half(node, axis, upper));
            halves.into_iter().flatten().collect::<Vec<_>>()
        });
        let mass = |nodes: &[Node]| nodes.iter().map(Node::mass).sum::<f64>();
        splits.min_by(|a, b| mass(a).total_cmp(&mass(b))).expect("there are axes")
    }

    fn half(&mut self, node: &Node, axis: usize, upper: bool) -> Option<Node> {
        let mut half = node.clone();
        let middle = (node.sides.low[axis] + node.sides.high[axis]) / 2.0;
        let side = if upper { &mut half.sides.low } else { &mut half.sides.high };
        side[axis] = middle;
        self.tightened(half)
    }

    /// The node with each of its sides moved in as far as the polytope lets it. A farthest point that is still in the
    /// box is still the farthest. `None` where nothing is left.
    fn tightened(&mut self, mut node: Node) -> Option<Node> {
        for (direction, end) in directions(self.polytope.dimensions).zip(&mut node.ends) {
            if end.point.as_ref().is_some_and(|point| node.sides.contains(point)) {
                continue;
            }
            let reach = self.simplex.reach(&node.rows, &node.sides, direction, &mut end.basis);
            let (Reach::Attained(bound) | Reach::Bounded(bound)) = reach else { return None };
            let axis = direction.axis;
            match direction.up {
                true => node.sides.high[axis] = node.sides.high[axis].min(bound + PADDING),
                false => node.sides.low[axis] = node.sides.low[axis].max(-bound - PADDING),
            }
            end.point = matches!(reach, Reach::Attained(_)).then(|| self.simplex.point().to_vec());
        }
        let ends = node.sides.low.iter().zip(&node.sides.high);
        node.masses.iter_mut().zip(ends).for_each(|(mass, (&low, &high))| *mass = normal_mass(low, high));
        node.masses.iter().all(|&mass| mass > 0.0).then_some(node)
    }

    /// Forgets the rows that cut no more off the box than its padding.
    fn drop_rows(&self, node: &mut Node) {
        let mut rows = std::mem::take(&mut node.rows);
        let slack = 2.0 * PADDING * (self.polytope.dimensions as f64).sqrt();
        rows.retain(|&row| {
            let row = row as usize;
            node.largest(self.polytope.normal(row)) > self.polytope.rooms[row] + slack
        });
        node.rows = rows;
    }
}

fn directions(dimensions: usize) -> impl Iterator<Item = Direction> {
    (0..dimensions).flat_map(|axis| [false, true].map(|up| Direction { axis, up }))
}
