//! The compiler of a tape: entry points, calls and statements.

use std::collections::HashMap;

use naga::{
    Binding, Block, BuiltIn, Function, Handle, Module, ScalarKind, Statement as S, SwitchValue, Type,
};

use super::{BinaryOperator, Instruction, Place, Slot, Tape};

pub(super) struct Compiler<'a> {
    pub(super) module: &'a Module,
    info: &'a naga::valid::ModuleInfo,
    pub(super) tape: Tape,
    constants: HashMap<u32, Slot>,
    pub(super) buffers: HashMap<Handle<naga::GlobalVariable>, usize>,
}

/// What an expression is while a function is compiled.
#[derive(Clone)]
pub(super) enum Value {
    Slots(Vec<Slot>),
    Place(Place, Shape),
}

/// Type that a place has.
#[derive(Clone)]
pub(super) enum Shape {
    Of(Handle<Type>),
    Scalar,
}

/// A function that is being inlined.
pub(super) struct Frame<'a> {
    pub(super) function: &'a Function,
    pub(super) info: &'a naga::valid::FunctionInfo,
    /// Its number among the tape's names.
    name: usize,
    pub(super) arguments: Vec<Value>,
    pub(super) values: HashMap<Handle<naga::Expression>, Value>,
    pub(super) locals: Vec<Slot>,
    result: Vec<Slot>,
    /// Jumps to its end, to be patched.
    returns: Vec<usize>,
    /// Jumps out of the innermost loop or switch, and to the end of the innermost loop's body.
    breaks: Vec<Vec<usize>>,
    continues: Vec<Vec<usize>>,
}

