//! A polytope covered by disjoint boxes.

use std::collections::BinaryHeap;

use super::half_space::REACH;
use super::hat::normal_mass;
use super::simplex::{Polytope, Reach, Sides, Simplex};

/// Distance by which every side lies outside what it bounds, for rounding.
const PADDING: f64 = 1e-11;

/// Divides a polytope into boxes, at most `most`, that hold every point of it within [`REACH`] in each coordinate.
/// The box of the largest probability is split, again and again, and what is left of each half is shrunk to the
/// polytope. Boxes that lie within the polytope are not split. No boxes where the polytope is empty.
pub(super) fn partition(polytope: &Polytope, most: usize) -> Vec<Sides> {
    let mut cutter = Cutter::new(polytope);
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

/// A box, with the starting points for tightening its halves.
#[derive(Clone, Debug)]
struct Node {
    sides: Sides,
    /// The probability of each axis's interval.
    masses: Vec<f64>,
    /// The rows of the polytope that cut the box.
    rows: Vec<u32>,
    /// Basis and farthest point of the last program along each direction.
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

/// Orders nodes by probability.
impl Ord for Node {
    fn cmp(&self, other: &Node) -> std::cmp::Ordering {
        self.mass().total_cmp(&other.mass())
    }
}

struct Cutter<'a> {
    polytope: &'a Polytope,
    simplex: Simplex<'a>,
    /// The two ways along each axis, down and up.
    directions: Vec<Vec<f64>>,
}

impl<'a> Cutter<'a> {
    fn new(polytope: &'a Polytope) -> Cutter<'a> {
        let k = polytope.dimensions;
        let direction = |axis, sign| (0..k).map(|i| if i == axis { sign } else { 0.0 }).collect();
        let directions = (0..k).flat_map(|axis| [-1.0, 1.0].map(|sign| direction(axis, sign))).collect();
        Cutter { polytope, simplex: Simplex::new(polytope), directions }
    }

    /// The box around the polytope.
    fn root(&mut self) -> Option<Node> {
        let k = self.polytope.dimensions;
        let sides = Sides { low: vec![-REACH; k], high: vec![REACH; k] };
        let rows = self.walls(&sides);
        let ends =
            self.directions.iter().map(|d| End { basis: self.simplex.corner(d), point: None }).collect();
        let masses = vec![normal_mass(-REACH, REACH); k];
        let mut root = self.tightened(Node { sides, masses, rows, ends })?;
        self.drop_rows(&mut root);
        Some(root)
    }

    /// The rows that cut something off the box that no other row does. Most bounds of most bands do not.
    fn walls(&mut self, sides: &Sides) -> Vec<u32> {
        let mut walls: Vec<u32> = (0..self.polytope.rooms.len() as u32).collect();
        for row in 0..self.polytope.rooms.len() {
            let others: Vec<u32> = walls.iter().copied().filter(|&wall| wall != row as u32).collect();
            let normal = self.polytope.normal(row);
            let reach = self.simplex.reach(&others, sides, normal, &mut self.simplex.corner(normal));
            if let Reach::Attained(bound) | Reach::Bounded(bound) = reach
                && bound < self.polytope.rooms[row]
            {
                walls = others;
            }
        }
        walls
    }

    /// Splits a box across the axis on which its two tightened halves keep the least.
    fn split(&mut self, node: &Node) -> Vec<Node> {
        let mut best = (f64::INFINITY, Vec::new());
        for axis in 0..self.polytope.dimensions {
            let (mut mass, mut halves) = (0.0, Vec::new());
            for upper in [false, true] {
                // The second half is not needed to see that the first is too much.
                if mass < best.0 {
                    let half = self.half(node, axis, upper);
                    mass += half.as_ref().map_or(0.0, Node::mass);
                    halves.extend(half);
                }
            }
            if mass < best.0 {
                best = (mass, halves);
            }
        }
        best.1
    }

    fn half(&mut self, node: &Node, axis: usize, upper: bool) -> Option<Node> {
        let mut half = node.clone();
        let middle = (node.sides.low[axis] + node.sides.high[axis]) / 2.0;
        let side = if upper { &mut half.sides.low } else { &mut half.sides.high };
        side[axis] = middle;
        self.tightened(half)
    }

    /// Moves each side of a node in as far as the polytope lets it. A farthest point that is still in the box is
    /// still the farthest. `None` where nothing is left.
    fn tightened(&mut self, mut node: Node) -> Option<Node> {
        for (i, end) in node.ends.iter_mut().enumerate() {
            if end.point.as_ref().is_some_and(|point| node.sides.contains(point)) {
                continue;
            }
            let reach = self.simplex.reach(&node.rows, &node.sides, &self.directions[i], &mut end.basis);
            let (Reach::Attained(bound) | Reach::Bounded(bound)) = reach else { return None };
            let axis = i / 2;
            match i % 2 {
                0 => node.sides.low[axis] = node.sides.low[axis].max(-bound - PADDING),
                _ => node.sides.high[axis] = node.sides.high[axis].min(bound + PADDING),
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
