//! A compute shader as one list of scalar instructions: what naga makes of its text, with every call inlined and every
//! vector, array and structure taken apart. Nothing here knows anything of spectra.

use std::collections::HashMap;

use naga::{
    ArraySize, Binding, Block, BuiltIn, Expression as E, Function, Handle, Literal, Module, ScalarKind,
    Statement as S, SwitchValue, Type, TypeInner as T,
};
pub(crate) use naga::{BinaryOperator, MathFunction, UnaryOperator};

/// Number of a register.
pub(crate) type Slot = usize;

/// Place of a value: a register, or a word of a buffer, with what run-time indices add to it.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// The buffer; `None` of registers.
    pub(crate) buffer: Option<usize>,
    pub(crate) start: usize,
    /// Registers of indices, each with the number of words from one element to the next and the number of elements.
    pub(crate) indices: Vec<(Slot, usize, usize)>,
}

#[derive(Clone, Debug)]
pub(crate) enum Instruction {
    Copy {
        to: Slot,
        from: Slot,
    },
    Binary {
        operator: BinaryOperator,
        kind: ScalarKind,
        to: Slot,
        left: Slot,
        right: Slot,
    },
    Unary {
        operator: UnaryOperator,
        kind: ScalarKind,
        to: Slot,
        from: Slot,
    },
    /// Conversion of a number.
    Convert {
        to: Slot,
        from: Slot,
        of: ScalarKind,
        into: ScalarKind,
    },
    /// The same bits as another type.
    Bitcast {
        to: Slot,
        from: Slot,
    },
    Select {
        to: Slot,
        condition: Slot,
        accept: Slot,
        reject: Slot,
    },
    Math {
        function: MathFunction,
        kind: ScalarKind,
        to: Slot,
        arguments: [Slot; 3],
    },
    Load {
        to: Slot,
        from: Place,
    },
    Store {
        to: Place,
        from: Slot,
    },
    Jump(usize),
    JumpUnless(Slot, usize),
}

/// A shader as instructions.
pub(crate) struct Tape {
    pub(crate) instructions: Vec<Instruction>,
    /// The function that each instruction comes from.
    pub(crate) origins: Vec<usize>,
    pub(crate) functions: Vec<String>,
    /// Registers that hold constants, with their bits.
    pub(crate) constants: Vec<(Slot, u32)>,
    pub(crate) registers: usize,
    /// Registers of the thread's number.
    pub(crate) thread: Slot,
    /// Bindings of the buffers.
    pub(crate) bindings: Vec<u32>,
}

impl Tape {
    /// Compiles the entry point of a text.
    pub(crate) fn new(text: &str) -> Tape {
        let module =
            naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
        let flags = naga::valid::ValidationFlags::all();
        let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
        let info = validator.validate(&module).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
        let mut compiler = Compiler {
            module: &module,
            info: &info,
            tape: Tape {
                instructions: Vec::new(),
                origins: Vec::new(),
                functions: Vec::new(),
                constants: Vec::new(),
                registers: 0,
                thread: 0,
                bindings: Vec::new(),
            },
            constants: HashMap::new(),
            buffers: HashMap::new(),
        };
        for (handle, variable) in module.global_variables.iter() {
            if let Some(binding) = &variable.binding {
                compiler.buffers.insert(handle, compiler.tape.bindings.len());
                compiler.tape.bindings.push(binding.binding);
            }
        }
        compiler.entry();
        compiler.tape
    }
}

struct Compiler<'a> {
    module: &'a Module,
    info: &'a naga::valid::ModuleInfo,
    tape: Tape,
    constants: HashMap<u32, Slot>,
    buffers: HashMap<Handle<naga::GlobalVariable>, usize>,
}

/// What an expression is while a function is compiled.
#[derive(Clone)]
enum Value {
    Slots(Vec<Slot>),
    Place(Place, Shape),
}

/// Type that a place has.
#[derive(Clone)]
enum Shape {
    Of(Handle<Type>),
    Scalar,
}

/// A function that is being inlined.
struct Frame<'a> {
    function: &'a Function,
    info: &'a naga::valid::FunctionInfo,
    /// Its number among the tape's names.
    name: usize,
    arguments: Vec<Value>,
    values: HashMap<Handle<naga::Expression>, Value>,
    locals: Vec<Slot>,
    result: Vec<Slot>,
    /// Jumps to its end, to be patched.
    returns: Vec<usize>,
    /// Jumps out of the innermost loop or switch, and to the end of the innermost loop's body.
    breaks: Vec<Vec<usize>>,
    continues: Vec<Vec<usize>>,
}

