//! What a host keeps in its own hands: ranges that change, buffers, passes, indices, counts and whole shaders.

mod buffers;

use buffers::read;
use spectroll::{
    Arithmetic, ArithmeticTrait, BindingRole, Bounds, ComputeShader, Engine, Indexing, Layout, Model,
    PrepareOptions, Prepared, Probe, Quantity, Recipe, RecipeBuilder, Sampler, SamplerError, SamplerOptions,
    Sensors, ShaderVariant, Stream,
    wgpu::{self, BufferUsages},
};

#[allow(dead_code)] // a host has more than these tests need
#[path = "../examples/host/mod.rs"]
mod host;

fn builder() -> RecipeBuilder {
    Recipe::builder(&Model::builtin("munsell-vrhel").expect("it is built in"))
}

fn surfaces() -> Recipe {
    builder().quantities([Quantity::Spectra, Quantity::Attempts]).build().expect("it can be drawn")
}

/// Rows that are not those of the CPU, of so many words.
fn other_rows(recipe: &Recipe, words: &[u32], draws: spectroll::DrawRange) -> usize {
    let scalar = recipe.scalar_sampler::<f32>();
    let rows = words.chunks_exact(31).take(draws.count as usize).enumerate();
    let is_other = |(i, row): &(usize, &[u32])| {
        let drawn = scalar.draw(draws.stream, draws.first + *i as u64);
        !row.iter().zip(drawn.spectrum()).all(|(a, b)| (f32::from_bits(*a) - b).abs() < 1e-6)
    };
    rows.filter(is_other).count()
}

/// A pass that was recorded for few draws makes as many as are set after it.
#[test]
fn draws_that_are_set_after_recording_are_all_made() {
    let host = host::device();
    let recipe = surfaces();
    let sampler = Sampler::new(&host.0, &recipe).expect("two buffers are few");
    let mut prepared = sampler.prepare(&host.0, Stream::new(1).draws(0..4096)).expect("they are few");
    prepared.set_draws(&host.1, Stream::new(2).draws(0..10)).expect("there is room");
    let mut encoder = host.0.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    let draws = Stream::new(3).draws(7..7 + 4096);
    prepared.set_draws(&host.1, draws).expect("there is room");
    let words =
        read(&host, encoder, &[prepared.buffer(Quantity::Spectra).expect("it is asked for")]).remove(0);
    assert_eq!(other_rows(&recipe, &words, draws), 0);
}

/// Planes lie as far apart as was prepared, whatever range is drawn.
#[test]
fn planes_stay_where_they_were_prepared() {
    let host = host::device();
    let recipe = builder().layout(Layout::Planes).build().expect("it can be drawn");
    let sampler = Sampler::new(&host.0, &recipe).expect("a buffer is few");
    let mut prepared = sampler.prepare(&host.0, Stream::new(1).draws(0..101)).expect("they are few");
    let draws = Stream::new(2).draws(0..37);
    prepared.set_draws(&host.1, draws).expect("there is room");
    let mut encoder = host.0.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    let words =
        read(&host, encoder, &[prepared.buffer(Quantity::Spectra).expect("it is asked for")]).remove(0);
    let rows: Vec<u32> = (0..37)
        .flat_map(|i| (0..31).map(move |band| (i, band)))
        .map(|(i, band)| words[band * 104 + i])
        .collect();
    assert_eq!(other_rows(&recipe, &rows, draws), 0);
}

