//! Expressions of a tape's compiler: values in registers, and places.

use naga::{Expression as E, Handle, Literal, ScalarKind, TypeInner as T};

use super::compiler::{Compiler, Frame, Shape, Value};
use super::{Instruction, Place, Slot};

impl<'a> Compiler<'a> {
    pub(super) fn value(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> Value {
        match frame.values.get(&handle) {
            Some(value) => value.clone(),
            None => self.expression(frame, handle),
        }
    }

    pub(super) fn slots(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> Vec<Slot> {
        match self.value(frame, handle) {
            Value::Slots(slots) => slots,
            Value::Place(..) => panic!("a pointer where a value is needed"),
        }
    }

    pub(super) fn place(
        &mut self,
        frame: &mut Frame<'a>,
        handle: Handle<naga::Expression>,
    ) -> (Place, Shape) {
        match self.value(frame, handle) {
            Value::Place(place, shape) => (place, shape),
            Value::Slots(_) => panic!("a value where a pointer is needed"),
        }
    }

    fn kind(&self, frame: &Frame, handle: Handle<naga::Expression>) -> ScalarKind {
        match frame.info[handle].ty.inner_with(&self.module.types) {
            T::Scalar(scalar) | T::Vector { scalar, .. } => scalar.kind,
            other => panic!("the kind of {other:?}"),
        }
    }

    pub(super) fn expression(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> Value {
        let slots = match &frame.function.expressions[handle] {
            E::Literal(literal) => vec![self.literal(literal)],
            E::Constant(constant) => self.global(self.module.constants[*constant].init),
            E::ZeroValue(ty) => vec![self.constant(0); self.words(*ty)],
            E::Compose { components, .. } => {
                components.iter().flat_map(|&component| self.slots(frame, component)).collect()
            }
            E::Splat { size, value } => vec![self.slots(frame, *value)[0]; *size as usize],
            E::Swizzle { size, vector, pattern } => {
                let vector = self.slots(frame, *vector);
                pattern[..*size as usize].iter().map(|&component| vector[component as usize]).collect()
            }
            E::FunctionArgument(number) => return frame.arguments[*number as usize].clone(),
            E::GlobalVariable(variable) => {
                let place = Place { buffer: Some(self.buffers[variable]), start: 0, indices: Vec::new() };
                return Value::Place(place, Shape::Of(self.module.global_variables[*variable].ty));
            }
            E::LocalVariable(local) => {
                let place = Place { buffer: None, start: frame.locals[local.index()], indices: Vec::new() };
                return Value::Place(place, Shape::Of(frame.function.local_variables[*local].ty));
            }
            E::AccessIndex { base, index } => match self.value(frame, *base) {
                Value::Place(place, shape) => {
                    let (offset, shape) = self.member(&shape, *index as usize, place.buffer.is_some());
                    return Value::Place(Place { start: place.start + offset, ..place }, shape);
                }
                Value::Slots(slots) => match frame.info[*base].ty.inner_with(&self.module.types) {
                    T::Struct { members, .. } => {
                        let start: usize = members[..*index as usize].iter().map(|m| self.words(m.ty)).sum();
                        slots[start..start + self.words(members[*index as usize].ty)].to_vec()
                    }
                    _ => {
                        let (step, _) = self.composed(frame, *base);
                        slots[*index as usize * step..][..step].to_vec()
                    }
                },
            },
            E::Access { base, index } => {
                let index = self.slots(frame, *index)[0];
                match self.value(frame, *base) {
                    Value::Place(mut place, shape) => {
                        let Shape::Of(ty) = shape else { panic!("elements of a scalar") };
                        let (step, count, element) = self.elements(ty, place.buffer.is_some());
                        place.indices.push((index, step, count));
                        return Value::Place(place, element);
                    }
                    Value::Slots(slots) => {
                        // A value that is indexed lies in registers one after another.
                        let (step, count) = self.composed(frame, *base);
                        let start = self.fresh(slots.len())[0];
                        for (i, from) in slots.into_iter().enumerate() {
                            self.emit(frame, Instruction::Copy { to: start + i, from });
                        }
                        let to = self.fresh(step);
                        for (i, &to) in to.iter().enumerate() {
                            let indices = vec![(index, step, count)];
                            let from = Place { buffer: None, start: start + i, indices };
                            self.emit(frame, Instruction::Load { to, from });
                        }
                        to
                    }
                }
            }
            E::Load { pointer } => {
                let (place, shape) = self.place(frame, *pointer);
                let words = self.layout(&shape, place.buffer.is_some());
                let to = self.fresh(words.len());
                for (word, &to) in words.into_iter().zip(&to) {
                    let from = Place { start: place.start + word, ..place.clone() };
                    let instruction = match (from.buffer, from.indices.is_empty()) {
                        (None, true) => Instruction::Copy { to, from: from.start },
                        _ => Instruction::Load { to, from },
                    };
                    self.emit(frame, instruction);
                }
                to
            }
            E::Unary { op, expr } => {
                let (operator, kind) = (*op, self.kind(frame, *expr));
                let from = self.slots(frame, *expr);
                let to = self.fresh(from.len());
                for (&to, from) in to.iter().zip(from) {
                    self.emit(frame, Instruction::Unary { operator, kind, to, from });
                }
                to
            }
            E::Binary { op, left, right } => {
                let (operator, kind) = (*op, self.kind(frame, *left));
                let (left, right) = (self.slots(frame, *left), self.slots(frame, *right));
                let to = self.fresh(left.len().max(right.len()));
                for (i, &to) in to.iter().enumerate() {
                    let (left, right) = (left[i % left.len()], right[i % right.len()]);
                    self.emit(frame, Instruction::Binary { operator, kind, to, left, right });
                }
                to
            }
            E::Select { condition, accept, reject } => {
                let condition = self.slots(frame, *condition);
                let (accept, reject) = (self.slots(frame, *accept), self.slots(frame, *reject));
                let to = self.fresh(accept.len());
                for (i, &to) in to.iter().enumerate() {
                    let condition = condition[i % condition.len()];
                    let (accept, reject) = (accept[i], reject[i]);
                    self.emit(frame, Instruction::Select { to, condition, accept, reject });
                }
                to
            }
            E::Math { fun, arg, arg1, arg2, .. } => {
                let (function, kind) = (*fun, self.kind(frame, *arg));
                let arguments = [Some(*arg), *arg1, *arg2].map(|argument| match argument {
                    Some(argument) => self.slots(frame, argument),
                    None => Vec::new(),
                });
                let to = self.fresh(arguments[0].len());
                for (i, &to) in to.iter().enumerate() {
                    let arguments = arguments.each_ref().map(|slots| slots.get(i).copied().unwrap_or(0));
                    self.emit(frame, Instruction::Math { function, kind, to, arguments });
                }
                to
            }
            E::As { expr, kind, convert } => {
                let (of, into) = (self.kind(frame, *expr), *kind);
                let from = self.slots(frame, *expr);
                let to = self.fresh(from.len());
                for (&to, from) in to.iter().zip(from) {
                    let instruction = match convert {
                        Some(_) => Instruction::Convert { to, from, of, into },
                        None => Instruction::Bitcast { to, from },
                    };
                    self.emit(frame, instruction);
                }
                to
            }
            other => panic!("an expression that no draw needs: {other:?}"),
        };
        Value::Slots(slots)
    }

    fn literal(&mut self, literal: &Literal) -> Slot {
        self.constant(match *literal {
            Literal::F32(value) => value.to_bits(),
            Literal::U32(value) => value,
            Literal::I32(value) => value as u32,
            Literal::Bool(value) => u32::from(value),
            ref other => panic!("a literal that no draw needs: {other:?}"),
        })
    }

    fn global(&mut self, handle: Handle<naga::Expression>) -> Vec<Slot> {
        match &self.module.global_expressions[handle] {
            E::Literal(literal) => vec![self.literal(literal)],
            E::ZeroValue(ty) => vec![self.constant(0); self.words(*ty)],
            E::Compose { components, .. } => {
                components.iter().flat_map(|&component| self.global(component)).collect()
            }
            E::Constant(constant) => self.global(self.module.constants[*constant].init),
            E::Splat { size, value } => vec![self.global(*value)[0]; *size as usize],
            other => panic!("a constant that no draw needs: {other:?}"),
        }
    }
}
