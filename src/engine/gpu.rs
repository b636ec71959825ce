//! The GPU engine: a device that it opens, and a ring of windows in flight.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Instant;

use wgpu::{BufferUsages, Features, PollType};

use super::exactness::{self, ArithmeticChoice, ArithmeticVerdict};
use super::schedule::{Job, Pace, Window};
use super::{Adapter, Batch, EngineError};
use crate::quantity::Quantity;
use crate::random::stream::{DrawRange, Draws};
use crate::sampler::{PrepareOptions, Prepared, Sampler};
use crate::wgsl::Indexing;

/// Number of windows in flight: one with the caller, one being computed, one waiting to be.
const RING: usize = 3;

/// An open device.
#[derive(Debug)]
pub(super) struct Gpu {
    adapter: Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Whether the host can map the buffers that shaders write, which spares a copy where memory is shared.
    shared_memory: bool,
    /// The first error that the device reported outside of any call.
    fault: Arc<Mutex<Option<String>>>,
    /// Arithmetic in which it draws.
    pub(super) arithmetic: ArithmeticChoice,
    /// Share of the windows that are made again on the CPU.
    pub(super) recheck: f64,
    record: Mutex<Record>,
}

/// Record of the draws of a device.
#[derive(Debug, Default)]
struct Record {
    verdict: Option<ArithmeticVerdict>,
    rechecked: u64,
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
        let gpu = Gpu::of(description, device, queue);
        Ok(Gpu { shared_memory, fault, ..gpu })
    }

    fn of(adapter: Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Gpu {
        Gpu {
            adapter,
            device,
            queue,
            shared_memory: false,
            fault: Arc::default(),
            arithmetic: ArithmeticChoice::default(),
            recheck: 0.0,
            record: Mutex::default(),
        }
    }

    /// A host's device, whose errors are the host's.
    pub(super) fn of_host(device: &wgpu::Device, queue: &wgpu::Queue) -> Gpu {
        let int64 = device.features().contains(Features::SHADER_INT64);
        Gpu::of(Adapter::new(device.adapter_info(), int64), device.clone(), queue.clone())
    }

    /// Notes the verdict on a pipeline that is to draw.
    fn note_verdict(&self, verdict: ArithmeticVerdict) {
        let mut record = self.record.lock().expect("no holder panics");
        record.verdict = Some(record.verdict.map_or(verdict, |before| before.and(verdict)));
    }

    /// Notes draws that were made again on the CPU.
    pub(super) fn note_rechecked(&self, draws: u64) {
        self.record.lock().expect("no holder panics").rechecked += draws;
    }

    pub(super) fn verdict(&self) -> Option<ArithmeticVerdict> {
        self.record.lock().expect("no holder panics").verdict
    }

    pub(super) fn rechecked(&self) -> u64 {
        self.record.lock().expect("no holder panics").rechecked
    }

    pub(super) fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    pub(super) fn device(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// Waits until a window can be read. Returns whether that took any waiting.
    fn land(&self, flight: &Flight) -> Result<bool, EngineError> {
        let mut waited = false;
        let mut poll = PollType::Poll;
        loop {
            self.poll(poll)?;
            match flight.state() {
                Some(Ok(())) => return Ok(waited),
                Some(Err(e)) => return Err(self.error(e.to_string())),
                None => waited = true,
            }
            poll = PollType::Wait { submission_index: Some(flight.submission.clone()), timeout: None };
        }
    }

    /// Polls the device, and returns the error that it reported, if any.
    pub(super) fn poll(&self, poll: PollType) -> Result<(), EngineError> {
        let polled = self.device.poll(poll);
        if let Some(reason) = self.fault.lock().expect("no holder panics").clone() {
            return Err(self.error(reason));
        }
        polled.map(drop).map_err(|e| self.error(e.to_string()))
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("spectroll") })
    }

    pub(super) fn error(&self, reason: String) -> EngineError {
        EngineError::Gpu { adapter: self.adapter.to_string(), reason }
    }
}