/// Parts of a host's buffer, a pass of its own with other work, indices from a buffer, and counts from the GPU.
#[test]
fn a_host_owns_buffers_passes_and_counts() {
    let host = host::device();
    let recipe = surfaces();
    let options = SamplerOptions { arithmetic: Arithmetic::Exact, indexing: Indexing::List, cache: None };
    let sampler = Sampler::with_options(&host.0, &recipe, options).expect("three buffers are few");
    let stream = Stream::new(5);
    let indices: Vec<u64> = (0..300).map(|i| i * i * 7_919).collect();
    let buffer = |size, usage| {
        host.0.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let own = buffer(1024 + 4 * 31 * 300, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let list = buffer(256 + 8 * 300, BufferUsages::STORAGE | BufferUsages::COPY_DST);
    host.1.write_buffer(&list, 256, bytemuck::cast_slice(&ComputeShader::indices(stream.at(&indices))));
    let part = |buffer, offset| wgpu::BufferBinding { buffer, offset, size: None };
    let options = PrepareOptions {
        outputs: vec![(Quantity::Spectra, part(&own, 1024))],
        indices: Some(part(&list, 256)),
        ..PrepareOptions::default()
    };
    let draws = stream.draws(0..300);
    let prepared = sampler.prepare_with(&host.0, draws, &options).expect("it fits");
    // Of 300 draws the host wants 130, which it knows on the GPU alone.
    let counts = buffer(16, BufferUsages::INDIRECT | BufferUsages::COPY_DST | BufferUsages::COPY_SRC);
    host.1.write_buffer(&counts, 0, bytemuck::cast_slice(&[sampler.shader().workgroups(130), 1, 1, 130]));
    let mut encoder = host.0.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(&counts, 12, prepared.parameters(), Prepared::COUNT_OFFSET, 4);
    prepared.clear(&mut encoder);
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        prepared.record_indirect_in(&mut pass, &counts, 0);
    }
    let words = read(&host, encoder, &[&own]).remove(0);
    assert!(words[..256].iter().all(|&word| word == 0), "what lies before is the host's");
    let rows: Vec<_> = words[256..].chunks_exact(31).collect();
    let scalar = recipe.scalar_sampler::<f32>();
    for (&index, row) in indices.iter().zip(&rows).take(130) {
        let spectrum: Vec<u32> = scalar.draw(stream, index).spectrum().iter().map(|v| v.to_bits()).collect();
        assert_eq!(**row, *spectrum, "draw {index}");
    }
    assert!(rows[130..].iter().all(|row| row.iter().all(|&word| word == 0)));

    let small =
        PrepareOptions { outputs: vec![(Quantity::Spectra, part(&own, 2048))], ..PrepareOptions::default() };
    let error = sampler.prepare_with(&host.0, draws, &small).unwrap_err().to_string();
    assert!(error.contains("the spectra of 300 draws need 37200 bytes from offset 2048 on"), "{error}");
    let misaligned =
        PrepareOptions { outputs: vec![(Quantity::Spectra, part(&own, 4))], ..PrepareOptions::default() };
    let error = sampler.prepare_with(&host.0, draws, &misaligned).unwrap_err().to_string();
    assert!(error.contains("must be a multiple of"), "{error}");
    let other = PrepareOptions { outputs: vec![(Quantity::Xyz, part(&own, 0))], ..PrepareOptions::default() };
    assert_eq!(
        sampler.prepare_with(&host.0, draws, &other).unwrap_err(),
        SamplerError::NotAsked(Quantity::Xyz)
    );
}

/// A host that has its own bindings, and of the library only text and bytes, as on another version of wgpu.
#[test]
fn a_shader_can_be_run_without_a_sampler() {
    let host = host::device();
    let recipe = builder().lrv(0.99).bounds(Bounds::Scaled).build().expect("it can be drawn");
    let shader = recipe.compute_shader(ShaderVariant::default()).expect("it has few bands");
    let draws = Stream::new(6).draws(0..1000);
    let module = host.0.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(shader.text().into()),
    });
    let pipeline = host.0.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some(ComputeShader::ENTRY_POINT),
        compilation_options: Default::default(),
        cache: None,
    });
    let buffers: Vec<_> = shader
        .bindings()
        .iter()
        .map(|binding| {
            let usage = match binding.role {
                BindingRole::Parameters => BufferUsages::UNIFORM,
                _ => BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            };
            let size = shader.bytes(binding.role, 1000);
            let usage = usage | BufferUsages::COPY_DST;
            let buffer = host.0.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage,
                mapped_at_creation: false,
            });
            match binding.role {
                BindingRole::Parameters => host.1.write_buffer(&buffer, 0, &shader.parameters(draws, 1000)),
                role => host.1.write_buffer(&buffer, 0, shader.contents(role).unwrap_or_default()),
            }
            (binding, buffer)
        })
        .collect();
    let entries = buffers.iter().map(|(binding, buffer)| wgpu::BindGroupEntry {
        binding: binding.binding,
        resource: buffer.as_entire_binding(),
    });
    let bindings = host.0.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries.collect::<Vec<_>>(),
    });
    let mut encoder = host.0.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        (0..shader.dispatches()).for_each(|_| pass.dispatch_workgroups(shader.workgroups(1000), 1, 1));
    }
    let spectra = buffers
        .iter()
        .find(|(b, _)| b.role == BindingRole::Output(Quantity::Spectra))
        .expect("it is asked for");
    let words = read(&host, encoder, &[&spectra.1]).remove(0);
    assert_eq!(other_rows(&recipe, &words, draws), 0);
}