impl<'a> Compiler<'a> {
    pub(super) fn new(module: &'a Module, info: &'a naga::valid::ModuleInfo) -> Compiler<'a> {
        let tape = Tape {
            instructions: Vec::new(),
            origins: Vec::new(),
            functions: Vec::new(),
            constants: Vec::new(),
            registers: 0,
            thread: 0,
            bindings: Vec::new(),
        };
        let mut compiler =
            Compiler { module, info, tape, constants: HashMap::new(), buffers: HashMap::new() };
        for (handle, variable) in module.global_variables.iter() {
            if let Some(binding) = &variable.binding {
                compiler.buffers.insert(handle, compiler.tape.bindings.len());
                compiler.tape.bindings.push(binding.binding);
            }
        }
        compiler
    }

    pub(super) fn entry(&mut self) {
        let entry = &self.module.entry_points[0];
        let mut arguments = Vec::new();
        for argument in &entry.function.arguments {
            let slots = self.fresh(self.words(argument.ty));
            if let Some(Binding::BuiltIn(BuiltIn::GlobalInvocationId)) = argument.binding {
                self.tape.thread = slots[0];
            }
            arguments.push(Value::Slots(slots));
        }
        self.inline(&entry.function, self.info.get_entry_point(0), "main", arguments, Vec::new());
    }

    pub(super) fn fresh(&mut self, count: usize) -> Vec<Slot> {
        let first = self.tape.registers;
        self.tape.registers += count;
        (first..first + count).collect()
    }

    pub(super) fn constant(&mut self, bits: u32) -> Slot {
        if let Some(&slot) = self.constants.get(&bits) {
            return slot;
        }
        let slot = self.fresh(1)[0];
        self.tape.constants.push((slot, bits));
        self.constants.insert(bits, slot);
        slot
    }

    pub(super) fn emit(&mut self, frame: &Frame, instruction: Instruction) -> usize {
        self.tape.instructions.push(instruction);
        self.tape.origins.push(frame.name);
        self.tape.instructions.len() - 1
    }

    fn patch(&mut self, jumps: Vec<usize>) {
        let target = self.tape.instructions.len();
        for jump in jumps {
            match &mut self.tape.instructions[jump] {
                Instruction::Jump(to) | Instruction::JumpUnless(_, to) => *to = target,
                other => panic!("{other:?} is no jump"),
            }
        }
    }

    fn inline(
        &mut self,
        function: &'a Function,
        info: &'a naga::valid::FunctionInfo,
        name: &str,
        arguments: Vec<Value>,
        result: Vec<Slot>,
    ) {
        let name = self.tape.functions.iter().position(|other| other == name).unwrap_or_else(|| {
            self.tape.functions.push(name.to_owned());
            self.tape.functions.len() - 1
        });
        let mut locals = Vec::new();
        for (_, local) in function.local_variables.iter() {
            locals.push(self.tape.registers);
            self.fresh(self.words(local.ty));
        }
        let mut frame = Frame {
            function,
            info,
            name,
            arguments,
            values: HashMap::new(),
            locals,
            result,
            returns: Vec::new(),
            breaks: Vec::new(),
            continues: Vec::new(),
        };
        for (handle, local) in function.local_variables.iter() {
            let start = frame.locals[handle.index()];
            let from = match local.init {
                Some(init) => self.slots(&mut frame, init),
                None => vec![self.constant(0); self.words(local.ty)],
            };
            for (i, from) in from.into_iter().enumerate() {
                self.emit(&frame, Instruction::Copy { to: start + i, from });
            }
        }
        self.block(&mut frame, &function.body);
        let returns = std::mem::take(&mut frame.returns);
        self.patch(returns);
    }

    fn block(&mut self, frame: &mut Frame<'a>, block: &'a Block) {
        for statement in block.iter() {
            self.statement(frame, statement);
        }
    }

    fn statement(&mut self, frame: &mut Frame<'a>, statement: &'a S) {
        match statement {
            S::Emit(range) => {
                for handle in range.clone() {
                    let value = self.expression(frame, handle);
                    frame.values.insert(handle, value);
                }
            }
            S::Block(block) => self.block(frame, block),
            S::If { condition, accept, reject } => {
                let condition = self.slots(frame, *condition)[0];
                let to_else = self.emit(frame, Instruction::JumpUnless(condition, 0));
                self.block(frame, accept);
                let to_end = self.emit(frame, Instruction::Jump(0));
                self.patch(vec![to_else]);
                self.block(frame, reject);
                self.patch(vec![to_end]);
            }
            S::Switch { selector, cases } => {
                let selector = self.slots(frame, *selector)[0];
                frame.breaks.push(Vec::new());
                let mut default = None;
                for case in cases {
                    let value = match case.value {
                        SwitchValue::I32(value) => value as u32,
                        SwitchValue::U32(value) => value,
                        SwitchValue::Default => {
                            default = Some(case);
                            continue;
                        }
                    };
                    let (right, to) = (self.constant(value), self.fresh(1)[0]);
                    let (operator, kind) = (BinaryOperator::Equal, ScalarKind::Uint);
                    self.emit(frame, Instruction::Binary { operator, kind, to, left: selector, right });
                    let to_next = self.emit(frame, Instruction::JumpUnless(to, 0));
                    self.block(frame, &case.body);
                    let to_end = self.emit(frame, Instruction::Jump(0));
                    frame.breaks.last_mut().expect("it was pushed").push(to_end);
                    self.patch(vec![to_next]);
                }
                self.block(frame, &default.expect("a switch has a default").body);
                let ends = frame.breaks.pop().expect("it was pushed");
                self.patch(ends);
            }
            S::Loop { body, continuing, break_if } => {
                let start = self.tape.instructions.len();
                frame.breaks.push(Vec::new());
                frame.continues.push(Vec::new());
                self.block(frame, body);
                let continues = frame.continues.pop().expect("it was pushed");
                self.patch(continues);
                self.block(frame, continuing);
                if let Some(condition) = break_if {
                    let condition = self.slots(frame, *condition)[0];
                    self.emit(frame, Instruction::JumpUnless(condition, start));
                } else {
                    self.emit(frame, Instruction::Jump(start));
                }
                let ends = frame.breaks.pop().expect("it was pushed");
                self.patch(ends);
            }
            S::Break => {
                let jump = self.emit(frame, Instruction::Jump(0));
                frame.breaks.last_mut().expect("it is in a loop").push(jump);
            }
            S::Continue => {
                let jump = self.emit(frame, Instruction::Jump(0));
                frame.continues.last_mut().expect("it is in a loop").push(jump);
            }
            S::Return { value } => {
                if let Some(value) = value {
                    let from = self.slots(frame, *value);
                    for (to, from) in frame.result.clone().into_iter().zip(from) {
                        self.emit(frame, Instruction::Copy { to, from });
                    }
                }
                let jump = self.emit(frame, Instruction::Jump(0));
                frame.returns.push(jump);
            }
            S::Store { pointer, value } => {
                let from = self.slots(frame, *value);
                let (place, shape) = self.place(frame, *pointer);
                let words = self.layout(&shape, place.buffer.is_some());
                for (word, from) in words.into_iter().zip(from) {
                    let to = Place { start: place.start + word, ..place.clone() };
                    let instruction = match (to.buffer, to.indices.is_empty()) {
                        (None, true) => Instruction::Copy { to: to.start, from },
                        _ => Instruction::Store { to, from },
                    };
                    self.emit(frame, instruction);
                }
            }
            S::Call { function, arguments, result } => {
                let callee = &self.module.functions[*function];
                let arguments = arguments.iter().map(|&argument| self.value(frame, argument)).collect();
                let words = callee.result.as_ref().map_or(0, |result| self.words(result.ty));
                let slots = self.fresh(words);
                let name = callee.name.as_deref().unwrap_or("a function");
                self.inline(callee, &self.info[*function], name, arguments, slots.clone());
                if let Some(result) = result {
                    frame.values.insert(*result, Value::Slots(slots));
                }
            }
            other => panic!("a statement that no draw needs: {other:?}"),
        }
    }
}
