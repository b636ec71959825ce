//! Reach of a polytope within a box along a direction: small linear programs by the tens of thousands.
//!
//! A cover asks for the sides of tens of thousands of boxes, each of which differs from the one before in one or two
//! bounds. That keeps a basis dual feasible, so a dual simplex method goes on from it, and needs a few steps and a
//! microsecond or two. A general solver starts over, which takes microlp 0.3 ms (it can add constraints to a
//! solution, but not move a bound of one). Whatever the method does, its answer is sound: any non-negative
//! multipliers bound the maximum from above (weak duality), and what they leave of the objective is bounded over the
//! box. A limit on the steps, a perturbed objective, or rounding makes a bound loose and never wrong.

/// Largest violation that counts as rounding.
const FEASIBLE: f64 = 1e-12;

/// Smallest violation, where nothing can be exchanged, that makes a polytope count as empty.
const EMPTY: f64 = 1e-9;

/// Smallest element that a basis is changed on.
const PIVOT: f64 = 1e-12;

/// Amount added to each element of an objective, and a fraction more. Along an axis all multipliers but one would be
/// 0, and steps that gain nothing would go round in circles.
const PERTURBATION: f64 = 1e-9;

/// Largest number of steps of a program: many times what any has been seen to take, so only cycles end here.
const STEPS: usize = 200;

/// The points y with normal . y <= room for each of m rows, in k dimensions.
#[derive(Clone, Debug)]
pub(super) struct Polytope {
    /// m rows of k values, of length 1.
    pub(super) normals: Vec<f64>,
    /// Signed distances of the m bounds from the origin.
    pub(super) rooms: Vec<f64>,
    pub(super) dimensions: usize,
}

impl Polytope {
    pub(super) fn normal(&self, row: usize) -> &[f64] {
        &self.normals[row * self.dimensions..(row + 1) * self.dimensions]
    }

    /// Moves the origin to `centre`.
    #[cfg(test)]
    pub(super) fn around(mut self, centre: &[f64]) -> Polytope {
        for row in 0..self.rooms.len() {
            self.rooms[row] -= dot(self.normal(row), centre);
        }
        self
    }

    #[cfg(test)]
    pub(super) fn contains(&self, y: &[f64]) -> bool {
        (0..self.rooms.len()).all(|row| dot(self.normal(row), y) < self.rooms[row])
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// An axis-aligned box.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sides {
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
}

impl Sides {
    pub(super) fn contains(&self, y: &[f64]) -> bool {
        y.iter().zip(&self.low).zip(&self.high).all(|((y, low), high)| low <= y && y <= high)
    }
}

/// Result of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reach {
    /// The objective at the farthest point, which was found.
    Attained(f64),
    /// An upper bound on the objective.
    Bounded(f64),
    /// No point is in both the polytope and the box.
    Empty,
}

/// Working memory of a program. Constraints are numbered: the polytope's rows, then for each axis the box's low side
/// and its high side.
pub(super) struct Simplex<'a> {
    polytope: &'a Polytope,
    /// The objective, perturbed.
    objective: Vec<f64>,
    /// The inverse of the basis. Its constraints are b . y <= h, and b of one with a row of this is 1 for its own row
    /// and 0 for the others.
    inverse: Vec<f64>,
    /// Point at which all constraints of the basis are tight.
    point: Vec<f64>,
    /// Gain of the objective by each constraint of the basis.
    multipliers: Vec<f64>,
    /// Normal of the entering constraint, followed by its elements in terms of the basis.
    normal: Vec<f64>,
    column: Vec<f64>,
}