impl<'a> Compiler<'a> {
    fn entry(&mut self) {
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

    fn fresh(&mut self, count: usize) -> Vec<Slot> {
        let first = self.tape.registers;
        self.tape.registers += count;
        (first..first + count).collect()
    }

    fn constant(&mut self, bits: u32) -> Slot {
        if let Some(&slot) = self.constants.get(&bits) {
            return slot;
        }
        let slot = self.fresh(1)[0];
        self.tape.constants.push((slot, bits));
        self.constants.insert(bits, slot);
        slot
    }

    fn emit(&mut self, frame: &Frame, instruction: Instruction) -> usize {
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

    /// Number of registers of a value.
    fn words(&self, ty: Handle<Type>) -> usize {
        match &self.module.types[ty].inner {
            T::Scalar(_) => 1,
            T::Vector { size, .. } => *size as usize,
            T::Array { base, size: ArraySize::Constant(count), .. } => {
                count.get() as usize * self.words(*base)
            }
            T::Struct { members, .. } => members.iter().map(|member| self.words(member.ty)).sum(),
            other => panic!("registers of {other:?}"),
        }
    }

    /// Words from one element to the next, the number of elements, and their shape: in registers, or in a buffer.
    fn elements(&self, ty: Handle<Type>, in_buffer: bool) -> (usize, usize, Shape) {
        match &self.module.types[ty].inner {
            T::Vector { size, .. } => (1, *size as usize, Shape::Scalar),
            T::Array { base, size, stride } => {
                let count = match size {
                    ArraySize::Constant(count) => count.get() as usize,
                    _ => usize::MAX,
                };
                let step = if in_buffer { *stride as usize / 4 } else { self.words(*base) };
                (step, count, Shape::Of(*base))
            }
            other => panic!("elements of {other:?}"),
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

    fn value(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> Value {
        match frame.values.get(&handle) {
            Some(value) => value.clone(),
            None => self.expression(frame, handle),
        }
    }

    fn slots(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> Vec<Slot> {
        match self.value(frame, handle) {
            Value::Slots(slots) => slots,
            Value::Place(..) => panic!("a pointer where a value is needed"),
        }
    }

    fn place(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> (Place, Shape) {
        match self.value(frame, handle) {
            Value::Place(place, shape) => (place, shape),
            Value::Slots(_) => panic!("a value where a pointer is needed"),
        }
    }

    /// Offsets of the scalars of a value, in words.
    fn layout(&self, shape: &Shape, in_buffer: bool) -> Vec<usize> {
        let Shape::Of(ty) = shape else { return vec![0] };
        match &self.module.types[*ty].inner {
            T::Scalar(_) => vec![0],
            T::Struct { members, .. } => {
                let mut offset = 0;
                let mut words = Vec::new();
                for member in members {
                    let start = if in_buffer { member.offset as usize / 4 } else { offset };
                    words.extend(
                        self.layout(&Shape::Of(member.ty), in_buffer).iter().map(|word| start + word),
                    );
                    offset += if in_buffer { 0 } else { self.words(member.ty) };
                }
                words
            }
            _ => {
                let (step, count, element) = self.elements(*ty, in_buffer);
                let element = self.layout(&element, in_buffer);
                (0..count).flat_map(|i| element.iter().map(move |word| i * step + word)).collect()
            }
        }
    }

    /// Offset and shape of a member or of an element whose number is known.
    fn member(&self, shape: &Shape, index: usize, in_buffer: bool) -> (usize, Shape) {
        let Shape::Of(ty) = shape else { panic!("members of a scalar") };
        match &self.module.types[*ty].inner {
            T::Struct { members, .. } => {
                let before = members[..index].iter().map(|member| self.words(member.ty)).sum();
                let offset = if in_buffer { members[index].offset as usize / 4 } else { before };
                (offset, Shape::Of(members[index].ty))
            }
            _ => {
                let (step, _, element) = self.elements(*ty, in_buffer);
                (index * step, element)
            }
        }
    }

    fn kind(&self, frame: &Frame, handle: Handle<naga::Expression>) -> ScalarKind {
        match frame.info[handle].ty.inner_with(&self.module.types) {
            T::Scalar(scalar) | T::Vector { scalar, .. } => scalar.kind,
            other => panic!("the kind of {other:?}"),
        }
    }

    /// Type of a value in registers, where it is composed.
    fn composed(&self, frame: &Frame, handle: Handle<naga::Expression>) -> (usize, usize) {
        match frame.info[handle].ty.inner_with(&self.module.types) {
            T::Vector { size, .. } => (1, *size as usize),
            T::Array { base, size: ArraySize::Constant(count), .. } => {
                (self.words(*base), count.get() as usize)
            }
            other => panic!("elements of {other:?}"),
        }
    }

    fn expression(&mut self, frame: &mut Frame<'a>, handle: Handle<naga::Expression>) -> Value {
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
