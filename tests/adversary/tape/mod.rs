//! A compute shader as one list of scalar instructions: what naga makes of its text, with every call inlined and every
//! vector, array and structure taken apart. Nothing here knows anything of spectra.

mod compiler;
mod expressions;
mod types;

use naga::ScalarKind;
pub(crate) use naga::{BinaryOperator, MathFunction, UnaryOperator};

use compiler::Compiler;

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
        let mut compiler = Compiler::new(&module, &info);
        compiler.entry();
        compiler.tape
    }
}