#[test]
fn what_hosts_hold_can_be_sent_and_shared() {
    fn assert_shared<T: Send + Sync>() {}
    assert_shared::<(Sampler, Prepared, ComputeShader, Recipe, Model, Engine)>();
    assert_shared::<(spectroll::scene::Scene, spectroll::scene::PreparedScene, spectroll::scene::SceneSampler)>(
    );
}

/// The form that a host takes for its device.
#[test]
fn a_device_is_probed() {
    let (device, queue) = host::device();
    let probe = spectroll::probe(&device, &queue).expect("the device works");
    println!("{}: {:?}", probe.verdict, probe.traits);
    let impossible = [ArithmeticTrait::OtherSums, ArithmeticTrait::OtherProducts];
    assert!(probe.traits.iter().all(|(found, cases)| !impossible.contains(found) && *cases <= Probe::CASES));
    if device.adapter_info().device_type == wgpu::DeviceType::Cpu {
        assert!(probe.verdict.is_exact);
    }
}

/// Responses that a host's own passes might have written, at an offset of its buffer.
#[test]
fn draws_are_given_the_colours_of_a_hosts_buffer() {
    let host = host::device();
    let eye = Sensors::builtin("cie1931").expect("it is built in");
    let recipe = builder().given(eye).build().expect("it can be drawn");
    let sampler = Sampler::new(&host.0, &recipe).expect("two buffers are few");
    let draws = Stream::new(8).draws(0..100);
    let error = sampler.prepare(&host.0, draws).unwrap_err();
    assert_eq!(error, SamplerError::NothingGiven { responses: 3 });
    let colours: Vec<f32> = (0..300).map(|i| 0.3 + 0.0002 * i as f32).collect();
    let buffer = host.0.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 256 + 1200,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    host.1.write_buffer(&buffer, 256, bytemuck::cast_slice(&colours));
    let part = |offset| wgpu::BufferBinding { buffer: &buffer, offset, size: None };
    let options = |offset| PrepareOptions { given: Some(part(offset)), ..PrepareOptions::default() };
    let error = sampler.prepare_with(&host.0, draws, &options(512)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the responses that 100 draws are given need 1200 bytes from offset 512 on, and the buffer has 944 there: bind more \
         of it"
    );
    let prepared = sampler.prepare_with(&host.0, draws, &options(256)).expect("there is room");
    let mut encoder = host.0.create_command_encoder(&Default::default());
    prepared.record(&mut encoder);
    let words =
        read(&host, encoder, &[prepared.buffer(Quantity::Spectra).expect("it is asked for")]).remove(0);
    let scalar = recipe.scalar_sampler::<f32>();
    for (i, (row, colour)) in words.chunks_exact(31).zip(colours.chunks_exact(3)).enumerate() {
        let drawn = scalar.draw_given(draws.stream, i as u64, colour);
        assert!(drawn.status().attempts() > 0);
        let close = |(a, b): (&u32, &f32)| (f32::from_bits(*a) - b).abs() < 1e-6;
        assert!(row.iter().zip(drawn.spectrum()).all(close), "draw {i}");
    }
}