/// Jobs of a schedule on a device.
pub(super) struct GpuSchedule<'a> {
    gpu: &'a Gpu,
    jobs: Vec<ReadyJob>,
    pace: Pace,
    /// The windows that are not in flight.
    slots: Vec<Slot>,
    /// Number of steps that each slot has room for.
    capacity: u64,
    /// A schedule of each job's draws as steps of their own, where a step of some job is too large for a dispatch.
    parts: Vec<GpuSchedule<'a>>,
}

/// A job of the schedule, with its compute pipeline.
struct ReadyJob {
    sampler: Sampler,
    per_step: u64,
}

impl<'a> GpuSchedule<'a> {
    pub(super) fn new(gpu: &'a Gpu, jobs: &[Job], indexing: Indexing) -> Result<Self, EngineError> {
        let mut samplers: Vec<Sampler> = Vec::new();
        for (i, job) in jobs.iter().enumerate() {
            let program = job.recipe.program();
            samplers.push(match jobs[..i].iter().position(|other| other.recipe.program() == program) {
                Some(other) => samplers[other].clone(),
                None => {
                    let (sampler, verdict) = exactness::sampler(gpu, job.recipe, indexing, gpu.arithmetic)?;
                    gpu.note_verdict(verdict);
                    sampler
                }
            });
        }
        GpuSchedule::of_samplers(gpu, jobs, samplers)
    }

    /// Schedule of jobs whose shaders are compiled.
    pub(super) fn of_samplers(
        gpu: &'a Gpu,
        jobs: &[Job],
        samplers: Vec<Sampler>,
    ) -> Result<Self, EngineError> {
        let ready = |(job, sampler): (&Job, Sampler)| ReadyJob { sampler, per_step: job.per_step };
        let roles: Vec<_> = jobs.iter().zip(samplers).map(ready).collect();
        let limits = gpu.device.limits();
        let most = roles.iter().map(|role| role.sampler.max_count(&limits) / role.per_step).min();
        let most = most.expect("an ensemble has jobs");
        let single = |(job, ready): (&Job, &ReadyJob)| {
            GpuSchedule::of_samplers(gpu, &[Job { per_step: 1, ..*job }], vec![ready.sampler.clone()])
        };
        let is_too_large = most == 0 && jobs.iter().any(|job| job.per_step > 1);
        let parts = match is_too_large {
            true => jobs.iter().zip(&roles).map(single).collect::<Result<_, _>>()?,
            false => Vec::new(),
        };
        let pace = Pace::new(jobs, roles.iter().map(|role| role.sampler.formats()), most);
        Ok(GpuSchedule { gpu, jobs: roles, pace, slots: Vec::new(), capacity: 0, parts })
    }

