//! The GPU engine: a device of its own, and a ring of windows in flight.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Instant;

use wgpu::{BufferUsages, Features, PollType};

use super::{Adapter, Batch, EngineError, Pace};
use crate::recipe::Recipe;
use crate::sampler::{Prepared, Sampler};
use crate::stream::Draws;

/// How many windows are in flight: one with the caller, one being computed, one waiting to be.
const RING: usize = 3;

/// An open device.
#[derive(Debug)]
pub(super) struct Gpu {
    adapter: Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Whether the host can map what shaders write, which spares a copy where memory is shared.
    shared_memory: bool,
    /// The first error that the device reported outside of any call.
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    pub(super) fn open(adapter: wgpu::Adapter) -> Result<Gpu, EngineError> {
        let description = Adapter::of(&adapter);
        let shares =
            matches!(adapter.get_info().device_type, wgpu::DeviceType::Cpu | wgpu::DeviceType::IntegratedGpu);
        let mut wanted = Features::SHADER_INT64;
        wanted.set(Features::MAPPABLE_PRIMARY_BUFFERS, shares);
        let features = adapter.features() & wanted;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("spectroll"),
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|e| EngineError::Gpu { adapter: description.to_string(), reason: e.to_string() })?;

        // Without a handler wgpu panics. With one, work that follows the first error is void and says so.
        let fault = Arc::new(Mutex::new(None));
        let note = {
            let fault = fault.clone();
            move |reason: String| {
                fault.lock().expect("no holder panics").get_or_insert(reason);
            }
        };
        let note_lost = note.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(error.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note_lost(format!("the device was lost: {message}"));
            }
        });
        let shared_memory = features.contains(Features::MAPPABLE_PRIMARY_BUFFERS);
        Ok(Gpu { adapter: description, device, queue, shared_memory, fault })
    }

    pub(super) fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    #[cfg(any(test, feature = "report"))]
    pub(super) fn device(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// Waits until a window can be read. Says whether that took any waiting.
    fn land(&self, flight: &Flight) -> Result<bool, EngineError> {
        let mut waited = false;
        let mut poll = PollType::Poll;
        loop {
            let polled = self.device.poll(poll);
            if let Some(reason) = self.fault.lock().expect("no holder panics").clone() {
                return Err(self.error(reason));
            }
            polled.map_err(|e| self.error(e.to_string()))?;
            match flight.state() {
                Some(Ok(())) => return Ok(waited),
                Some(Err(e)) => return Err(self.error(e.to_string())),
                None => waited = true,
            }
            poll = PollType::Wait { submission_index: Some(flight.submission.clone()), timeout: None };
        }
    }

    fn error(&self, reason: String) -> EngineError {
        EngineError::Gpu { adapter: self.adapter.to_string(), reason }
    }
}

/// A recipe on a device.
pub(super) struct Drawer<'a> {
    gpu: &'a Gpu,
    sampler: Sampler,
    pace: Pace,
    /// The windows that are not in flight.
    slots: Vec<Slot>,
    /// How many draws each has room for.
    capacity: u64,
}

impl<'a> Drawer<'a> {
    pub(super) fn new(gpu: &'a Gpu, recipe: &Recipe) -> Result<Self, EngineError> {
        let sampler = Sampler::of(&gpu.device, &recipe.program().tallied())?;
        let pace = Pace::new(recipe, sampler.formats(), sampler.max_count(&gpu.device.limits()));
        Ok(Drawer { gpu, sampler, pace, slots: Vec::new(), capacity: 0 })
    }

