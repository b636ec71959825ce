//! A device that does all that WGSL and Vulkan let it do with f32, running a tape: it fuses products into sums, rearranges
//! sums and products, rounds roots, quotients and conversions its own way, and flushes what is below the normal range.

use naga::ScalarKind as Kind;

use super::tape::{BinaryOperator as B, Instruction, MathFunction as M, Place, Tape, UnaryOperator as U};

/// Liberties of a device, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Liberties(pub(crate) u32);

impl Liberties {
    pub(crate) const NONE: Liberties = Liberties(0);
    /// a * b + c may have one rounding.
    pub(crate) const FUSE: Liberties = Liberties(1);
    /// (a + b) + c, (a * b) * c and (a + b) * c may be rearranged.
    pub(crate) const REORDER: Liberties = Liberties(2);
    /// Roots may be off by 3 units in the last place, and quotients by 2.
    pub(crate) const LOOSE: Liberties = Liberties(4);
    /// Values below the normal range are 0.
    pub(crate) const FLUSH: Liberties = Liberties(8);
    /// Integers may be converted to either of the nearest values.
    pub(crate) const CONVERT: Liberties = Liberties(16);
    /// All of these.
    pub(crate) const ALL: Liberties = Liberties(31);
    /// Each always, and not by chance.
    pub(crate) const ALWAYS: Liberties = Liberties(32);
    /// Roots may be off by 7 units in the last place, and quotients by 3.
    pub(crate) const LOOSER: Liberties = Liberties(64);
    /// The guards of products are seen through.
    pub(crate) const SEE_PRODUCTS: Liberties = Liberties(128);
    /// The guards of sums are seen through.
    pub(crate) const SEE_SUMS: Liberties = Liberties(256);

    pub(crate) const fn and(self, other: Liberties) -> Liberties {
        Liberties(self.0 | other.0)
    }

    fn has(self, other: Liberties) -> bool {
        self.0 & other.0 != 0
    }
}

/// What a compiler knows of a value.
#[derive(Clone, Copy, PartialEq)]
enum Made {
    Unknown,
    Product(f32, f32),
    Sum(f32, f32),
}

#[derive(Clone, Copy)]
struct Word {
    bits: u32,
    made: Made,
}

impl Word {
    fn of(bits: u32) -> Word {
        Word { bits, made: Made::Unknown }
    }

    fn float(self) -> f32 {
        f32::from_bits(self.bits)
    }
}

/// A device with its memory.
pub(crate) struct Machine<'a> {
    tape: &'a Tape,
    liberties: Liberties,
    registers: Vec<Word>,
    /// Words of each buffer, in the order of the tape's bindings.
    pub(crate) buffers: Vec<Vec<u32>>,
}

fn mix(a: u32, b: u32, c: u32) -> u32 {
    let mut h = a.wrapping_mul(0x9E37_79B1)
        ^ b.rotate_left(13).wrapping_mul(0x85EB_CA77)
        ^ c.wrapping_mul(0xC2B2_AE3D);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297A_2D39);
    h ^ (h >> 15)
}

/// A value off by some units in the last place, of up to `most`.
fn off(value: f32, most: u32, word: u32) -> f32 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    f32::from_bits(value.to_bits().wrapping_add_signed((word % (2 * most + 1)) as i32 - most as i32))
}