    pub(super) fn draw<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        sink: &mut impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        match self.parts.is_empty() {
            true => self.draw_windows(draws, steps, sink),
            false => self.draw_in_parts(draws, steps, sink),
        }
    }

    /// Draws windows of whole steps.
    fn draw_windows<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        sink: &mut impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        self.make_room(draws, steps)?;
        let mut flying = VecDeque::new();
        let mut offset = 0;
        let mut last_end = None;
        loop {
            while let Some(window) = self.pace.window(steps, offset) {
                let Some(slot) = self.slots.pop() else { break };
                let parts = self.jobs.iter().zip(draws);
                let parts = parts.map(|(job, draws)| window.of(*draws, job.per_step)).collect();
                flying.push_back((window, slot.submit(self.gpu, parts)));
                offset += window.steps;
            }
            let Some((window, mut flight)) = flying.pop_front() else { return Ok(()) };
            let mut waited = self.gpu.land(&flight)?;
            while flight.is_unfinished() {
                flight = flight.resume(self.gpu);
                waited |= self.gpu.land(&flight)?;
            }
            // A window that was not waited for says nothing of the device, but that the caller sets the pace; the
            // first says how long the shader took to compile, and the last is but a remainder.
            let is_last = flying.is_empty() && offset == steps;
            if let Some(start) = last_end.filter(|_| waited && !is_last) {
                self.pace.learn(window.steps, start);
            }
            last_end = Some(Instant::now());
            self.slots.push(flight.read(sink)?);
        }
    }

    /// Draws each step in as many dispatches as it takes, and hands it over as a whole.
    fn draw_in_parts<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        sink: &mut impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        for offset in 0..steps {
            let window = Window { offset, steps: 1 };
            let mut all = Vec::new();
            for ((part, job), draws) in self.parts.iter_mut().zip(&self.jobs).zip(draws) {
                let range = window.of(*draws, job.per_step);
                let formats = job.sampler.formats();
                let mut arrays = vec![Vec::new(); formats.len()];
                part.draw_windows::<EngineError>(&[range], range.count(), &mut |batches: &[Batch]| {
                    for (array, format) in arrays.iter_mut().zip(formats) {
                        array.extend_from_slice(batches[0].bytes(format.quantity));
                    }
                    Ok(())
                })?;
                all.push((range, formats, arrays));
            }
            let mut batches = Vec::new();
            for (range, formats, arrays) in &all {
                batches.push(Batch::new(
                    range.range,
                    formats,
                    arrays.iter().map(|array: &Vec<u8>| array.as_slice()),
                ));
            }
            sink(&batches)?;
        }
        Ok(())
    }

    /// Allocates slots for windows of this number of steps. An error while drawing loses some of them.
    fn make_room(&mut self, draws: &[Draws], steps: u64) -> Result<(), EngineError> {
        let needed = self.pace.most.min(steps);
        if self.capacity < needed {
            self.slots.clear();
            self.capacity = needed;
        }
        let window = Window { offset: 0, steps: self.capacity };
        while self.slots.len() < RING {
            self.slots.push(Slot::new(self.gpu, &self.jobs, draws, window)?);
        }
        Ok(())
    }
}

/// Buffers for one window.
struct Slot {
    /// Buffers of each job.
    prepared: Vec<Prepared>,
    /// Copies of the buffers that the host can map, where it cannot map the originals.
    staging: Option<Vec<wgpu::Buffer>>,
}

/// A window that was submitted.
struct Flight {
    slot: Slot,
    /// Draws of each job.
    draws: Vec<DrawRange>,
    submission: wgpu::SubmissionIndex,
    /// Number of slices of each job that were submitted.
    slices: u32,
    /// Result of mapping each buffer.
    mapped: Vec<Arc<OnceLock<Result<(), wgpu::BufferAsyncError>>>>,
}

impl Slot {
    fn new(gpu: &Gpu, jobs: &[ReadyJob], draws: &[Draws], window: Window) -> Result<Slot, EngineError> {
        let usages = if gpu.shared_memory { BufferUsages::MAP_READ } else { BufferUsages::COPY_SRC };
        let options = PrepareOptions { usages, ..PrepareOptions::default() };
        let prepare = |(job, draws): (&ReadyJob, &Draws)| {
            job.sampler.prepare_slices(&gpu.device, window.of(*draws, job.per_step).range, &options)
        };
        let prepared = jobs.iter().zip(draws).map(prepare).collect::<Result<Vec<_>, _>>()?;
        let copy = |buffer: &wgpu::Buffer| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("spectroll staging"),
                size: buffer.size(),
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let staging =
            (!gpu.shared_memory).then(|| prepared.iter().flat_map(Prepared::buffers).map(copy).collect());
        Ok(Slot { prepared, staging })
    }

