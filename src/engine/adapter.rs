//! Graphics adapters of this machine, and the choice of one.

use std::fmt;

use serde::Serialize;

use super::exactness::{self, Probe};
use super::gpu::Gpu;
use super::{EngineError, WantedAdapter};

/// A graphics adapter, as its driver describes itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Adapter {
    /// Name of the adapter.
    pub name: String,
    /// Interface it is reached by: vulkan, metal, dx12.
    pub backend: String,
    /// Kind: discrete, integrated, virtual, software or other.
    pub kind: String,
    /// Driver and its version.
    pub driver: String,
    /// Whether shaders on it can multiply in 64 bits.
    pub int64: bool,
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} [{}, {}, {}]", self.name, self.kind, self.backend, self.driver)
    }
}

impl Adapter {
    pub(super) fn of(adapter: &wgpu::Adapter) -> Adapter {
        Adapter::new(adapter.get_info(), adapter.features().contains(wgpu::Features::SHADER_INT64))
    }

    pub(super) fn new(info: wgpu::AdapterInfo, int64: bool) -> Adapter {
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete",
            wgpu::DeviceType::IntegratedGpu => "integrated",
            wgpu::DeviceType::VirtualGpu => "virtual",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "other",
        };
        Adapter {
            name: info.name,
            backend: info.backend.to_string(),
            kind: kind.to_owned(),
            driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
            int64,
        }
    }
}

/// The variable that limits adapters to some interfaces.
const BACKEND: &str = "WGPU_BACKEND";

/// Lists the adapters of this machine, in the order in which [`EngineChoice::Adapter`](super::EngineChoice::Adapter)
/// counts them. The variable `WGPU_BACKEND` limits them to some interfaces; an error says where it names none.
pub fn adapters() -> Result<Vec<Adapter>, EngineError> {
    Ok(enumerate()?.iter().map(Adapter::of).collect())
}

/// An adapter, and its probe or the error that says why it could not be opened.
pub type ProbedAdapter = (Adapter, Result<Probe, EngineError>);

/// Lists the adapters of this machine as [`adapters`] does, each with its [`probe`](super::probe()), for which it is opened:
/// a matter of a second each. An adapter that cannot be opened has the error that says why.
pub fn probed_adapters() -> Result<Vec<ProbedAdapter>, EngineError> {
    let probed = |adapter: wgpu::Adapter| {
        (Adapter::of(&adapter), Gpu::open(adapter).and_then(|gpu| exactness::of(&gpu)))
    };
    Ok(enumerate()?.into_iter().map(probed).collect())
}

/// The value of a variable; `None` also where that is empty, which shells make of one that is to be unset.
fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.trim().is_empty())
}

/// The interfaces to which the variable `WGPU_BACKEND` limits adapters, as it has them; `None` where it limits nothing.
pub fn wanted_backends() -> Option<String> {
    variable(BACKEND)
}

/// The interfaces that this build can reach adapters by.
pub(super) fn compiled() -> String {
    let names = wgpu::Instance::enabled_backend_features().iter_names();
    let names: Vec<_> = names.map(|(name, _)| name.to_lowercase()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Remedy where no adapter was found.
pub(super) fn remedy() -> String {
    match wanted_backends() {
        Some(value) => format!("the variable {BACKEND} is {value:?} and hides all others, unset it"),
        None => "install a Vulkan driver (Debian: mesa-vulkan-drivers; VK_LOADER_DEBUG=error says why one that is \
                 there is not found)"
            .to_owned(),
    }
}

/// Kinds of adapter to choose from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    Any,
    Hardware,
}

/// The adapter named by `WGPU_ADAPTER_NAME`, if that is set; else the best: discrete, integrated, virtual, software.
pub(super) fn best(which: Wanted) -> Result<Option<wgpu::Adapter>, EngineError> {
    if let Some(name) = variable("WGPU_ADAPTER_NAME") {
        return find(WantedAdapter { name, is_from_variable: true }).map(Some);
    }
    let will_do = |adapter: &wgpu::Adapter| {
        which == Wanted::Any || adapter.get_info().device_type != wgpu::DeviceType::Cpu
    };
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    Ok(enumerate()?.into_iter().filter(will_do).min_by_key(rank)) // the first of the best
}

/// Finds the adapter with an index, or the one whose name holds a text.
pub(super) fn find(wanted: WantedAdapter) -> Result<wgpu::Adapter, EngineError> {
    let all = enumerate()?;
    let found: Vec<_> = all.iter().map(Adapter::of).collect();
    match position(&wanted.name, &found) {
        Some(position) => Ok(all[position].clone()),
        None => Err(EngineError::NoAdapter { wanted, found }),
    }
}

/// Position in a list of the adapter that is wanted. Digits are an index and nothing else: names are full of version
/// numbers, so that "5" would find "LLVM 15.0.6".
fn position(wanted: &str, all: &[Adapter]) -> Option<usize> {
    let wanted = wanted.trim().to_lowercase();
    if !wanted.is_empty() && wanted.bytes().all(|b| b.is_ascii_digit()) {
        return wanted.parse().ok().filter(|&index| index < all.len());
    }
    all.iter().position(|adapter| adapter.name.to_lowercase().contains(&wanted))
}

fn enumerate() -> Result<Vec<wgpu::Adapter>, EngineError> {
    let compiled = wgpu::Instance::enabled_backend_features();
    let mut backends = compiled;
    if let Some(value) = wanted_backends() {
        if value.split(',').any(|name| wgpu::Backends::from_comma_list(name).is_empty()) {
            return Err(EngineError::UnknownBackend { value });
        }
        backends &= wgpu::Backends::from_comma_list(&value);
    }
    if backends.is_empty() {
        return Ok(Vec::new()); // wgpu would panic
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        flags: wgpu::InstanceFlags::empty().with_env(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let compute = |adapter: &wgpu::Adapter| {
        let flags = adapter.get_downlevel_capabilities().flags;
        flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    };
    let all = pollster::block_on(instance.enumerate_adapters(backends));
    Ok(all.into_iter().filter(compute).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_an_index_and_text_is_part_of_a_name() {
        let adapter = |name: &str| Adapter {
            name: name.to_owned(),
            backend: "vulkan".to_owned(),
            kind: "software".to_owned(),
            driver: String::new(),
            int64: true,
        };
        let all = [adapter("NVIDIA GeForce RTX 4090"), adapter("llvmpipe (LLVM 15.0.6, 256 bits)")];
        assert_eq!(["0", "1", " 1 "].map(|wanted| position(wanted, &all)), [Some(0), Some(1), Some(1)]);
        assert_eq!(["5", "15", "4090", "99999999999999999999"].map(|w| position(w, &all)), [None; 4]);
        assert_eq!(["RTX 4090", "LLVM 15", "nonesuch"].map(|w| position(w, &all)), [Some(0), Some(1), None]);
        assert_eq!(position("0", &[]), None);
    }
}
