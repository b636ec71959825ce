//! A compute shader and the bytes that go into its bindings, for WebGPU.

use serde::Serialize;
use spectroll::{BindingRole, ComputeShader, Stream};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::drawing::TRIAL;

/// A recipe's compute shader.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Kernel {
    shader: ComputeShader,
}

/// A binding, for the page's scripts.
#[derive(Serialize)]
struct Binding {
    binding: u32,
    role: &'static str,
    /// Quantity of an output.
    #[serde(skip_serializing_if = "Option::is_none")]
    quantity: Option<&'static str>,
}

impl Kernel {
    pub(crate) fn new(shader: ComputeShader) -> Kernel {
        Kernel { shader }
    }

    fn role(&self, binding: u32) -> BindingRole {
        let found = self.shader.bindings().iter().find(|found| found.binding == binding);
        found.expect("it is one of the shader's").role
    }
}

#[wasm_bindgen]
impl Kernel {
    /// WGSL text.
    pub fn text(&self) -> String {
        self.shader.text().to_owned()
    }

    /// Bindings as JSON, all in group 0.
    pub fn bindings(&self) -> String {
        let all = self.shader.bindings().iter().map(|binding| {
            let (role, quantity) = match binding.role {
                BindingRole::Parameters => ("parameters", None),
                BindingRole::Tables => ("tables", None),
                BindingRole::Proposal => ("proposal", None),
                BindingRole::Progress => ("progress", None),
                BindingRole::Output(quantity) => ("output", Some(quantity.name())),
                other => unreachable!("a shader of a range has no {other:?}"),
            };
            Binding { binding: binding.binding, role, quantity }
        });
        serde_json::to_string(&all.collect::<Vec<_>>()).expect("numbers and text are JSON")
    }

    /// Size of the buffer of a binding with room for `room` draws, in bytes.
    pub fn bytes(&self, binding: u32, room: u32) -> f64 {
        self.shader.bytes(self.role(binding), room.into()) as f64
    }

    /// Content of a binding that is the same for all draws; empty of others.
    pub fn contents(&self, binding: u32) -> Vec<u8> {
        self.shader.contents(self.role(binding)).unwrap_or_default().to_vec()
    }

    /// Content of the uniform for draws from `first` on, in buffers with room for `room`.
    pub fn parameters(&self, seed: u64, first: u64, count: u32, room: u32) -> Vec<u8> {
        let draws = spectroll::DrawRange { stream: Stream::new(seed), first, count: count.into() };
        self.shader.parameters(draws, room.into()).to_vec()
    }

    /// Content of the uniform for the draws that a device is tried by.
    #[wasm_bindgen(js_name = trialParameters)]
    pub fn trial_parameters(&self, count: u32, room: u32) -> Vec<u8> {
        self.shader.parameters(Stream::named(0, TRIAL).draws(0..count.into()), room.into()).to_vec()
    }

    /// Number of workgroups that make this number of draws.
    pub fn workgroups(&self, count: u32) -> u32 {
        self.shader.workgroups(count.into())
    }

    /// Number of dispatches that make a range.
    pub fn dispatches(&self) -> u32 {
        self.shader.dispatches()
    }
}