    fn submit(mut self, gpu: &Gpu, draws: Vec<Draws>) -> Flight {
        let mut encoder = gpu.encoder();
        for (prepared, draws) in self.prepared.iter_mut().zip(&draws) {
            prepared.set_window(&gpu.queue, draws.range).expect("a window has no more steps than a slot");
            prepared.set_indices(&gpu.queue, *draws);
            prepared.set_given(&gpu.queue, *draws);
            prepared.record_first(&mut encoder);
        }
        let draws = draws.iter().map(|draws| draws.range).collect();
        self.fly(gpu, encoder, draws, 1)
    }

    /// Submits what was recorded, and asks for the buffers.
    fn fly(self, gpu: &Gpu, mut encoder: wgpu::CommandEncoder, draws: Vec<DrawRange>, slices: u32) -> Flight {
        let drawn = self.prepared.iter().flat_map(Prepared::buffers);
        for (from, to) in drawn.zip(self.staging.iter().flatten()) {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, None);
        }
        let submission = gpu.queue.submit([encoder.finish()]);
        let map = |buffer: &wgpu::Buffer| {
            let state = Arc::new(OnceLock::new());
            let callback_state = state.clone();
            buffer.map_async(wgpu::MapMode::Read, .., move |result| drop(callback_state.set(result)));
            state
        };
        let mapped = self.readable().map(map).collect();
        Flight { slot: self, draws, submission, slices, mapped }
    }

    /// The buffers that the host maps.
    fn readable(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        let originals = self.prepared.iter().flat_map(Prepared::buffers);
        // One of the two is empty.
        let originals = originals.take(if self.staging.is_some() { 0 } else { usize::MAX });
        self.staging.iter().flatten().chain(originals)
    }
}

impl Flight {
    /// Result of mapping all buffers; `None` as long as one is open.
    fn state(&self) -> Option<Result<(), wgpu::BufferAsyncError>> {
        self.mapped.iter().map(|state| state.get().cloned()).collect()
    }

    /// Whether a draw of a window that has landed has found no candidate yet, and may take more.
    fn is_unfinished(&self) -> bool {
        let mut buffers = self.slot.readable();
        self.slot.prepared.iter().zip(&self.draws).any(|(prepared, draws)| {
            let arrays: Vec<_> = buffers.by_ref().take(prepared.formats().len()).collect();
            let status = prepared.formats().iter().position(|f| f.quantity == Quantity::Attempts);
            prepared.slices() > self.slices && {
                let view = arrays[status.expect("an engine asks for it")].get_mapped_range(..);
                let view = view.expect("it has landed");
                bytemuck::cast_slice::<_, u32>(&view[..4 * draws.count as usize]).contains(&0)
            }
        })
    }

    /// Submits the next slice of each job that has one.
    fn resume(self, gpu: &Gpu) -> Flight {
        self.slot.readable().for_each(wgpu::Buffer::unmap);
        let mut encoder = gpu.encoder();
        let jobs = self.slot.prepared.iter().filter(|prepared| prepared.slices() > self.slices);
        jobs.for_each(|prepared| prepared.record_next(&mut encoder));
        self.slot.fly(gpu, encoder, self.draws, self.slices + 1)
    }

    /// Hands a window that has landed to `sink`.
    fn read<E>(self, sink: &mut impl FnMut(&[Batch]) -> Result<(), E>) -> Result<Slot, E> {
        {
            let view = |buffer: &wgpu::Buffer| buffer.get_mapped_range(..).expect("it has landed");
            let views: Vec<_> = self.slot.readable().map(view).collect();
            let mut arrays = views.iter().map(|view| &view[..]);
            let jobs = self.slot.prepared.iter().zip(&self.draws);
            let batches = jobs.map(|(prepared, draws)| {
                let formats = prepared.formats();
                Batch::new(*draws, formats, arrays.by_ref().take(formats.len()).collect::<Vec<_>>())
            });
            sink(&batches.collect::<Vec<_>>())?;
        }
        self.slot.readable().for_each(wgpu::Buffer::unmap);
        Ok(self.slot)
    }
}