    pub(super) fn draw<E: From<EngineError>>(
        &mut self,
        draws: Draws,
        sink: &mut impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<(), E> {
        self.make_room(draws)?;
        let mut flying = VecDeque::new();
        let mut offset = 0;
        let mut last_end = None;
        loop {
            while let Some(part) = self.pace.window(draws, offset) {
                let Some(slot) = self.slots.pop() else { break };
                flying.push_back(slot.submit(self.gpu, part));
                offset += part.count;
            }
            let Some(flight) = flying.pop_front() else { return Ok(()) };
            let waited = self.gpu.land(&flight)?;
            // A window that was not waited for says nothing of the device, but that the caller sets the pace; the
            // first says how long the shader took to compile, and the last is but a remainder.
            let is_last = flying.is_empty() && offset == draws.count;
            if let Some(start) = last_end.filter(|_| waited && !is_last) {
                self.pace.learn(flight.draws.count, start);
            }
            last_end = Some(Instant::now());
            self.slots.push(flight.read(sink)?);
        }
    }

    /// Sees to it that there are slots for the windows of `draws`. An error while drawing loses some.
    fn make_room(&mut self, draws: Draws) -> Result<(), EngineError> {
        let needed = self.pace.most.min(draws.count);
        if self.capacity < needed {
            self.slots.clear();
            self.capacity = needed;
        }
        while self.slots.len() < RING {
            self.slots.push(Slot::new(self.gpu, &self.sampler, draws.part(0, self.capacity))?);
        }
        Ok(())
    }
}

/// Buffers for one window.
struct Slot {
    prepared: Prepared,
    /// Copies of the buffers that the host can map, where it cannot map the originals.
    staging: Option<Vec<wgpu::Buffer>>,
}

/// A window that was submitted.
struct Flight {
    slot: Slot,
    draws: Draws,
    submission: wgpu::SubmissionIndex,
    /// What mapping each buffer came to.
    mapped: Vec<Arc<OnceLock<Result<(), wgpu::BufferAsyncError>>>>,
}

impl Slot {
    fn new(gpu: &Gpu, sampler: &Sampler, capacity: Draws) -> Result<Slot, EngineError> {
        let usage = if gpu.shared_memory { BufferUsages::MAP_READ } else { BufferUsages::COPY_SRC };
        let prepared = sampler.prepare_for(&gpu.device, capacity, usage)?;
        let copy = |buffer: &wgpu::Buffer| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("spectroll staging"),
                size: buffer.size(),
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let staging = (!gpu.shared_memory).then(|| prepared.buffers().iter().map(copy).collect());
        Ok(Slot { prepared, staging })
    }

    fn submit(mut self, gpu: &Gpu, draws: Draws) -> Flight {
        self.prepared.turn_to(&gpu.queue, draws);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("spectroll") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        self.prepared.record(&mut encoder);
        for (from, to) in self.prepared.buffers().iter().zip(self.staging.iter().flatten()) {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, None);
        }
        let submission = gpu.queue.submit([encoder.finish()]);
        let map = |buffer: &wgpu::Buffer| {
            let state = Arc::new(OnceLock::new());
            let callback_state = state.clone();
            buffer.map_async(wgpu::MapMode::Read, .., move |result| drop(callback_state.set(result)));
            state
        };
        let mapped = self.readable().iter().map(map).collect();
        Flight { slot: self, draws, submission, mapped }
    }

    /// The buffers, where the host maps them.
    fn readable(&self) -> &[wgpu::Buffer] {
        self.staging.as_deref().unwrap_or(self.prepared.buffers())
    }
}

impl Flight {
    /// Whether all buffers are mapped, or why one is not; `None` as long as that is open.
    fn state(&self) -> Option<Result<(), wgpu::BufferAsyncError>> {
        self.mapped.iter().map(|state| state.get().cloned()).collect()
    }

    /// Hands a window that has landed to `sink`.
    fn read<E>(self, sink: &mut impl FnMut(Batch) -> Result<(), E>) -> Result<Slot, E> {
        let buffers = self.slot.readable();
        {
            let view = |buffer: &wgpu::Buffer| buffer.get_mapped_range(..).expect("it has landed");
            let views: Vec<_> = buffers.iter().map(view).collect();
            let arrays = views.iter().map(|view| &view[..]);
            sink(Batch::new(self.draws, self.slot.prepared.formats(), arrays))?;
        }
        buffers.iter().for_each(wgpu::Buffer::unmap);
        Ok(self.slot)
    }
}
