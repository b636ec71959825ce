//! Graphics adapters of this machine, and the choice of one.

use std::fmt;

use serde::Serialize;

use super::EngineError;

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
        let info = adapter.get_info();
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
            int64: adapter.features().contains(wgpu::Features::SHADER_INT64),
        }
    }
}

/// Lists the adapters of this machine, in the order in which [`EngineChoice::Adapter`](super::EngineChoice::Adapter)
/// counts them. The variable `WGPU_BACKEND` limits them to some interfaces.
pub fn adapters() -> Vec<Adapter> {
    enumerate().iter().map(Adapter::of).collect()
}

/// Kinds of adapter to choose from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    Any,
    Hardware,
}

/// The adapter named by `WGPU_ADAPTER_NAME`, if that is set; else the best: discrete, integrated, virtual, software.
pub(super) fn best(which: Wanted) -> Result<Option<wgpu::Adapter>, EngineError> {
    if let Some(wanted) = std::env::var("WGPU_ADAPTER_NAME").ok().filter(|name| !name.is_empty()) {
        return find(&wanted).map(Some);
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
    Ok(enumerate().into_iter().filter(will_do).min_by_key(rank)) // the first of the best
}

/// Finds the adapter with an index, or the one whose name holds a text.
pub(super) fn find(wanted: &str) -> Result<wgpu::Adapter, EngineError> {
    let all = enumerate();
    let holds =
        |adapter: &wgpu::Adapter| adapter.get_info().name.to_lowercase().contains(&wanted.to_lowercase());
    let index = wanted.parse().ok().filter(|&index: &usize| index < all.len());
    let position = index.or_else(|| all.iter().position(holds)); // 4090 may be part of a name
    let missing =
        || EngineError::NoAdapter { wanted: wanted.to_owned(), found: all.iter().map(Adapter::of).collect() };
    Ok(all[position.ok_or_else(missing)?].clone())
}

fn enumerate() -> Vec<wgpu::Adapter> {
    let compiled = wgpu::Instance::enabled_backend_features();
    if compiled.is_empty() {
        return Vec::new(); // a library build without back ends; wgpu would panic
    }
    let backends = wgpu::Backends::from_env().unwrap_or(compiled) & compiled;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        flags: wgpu::InstanceFlags::empty().with_env(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let compute = |adapter: &wgpu::Adapter| {
        let flags = adapter.get_downlevel_capabilities().flags;
        flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    };
    pollster::block_on(instance.enumerate_adapters(backends)).into_iter().filter(compute).collect()
}