impl<'a> Simplex<'a> {
    pub(super) fn new(polytope: &'a Polytope) -> Simplex<'a> {
        let k = polytope.dimensions;
        let [objective, point, multipliers, normal, column] = [(); 5].map(|()| vec![0.0; k]);
        Simplex { polytope, objective, inverse: vec![0.0; k * k], point, multipliers, normal, column }
    }

    /// The basis of the corner of a box that is farthest along an objective: dual feasible, whatever the polytope.
    pub(super) fn corner(&self, objective: &[f64]) -> Vec<u32> {
        objective.iter().enumerate().map(|(axis, &c)| self.side(axis, c >= 0.0)).collect()
    }

    /// The point where the last program ended.
    pub(super) fn point(&self) -> &[f64] {
        &self.point
    }

    /// Finds how far the polytope reaches along an objective, a vector, within a box. Starts from a dual feasible
    /// basis, and leaves the last one in its place. Rows that are not in `rows` must not cut the box.
    pub(super) fn reach(
        &mut self,
        rows: &[u32],
        sides: &Sides,
        objective: &[f64],
        basis: &mut [u32],
    ) -> Reach {
        for (i, (perturbed, &c)) in self.objective.iter_mut().zip(objective).enumerate() {
            let fraction = (i as f64 * 0.618).fract();
            *perturbed = c + (PERTURBATION * (1.0 + fraction)).copysign(if c >= 0.0 { 1.0 } else { -1.0 });
        }
        if !self.invert(basis) {
            basis.copy_from_slice(&self.corner(objective));
            self.invert(basis);
        }
        self.locate(sides, basis);
        for _ in 0..STEPS {
            let (entering, violation) = self.most_violated(rows, sides);
            if violation <= FEASIBLE {
                return Reach::Attained(self.bound(sides, basis, objective));
            }
            self.normal.fill(0.0);
            self.add_normal(entering, 1.0);
            match self.leaving() {
                Some(leaving) => {
                    self.exchange(leaving);
                    self.step(leaving, violation);
                    basis[leaving] = entering;
                }
                None if violation > EMPTY => return Reach::Empty,
                None => break,
            }
        }
        Reach::Bounded(self.bound(sides, basis, objective))
    }

    /// The number of a side of the box.
    fn side(&self, axis: usize, high: bool) -> u32 {
        (self.polytope.rooms.len() + 2 * axis + usize::from(high)) as u32
    }

    /// The axis and the sign of the normal of a side of the box; `None` for a row of the polytope.
    fn as_side(&self, constraint: u32) -> Option<(usize, f64)> {
        let side = (constraint as usize).checked_sub(self.polytope.rooms.len())?;
        Some((side / 2, if side % 2 == 1 { 1.0 } else { -1.0 }))
    }

    fn room(&self, constraint: u32, sides: &Sides) -> f64 {
        match self.as_side(constraint) {
            Some((axis, 1.0)) => sides.high[axis],
            Some((axis, _)) => -sides.low[axis],
            None => self.polytope.rooms[constraint as usize],
        }
    }

    /// Adds a multiple of a constraint's normal to `normal`.
    fn add_normal(&mut self, constraint: u32, factor: f64) {
        match self.as_side(constraint) {
            Some((axis, sign)) => self.normal[axis] += factor * sign,
            None => {
                let normal = self.polytope.normal(constraint as usize);
                self.normal.iter_mut().zip(normal).for_each(|(sum, c)| *sum += factor * c);
            }
        }
    }

    /// Inverts a basis, whose order it changes: sides of the box go to the place of their axis, which inverts them,
    /// and rows of the polytope are exchanged for what is left. False where the basis is singular.
    fn invert(&mut self, basis: &mut [u32]) -> bool {
        const FREE: u32 = u32::MAX;
        let k = self.polytope.dimensions;
        self.inverse.fill(0.0);
        (0..k).for_each(|i| self.inverse[i * k + i] = 1.0);
        let constraints = basis.to_vec();
        basis.fill(FREE);
        for &constraint in &constraints {
            let Some((axis, sign)) = self.as_side(constraint) else { continue };
            if basis[axis] != FREE {
                return false;
            }
            basis[axis] = constraint;
            self.inverse[axis * k + axis] = sign;
        }
        let rows = self.polytope.rooms.len() as u32;
        for &constraint in constraints.iter().filter(|&&c| c < rows) {
            self.normal.copy_from_slice(self.polytope.normal(constraint as usize));
            self.express();
            let free = (0..k).filter(|&i| basis[i] == FREE);
            let Some(leaving) = free.max_by(|&i, &j| self.column[i].abs().total_cmp(&self.column[j].abs()))
            else {
                return false;
            };
            if self.column[leaving].abs() < 1e-9 {
                return false;
            }
            self.exchange(leaving);
            basis[leaving] = constraint;
        }
        true
    }

    /// Writes `normal` in terms of the basis.
    fn express(&mut self) {
        let rows = self.inverse.chunks_exact(self.polytope.dimensions);
        self.column.iter_mut().zip(rows).for_each(|(c, row)| *c = dot(&self.normal, row));
    }

    /// Updates the inverse where a constraint with the elements `column` takes a place in the basis.
    fn exchange(&mut self, leaving: usize) {
        let k = self.polytope.dimensions;
        let (before, rest) = self.inverse.split_at_mut(leaving * k);
        let (row, after) = rest.split_at_mut(k);
        row.iter_mut().for_each(|v| *v /= self.column[leaving]);
        let others = before.chunks_exact_mut(k).chain(after.chunks_exact_mut(k));
        let columns = self.column[..leaving].iter().chain(&self.column[leaving + 1..]);
        for (other, &c) in others.zip(columns) {
            other.iter_mut().zip(&*row).for_each(|(o, r)| *o -= c * r);
        }
    }

    /// Finds the point and the multipliers of a basis.
    fn locate(&mut self, sides: &Sides, basis: &[u32]) {
        let k = self.polytope.dimensions;
        self.point.fill(0.0);
        for (i, &constraint) in basis.iter().enumerate() {
            let room = self.room(constraint, sides);
            let row = &self.inverse[i * k..(i + 1) * k];
            self.point.iter_mut().zip(row).for_each(|(y, r)| *y += room * r);
            self.multipliers[i] = dot(&self.objective, row);
        }
    }

    /// Moves the point and the multipliers after an exchange.
    fn step(&mut self, leaving: usize, violation: f64) {
        let k = self.polytope.dimensions;
        let row = &self.inverse[leaving * k..(leaving + 1) * k];
        self.point.iter_mut().zip(row).for_each(|(y, r)| *y -= violation * r);
        let multiplier = self.multipliers[leaving] / self.column[leaving];
        self.multipliers.iter_mut().zip(&self.column).for_each(|(m, c)| *m -= multiplier * c);
        self.multipliers[leaving] = multiplier;
    }

    fn most_violated(&self, rows: &[u32], sides: &Sides) -> (u32, f64) {
        let mut most = (0, f64::NEG_INFINITY);
        let mut consider = |constraint, violation| {
            if violation > most.1 {
                most = (constraint, violation);
            }
        };
        for &row in rows {
            let value = dot(self.polytope.normal(row as usize), &self.point);
            consider(row, value - self.polytope.rooms[row as usize]);
        }
        for (axis, &y) in self.point.iter().enumerate() {
            consider(self.side(axis, false), sides.low[axis] - y);
            consider(self.side(axis, true), y - sides.high[axis]);
        }
        most
    }

    /// Finds the constraint whose place the entering constraint, `normal`, takes. Of those that keep the multipliers
    /// from falling below 0, by more than rounding, it is the one with the largest element (Harris's test). `None`
    /// where the entering constraint contradicts the basis.
    fn leaving(&mut self) -> Option<usize> {
        const ROUNDING: f64 = 1e-13;
        self.express();
        let ratios = || self.column.iter().zip(&self.multipliers).filter(|&(&c, _)| c > PIVOT);
        let least = ratios().map(|(c, m)| (m.max(0.0) + ROUNDING) / c).fold(f64::INFINITY, f64::min);
        let candidates = (0..self.column.len())
            .filter(|&i| self.column[i] > PIVOT && self.multipliers[i].max(0.0) / self.column[i] <= least);
        candidates.max_by(|&i, &j| self.column[i].total_cmp(&self.column[j]))
    }

    /// Upper bound on the unperturbed objective over the box and the polytope.
    fn bound(&mut self, sides: &Sides, basis: &[u32], objective: &[f64]) -> f64 {
        let k = self.polytope.dimensions;
        let mut bound = 0.0;
        self.normal.copy_from_slice(objective);
        for (i, &constraint) in basis.iter().enumerate() {
            let multiplier = dot(objective, &self.inverse[i * k..(i + 1) * k]);
            if multiplier > 0.0 {
                bound += multiplier * self.room(constraint, sides);
                self.add_normal(constraint, -multiplier);
            }
        }
        // What is left of the objective: rounding, and what the perturbation may have hidden.
        let ends = sides.low.iter().zip(&sides.high);
        bound + self.normal.iter().zip(ends).map(|(c, (low, high))| (c * low).max(c * high)).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use microlp::{ComparisonOp, OptimizationDirection, Problem};
    use rand::Rng;

    use super::*;
    use crate::random::stream::Stream;

    /// The result of microlp: `None` where there is no point.
    fn by_microlp(polytope: &Polytope, sides: &Sides, objective: &[f64]) -> Option<f64> {
        let mut problem = Problem::new(OptimizationDirection::Maximize);
        let ends = sides.low.iter().copied().zip(sides.high.iter().copied());
        let y: Vec<_> = objective.iter().zip(ends).map(|(&c, ends)| problem.add_var(c, ends)).collect();
        for (row, &room) in polytope.rooms.iter().enumerate() {
            let terms = y.iter().copied().zip(polytope.normal(row).iter().copied());
            problem.add_constraint(terms.collect::<Vec<_>>(), ComparisonOp::Le, room);
        }
        Some(problem.solve().ok()?.into_solution().ok()?.objective())
    }

    /// Random polytopes, some of them empty and half of them with every row twice; along each axis from the basis of
    /// a box twice as large.
    #[test]
    fn reaches_are_those_of_microlp() {
        let mut rng = Stream::new(1).rng();
        let mut uniform = move || f64::from(rng.next_u32()) / 2f64.powi(31) - 1.0;
        let mut empty = 0;
        for trial in 0..300 {
            let (k, rows) = (1 + trial % 7, 3 + trial % 40);
            let mut normals = Vec::new();
            for _ in 0..rows {
                let normal: Vec<f64> = (0..k).map(|_| uniform()).collect();
                let length = dot(&normal, &normal).sqrt();
                normals.extend(normal.iter().map(|c| c / length));
            }
            let mut rooms: Vec<f64> = (0..rows).map(|_| 0.7 * uniform() + 0.65).collect();
            if trial % 2 == 0 {
                normals.extend_from_within(..);
                rooms.extend_from_within(..);
            }
            let polytope = Polytope { normals, rooms, dimensions: k };
            let all: Vec<u32> = (0..polytope.rooms.len() as u32).collect();
            let mut simplex = Simplex::new(&polytope);
            let large = Sides { low: vec![-2.0; k], high: vec![2.0; k] };
            let small = Sides { low: vec![-1.0; k], high: vec![1.0; k] };
            for direction in 0..2 * k {
                let mut objective = vec![0.0; k];
                objective[direction / 2] = if direction % 2 == 0 { 1.0 } else { -1.0 };
                let mut basis = simplex.corner(&objective);
                for sides in [&large, &small] {
                    let expected = by_microlp(&polytope, sides, &objective);
                    match (simplex.reach(&all, sides, &objective, &mut basis), expected) {
                        (Reach::Attained(reach), Some(expected)) => {
                            assert!((reach - expected).abs() < 1e-7, "{trial}: {reach} {expected}");
                            assert!(all.iter().all(|&row| {
                                let row = row as usize;
                                dot(polytope.normal(row), simplex.point()) <= polytope.rooms[row] + 1e-9
                            }));
                        }
                        (Reach::Empty, None) => empty += 1,
                        (found, expected) => panic!("{trial}: {found:?}, but {expected:?}"),
                    }
                }
            }
        }
        assert!(empty > 100);
    }
}
