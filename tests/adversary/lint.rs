//! Proof by structure: whether any f32 operation is made of the unrounded result of another. A value is free that is a
//! constant, was read from a buffer, or came through an integer. What an operation gives is bound, and may go into an
//! integer, a store or a selection, and nowhere else. So no compiler finds two operations that it could join.

use naga::ScalarKind as Kind;

use super::tape::{BinaryOperator as B, Instruction, MathFunction as M, Place, Slot, Tape};

/// What a compiler could make of a value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum State {
    #[default]
    Free,
    /// A free value times a power of two, which is exact: as good as free in a sum or a product.
    Scaled,
    Bound,
}

/// An operation that a compiler could join with another, or that devices round as they like.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Finding {
    pub(crate) function: String,
    pub(crate) what: String,
}

struct Lint<'a> {
    tape: &'a Tape,
    states: Vec<State>,
    /// Number of bits that an integer has at most, in its size.
    bits: Vec<u32>,
    constants: Vec<Option<u32>>,
    findings: Vec<Finding>,
}

/// Findings in a tape, in its order.
pub(crate) fn findings(tape: &Tape) -> Vec<Finding> {
    let mut lint = Lint {
        tape,
        states: vec![State::Free; tape.registers],
        bits: vec![0; tape.registers],
        constants: vec![None; tape.registers],
        findings: Vec::new(),
    };
    for &(slot, bits) in &tape.constants {
        lint.constants[slot] = Some(bits);
        lint.bits[slot] = u32::BITS - bits.leading_zeros();
    }
    // Registers only ever gain states, whatever the way through the shader: until none does.
    loop {
        lint.findings.clear();
        let before = (lint.states.clone(), lint.bits.clone());
        tape.instructions.iter().enumerate().for_each(|(at, instruction)| lint.instruction(at, instruction));
        if before == (lint.states.clone(), lint.bits.clone()) {
            return lint.findings;
        }
    }
}

impl Lint<'_> {
    fn find(&mut self, at: usize, what: String) {
        let function = self.tape.functions[self.tape.origins[at]].clone();
        self.findings.push(Finding { function, what });
    }

    fn is_in(&self, at: usize, functions: &[&str]) -> bool {
        functions.contains(&self.tape.functions[self.tape.origins[at]].as_str())
    }

    fn give(&mut self, to: Slot, state: State, bits: u32) {
        self.states[to] = self.states[to].max(state);
        self.bits[to] = self.bits[to].max(bits);
    }

    fn instruction(&mut self, at: usize, instruction: &Instruction) {
        match instruction {
            Instruction::Jump(_) | Instruction::JumpUnless(..) => {}
            &Instruction::Copy { to, from } => self.give(to, self.states[from], self.bits[from]),
            &Instruction::Binary { operator, kind: Kind::Float, to, left, right } => {
                self.floats(at, operator, to, [left, right]);
            }
            &Instruction::Binary { operator, to, left, right, .. } => {
                let bits = match (operator, self.constants[right]) {
                    (B::And, Some(mask)) => u32::BITS - mask.leading_zeros(),
                    (B::ShiftRight, Some(by)) => self.bits[left].saturating_sub(by),
                    _ => u32::BITS,
                };
                self.give(to, State::Free, bits);
            }
            &Instruction::Unary { kind, to, from, .. } => {
                let state = if kind == Kind::Float { self.states[from] } else { State::Free };
                self.give(to, state, u32::BITS);
            }
            &Instruction::Convert { to, from, of, into } => {
                if of == Kind::Float
                    && self.states[from] == State::Bound
                    && !self.is_in(at, &["root", "ratio"])
                {
                    self.find(at, "an integer of a bound value".to_owned());
                }
                // Exponents, steps of a correction: small whatever the types say.
                let is_small = self.is_in(at, &["root", "ratio", "power_of_two"]);
                if into == Kind::Float && of != Kind::Float && self.bits[from] > 24 && !is_small {
                    self.find(at, "a conversion that rounds".to_owned());
                }
                self.give(to, State::Free, u32::BITS);
            }
            &Instruction::Bitcast { to, .. } => self.give(to, State::Free, u32::BITS),
            &Instruction::Select { to, accept, reject, .. } => {
                self.give(to, self.states[accept].max(self.states[reject]), u32::BITS);
            }
            &Instruction::Math { function, kind, to, arguments } => {
                self.math(at, function, kind, to, arguments)
            }
            Instruction::Load { to, from } => match from.buffer {
                Some(_) => self.give(*to, State::Free, u32::BITS),
                None => reach(from).for_each(|slot| self.give(*to, self.states[slot], u32::BITS)),
            },
            Instruction::Store { to, from } => {
                if to.buffer.is_none() {
                    reach(to).for_each(|slot| self.give(slot, self.states[*from], u32::BITS));
                }
            }
        }
    }

    fn floats(&mut self, at: usize, operator: B, to: Slot, operands: [Slot; 2]) {
        let worst = operands.map(|slot| self.states[slot]).into_iter().max().expect("there are two");
        let name = match operator {
            B::Add | B::Subtract => "a sum",
            B::Multiply => "a product",
            B::Divide => "a quotient",
            _ => "a comparison",
        };
        // The estimate of a root or a quotient, and the step of its correction, may be anything near.
        let is_estimate = self.is_in(at, &["root", "ratio"]);
        if worst == State::Bound && !is_estimate {
            self.find(at, format!("{name} of a bound value"));
        }
        if operator == B::Divide && !is_estimate {
            self.find(at, "a quotient outside of `ratio`".to_owned());
        }
        let is_power = |slot: Slot| {
            self.constants[slot].is_some_and(|bits| bits & 0x007F_FFFF == 0 && bits & 0x7F80_0000 != 0)
        };
        let state = match operator {
            B::Multiply if worst == State::Free && operands.into_iter().any(is_power) => State::Scaled,
            B::Add | B::Subtract | B::Multiply | B::Divide => State::Bound,
            _ => State::Free,
        };
        self.give(to, state, u32::BITS);
    }

    fn math(&mut self, at: usize, function: M, kind: Kind, to: Slot, arguments: [Slot; 3]) {
        if kind != Kind::Float {
            return self.give(to, State::Free, u32::BITS);
        }
        match function {
            M::Sqrt => {
                if !self.is_in(at, &["root"]) {
                    self.find(at, "a root outside of `root`".to_owned());
                }
                self.give(to, State::Bound, u32::BITS);
            }
            M::Abs => self.give(to, self.states[arguments[0]], u32::BITS),
            M::Max | M::Min | M::Clamp => {
                let count = if function == M::Clamp { 3 } else { 2 };
                let worst =
                    arguments[..count].iter().map(|&slot| self.states[slot]).max().expect("there are two");
                if worst == State::Bound {
                    self.find(at, format!("{function:?} of a bound value"));
                }
                self.give(to, worst, u32::BITS);
            }
            other => self.find(at, format!("{other:?}, which no draw needs")),
        }
    }
}

/// The registers that a place may be.
fn reach(place: &Place) -> impl Iterator<Item = Slot> {
    let mut reached = vec![place.start];
    for &(_, step, count) in &place.indices {
        reached = reached.into_iter().flat_map(|slot| (0..count).map(move |i| slot + i * step)).collect();
    }
    reached.into_iter()
}