impl<'a> Machine<'a> {
    pub(crate) fn new(tape: &'a Tape, liberties: Liberties, buffers: Vec<Vec<u32>>) -> Machine<'a> {
        assert_eq!(buffers.len(), tape.bindings.len());
        let mut registers = vec![Word::of(0); tape.registers];
        tape.constants.iter().for_each(|&(slot, bits)| registers[slot] = Word::of(bits));
        Machine { tape, liberties, registers, buffers }
    }

    /// Runs one thread.
    pub(crate) fn run(&mut self, thread: u32) {
        self.registers[self.tape.thread] = Word::of(thread);
        let mut at = 0;
        while let Some(instruction) = self.tape.instructions.get(at) {
            at += 1;
            match instruction {
                Instruction::Jump(to) => at = *to,
                Instruction::JumpUnless(condition, to) => {
                    if self.registers[*condition].bits == 0 {
                        at = *to;
                    }
                }
                Instruction::Copy { to, from } => self.registers[*to] = self.registers[*from],
                Instruction::Binary { operator, kind, to, left, right } => {
                    let (left, right) = (self.registers[*left], self.registers[*right]);
                    self.registers[*to] = match kind {
                        Kind::Float => self.floats(*operator, left, right),
                        Kind::Sint => Word::of(signed(*operator, left.bits as i32, right.bits)),
                        _ => self.unsigned(*operator, left, right),
                    };
                }
                Instruction::Unary { operator, kind, to, from } => {
                    let from = self.registers[*from];
                    self.registers[*to] = match (operator, kind) {
                        (U::Negate, Kind::Float) => negated(from),
                        (U::Negate, _) => Word::of(from.bits.wrapping_neg()),
                        (U::LogicalNot, _) => Word::of(from.bits ^ 1),
                        (U::BitwiseNot, _) => Word::of(!from.bits),
                    };
                }
                Instruction::Convert { to, from, of, into } => {
                    let from = self.registers[*from];
                    self.registers[*to] = match (of, into) {
                        (Kind::Float, Kind::Sint) => Word::of(from.float() as i32 as u32),
                        (Kind::Float, Kind::Uint) => Word::of(from.float() as u32),
                        (Kind::Sint, Kind::Float) => self.converted(i64::from(from.bits as i32)),
                        (Kind::Uint, Kind::Float) => self.converted(i64::from(from.bits)),
                        _ => from,
                    };
                }
                Instruction::Bitcast { to, from } => {
                    let from = self.registers[*from];
                    self.registers[*to] = Word { made: self.seen(from.made), ..from };
                }
                Instruction::Select { to, condition, accept, reject } => {
                    let from = if self.registers[*condition].bits != 0 { accept } else { reject };
                    self.registers[*to] = self.registers[*from];
                }
                Instruction::Math { function, kind, to, arguments } => {
                    let arguments = arguments.map(|slot| self.registers[slot]);
                    self.registers[*to] = self.math(*function, *kind, arguments);
                }
                Instruction::Load { to, from } => {
                    let at = self.address(from);
                    self.registers[*to] = match from.buffer {
                        Some(buffer) => Word::of(self.buffers[buffer][at]),
                        None => self.registers[at],
                    };
                }
                Instruction::Store { to, from } => {
                    let (at, word) = (self.address(to), self.registers[*from]);
                    match to.buffer {
                        Some(buffer) => self.buffers[buffer][at] = word.bits,
                        None => self.registers[at] = word,
                    }
                }
            }
        }
    }

    fn address(&self, place: &Place) -> usize {
        let offset = |&(slot, step, count): &(usize, usize, usize)| {
            let index = self.registers[slot].bits as usize;
            assert!(index < count, "element {index} of {count}");
            index * step
        };
        place.start + place.indices.iter().map(offset).sum::<usize>()
    }

    /// What is still known of a value once it was taken for an integer.
    fn seen(&self, made: Made) -> Made {
        match made {
            Made::Product(..) if self.liberties.has(Liberties::SEE_PRODUCTS) => made,
            Made::Sum(..) if self.liberties.has(Liberties::SEE_SUMS) => made,
            _ => Made::Unknown,
        }
    }

    fn takes(&self, liberty: Liberties, a: f32, b: f32) -> bool {
        let chance = || mix(a.to_bits(), b.to_bits(), liberty.0) & 1 == 1;
        self.liberties.has(liberty) && (self.liberties.has(Liberties::ALWAYS) || chance())
    }

    fn flushed(&self, value: f32) -> f32 {
        match value.is_subnormal() && self.liberties.has(Liberties::FLUSH) {
            true => 0.0 * value.signum(),
            false => value,
        }
    }

    fn made(&self, value: f32, made: Made) -> Word {
        Word { bits: self.flushed(value).to_bits(), made }
    }

    fn floats(&self, operator: B, left: Word, right: Word) -> Word {
        let (a, b) = (left.float(), right.float());
        match operator {
            B::Add => self.sum(left, right),
            B::Subtract => self.sum(left, negated(right)),
            B::Multiply => self.product(left, right),
            B::Divide => {
                let most = if self.liberties.has(Liberties::LOOSER) { 3 } else { 2 };
                let is_loose = self.liberties.has(Liberties::LOOSE.and(Liberties::LOOSER));
                let most = if is_loose { most } else { 0 };
                self.made(off(a / b, most, mix(left.bits, right.bits, 4)), Made::Unknown)
            }
            B::Equal => Word::of(u32::from(a == b)),
            B::NotEqual => Word::of(u32::from(a != b)),
            B::Less => Word::of(u32::from(a < b)),
            B::LessEqual => Word::of(u32::from(a <= b)),
            B::Greater => Word::of(u32::from(a > b)),
            B::GreaterEqual => Word::of(u32::from(a >= b)),
            other => panic!("{other:?} of floats"),
        }
    }

    fn sum(&self, left: Word, right: Word) -> Word {
        let (a, b) = (left.float(), right.float());
        let reorders = || self.takes(Liberties::REORDER, a, b);
        let fuses = || self.takes(Liberties::FUSE, a, b);
        let value = match (left.made, right.made) {
            (Made::Unknown, Made::Unknown) => a + b,
            (Made::Sum(p, q), _) if reorders() => p + self.flushed(q + b),
            (_, Made::Sum(p, q)) if reorders() => self.flushed(a + p) + q,
            (_, Made::Product(p, q)) if fuses() => p.mul_add(q, a),
            (Made::Product(p, q), _) if fuses() => p.mul_add(q, b),
            _ => a + b,
        };
        self.made(value, Made::Sum(a, b))
    }

    fn product(&self, left: Word, right: Word) -> Word {
        let (a, b) = (left.float(), right.float());
        let value = match (left.made, right.made) {
            (Made::Unknown, Made::Unknown) => a * b,
            _ if !self.takes(Liberties::REORDER, a, b) => a * b,
            (Made::Product(p, q), _) => p * self.flushed(q * b),
            (_, Made::Product(p, q)) => self.flushed(a * p) * q,
            (Made::Sum(p, q), _) => self.flushed(p * b) + self.flushed(q * b),
            (_, Made::Sum(p, q)) => self.flushed(a * p) + self.flushed(a * q),
        };
        self.made(value, Made::Product(a, b))
    }

    fn converted(&self, integer: i64) -> Word {
        let value = integer as f32;
        let back = value as i64;
        let takes_other = self.liberties.has(Liberties::CONVERT) && mix(integer as u32, 0, 5) & 1 == 1;
        if back == integer || !takes_other {
            return Word::of(value.to_bits());
        }
        let is_outwards = (back < integer) == (value > 0.0);
        Word::of(value.to_bits().wrapping_add_signed(if is_outwards { 1 } else { -1 }))
    }

    fn math(&self, function: M, kind: Kind, [a, b, c]: [Word; 3]) -> Word {
        match (function, kind) {
            (M::Sqrt, _) => {
                let most = match self.liberties {
                    liberties if liberties.has(Liberties::LOOSER) => 7,
                    liberties if liberties.has(Liberties::LOOSE) => 3,
                    _ => 0,
                };
                self.made(off(a.float().sqrt(), most, mix(a.bits, 0, 6)), Made::Unknown)
            }
            (M::Abs, Kind::Float) => Word::of(a.bits & 0x7FFF_FFFF),
            (M::Max, Kind::Float) => {
                if b.float() > a.float() {
                    b
                } else {
                    a
                }
            }
            (M::Min, Kind::Float) => {
                if b.float() < a.float() {
                    b
                } else {
                    a
                }
            }
            (M::Clamp, Kind::Float) => match a {
                a if a.float() < b.float() => b,
                a if a.float() > c.float() => c,
                a => a,
            },
            (M::Max, Kind::Uint) => {
                if b.bits > a.bits {
                    b
                } else {
                    a
                }
            }
            (M::Min, Kind::Uint) => {
                if b.bits < a.bits {
                    b
                } else {
                    a
                }
            }
            (function, kind) => panic!("{function:?} of {kind:?}"),
        }
    }

    fn unsigned(&self, operator: B, left: Word, right: Word) -> Word {
        let (a, b) = (left.bits, right.bits);
        if operator == B::ExclusiveOr && b == 0 {
            return left; // with what is known of it, where guards are seen through
        }
        Word::of(match operator {
            B::Add => a.wrapping_add(b),
            B::Subtract => a.wrapping_sub(b),
            B::Multiply => a.wrapping_mul(b),
            B::Divide => a / b,
            B::Modulo => a % b,
            B::And | B::LogicalAnd => a & b,
            B::ExclusiveOr => a ^ b,
            B::InclusiveOr | B::LogicalOr => a | b,
            B::ShiftLeft => a << (b & 31),
            B::ShiftRight => a >> (b & 31),
            B::Equal => u32::from(a == b),
            B::NotEqual => u32::from(a != b),
            B::Less => u32::from(a < b),
            B::LessEqual => u32::from(a <= b),
            B::Greater => u32::from(a > b),
            B::GreaterEqual => u32::from(a >= b),
        })
    }
}

fn negated(word: Word) -> Word {
    let made = match word.made {
        Made::Unknown => Made::Unknown,
        Made::Product(p, q) => Made::Product(-p, q),
        Made::Sum(p, q) => Made::Sum(-p, -q),
    };
    Word { bits: word.bits ^ 0x8000_0000, made }
}

fn signed(operator: B, a: i32, right: u32) -> u32 {
    let b = right as i32;
    match operator {
        B::Add => a.wrapping_add(b) as u32,
        B::Subtract => a.wrapping_sub(b) as u32,
        B::Multiply => a.wrapping_mul(b) as u32,
        B::And => (a & b) as u32,
        B::ShiftLeft => (a << (right & 31)) as u32,
        B::ShiftRight => (a >> (right & 31)) as u32,
        B::Equal => u32::from(a == b),
        B::NotEqual => u32::from(a != b),
        B::Less => u32::from(a < b),
        B::LessEqual => u32::from(a <= b),
        B::Greater => u32::from(a > b),
        B::GreaterEqual => u32::from(a >= b),
        other => panic!("{other:?} of signed integers"),
    }
}
