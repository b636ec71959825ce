//! The text for shaders of others: every recipe has one, in both forms and with its tables in either place, and in a host's
//! shader it makes the draws of the CPU.

mod buffers;
mod engines;
#[path = "../examples/host/mod.rs"]
#[allow(dead_code)] // this only computes
mod host;

use buffers::read;
use engines::{gpu_is_software, kernel_at, kernel_surfaces, lamps, lamps_at, lights, surfaces};
use rand::RngExt;
use spectroll::wgpu::{self, BufferUsages};
use spectroll::{
    Arithmetic, Bounds, Distribution, Grid, Intensity, Model, ModuleOptions, ProposalKind, Quantity, Recipe,
    RecipeBuilder, SpectrumKind, Stream, StreamRng, TableStorage, WgslError,
};

/// Number of draws of a recipe.
const COUNT: u32 = 512;

const SEED: u32 = 11;

/// Where the draws begin: the low word of their indices overflows among them.
const FIRST: u64 = (5 << 32) - 256;

/// Surfaces at other wavelengths, of as many components.
fn surfaces_at(grid: &str, components: usize) -> RecipeBuilder {
    let grid: Grid = grid.parse().expect("a grid");
    let model =
        Model::builtin_with("munsell-vrhel", grid, components).expect("its data have these wavelengths");
    Recipe::builder(&model)
}

/// Surfaces at uneven wavelengths.
fn uneven_surfaces() -> RecipeBuilder {
    surfaces_at("410,443,490,510,560,620,665,681", 4)
}

fn recipes() -> Vec<(&'static str, Recipe)> {
    let scaled = |lrv: f64| surfaces().lrv(lrv).bounds(Bounds::Scaled);
    let all: Vec<(&str, RecipeBuilder)> = vec![
        ("plain", surfaces()),
        ("base", surfaces().lrv(0.6)),
        ("both", surfaces().lrv(0.6).bounds(Bounds::Both)),
        ("a target for each", surfaces().lrv(0.2..0.6).bounds(Bounds::Both)),
        ("colour", surfaces().xyz([0.3, 0.3, 0.3])),
        ("cover", scaled(0.99)),
        ("cover of a wide model", surfaces().covariance_scale(25.0).proposal(ProposalKind::Cover)),
        ("kernel", kernel_surfaces()),
        ("kernel, scaled", kernel_surfaces().lrv(0.6).bounds(Bounds::Scaled)),
        ("mixture", lamps()),
        ("light", lights()),
        ("log-uniform", lights().intensity(Intensity::LogUniform(0.15, 150.0))),
        ("of the data", lights().intensity(Intensity::Data)),
        ("few bands", surfaces_at("400:50:700", 6)),
        ("one band", surfaces_at("550:10:550", 1)),
        ("uneven", uneven_surfaces()),
        ("in loops", surfaces_at("400:1:700", 7)),
        ("in loops, a target for each", surfaces_at("400:1:700", 8).lrv(0.2..0.6).bounds(Bounds::Scaled)),
        ("in loops, a kernel", kernel_at("400:1:700", 8)),
        ("in loops, a mixture", lamps_at("400:1:700", 9)),
        ("in loops, a cover", surfaces_at("400:1:700", 8).lrv(0.97).bounds(Bounds::Scaled)),
    ];
    let built = |(name, builder): (&'static str, RecipeBuilder)| {
        (name, builder.build().unwrap_or_else(|e| panic!("{name}: {e}")))
    };
    all.into_iter().map(built).collect()
}

/// The draws of a recipe by its text in a host's shader, band by band, with what each took.
fn drawn(
    host: &(wgpu::Device, wgpu::Queue),
    recipe: &Recipe,
    options: ModuleOptions,
    stream: Stream,
) -> Result<Vec<u32>, WgslError> {
    let (device, queue) = host;
    let text = recipe.wgsl_with("spectrum", options)?;
    let zero = if options.arithmetic == Arithmetic::Exact { ", host.zero" } else { "" };
    let (bands, [low, high]) = (recipe.model().bands(), [FIRST as u32, (FIRST >> 32) as u32]);
    let text = format!(
        "{text}
struct Host {{ seed: vec2<u32>, stream: u32, zero: u32 }}
@group(1) @binding(0) var<uniform> host: Host;
@group(1) @binding(1) var<storage, read_write> values: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    let low = {low}u + id.x;
    let draw = spectrum_draw_in(host.stream, host.seed, vec2(low, {high}u + select(0u, 1u, low < id.x)){zero});
    let start = id.x * {}u;
    for (var band = 0u; band < {bands}u; band++) {{
        values[start + band] = bitcast<u32>(spectrum_at(draw, band));
    }}
    values[start + {bands}u] = draw.attempts;
}}
",
        bands + 1
    );
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let buffer = |usage, content: &[u8], size: usize| {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: size as u64,
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&buffer, 0, content);
        buffer
    };
    let parameters = [SEED, 0, stream.id(), 0];
    let uniform = buffer(BufferUsages::UNIFORM, bytemuck::cast_slice(&parameters), 16);
    let values =
        buffer(BufferUsages::STORAGE | BufferUsages::COPY_SRC, &[], 4 * COUNT as usize * (bands + 1));
    let tables = recipe.tables();
    let is_bound = matches!(options.tables, Some(TableStorage::Buffer { .. })) && !tables.is_empty();
    let tables = is_bound.then(|| buffer(BufferUsages::STORAGE, &tables, tables.len()));
    let group = |group: u32, entries: &[(u32, &wgpu::Buffer)]| {
        let entries = entries
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(group),
            entries: &entries.collect::<Vec<_>>(),
        })
    };
    let ours = group(1, &[(0, &uniform), (1, &values)]);
    let theirs = tables.as_ref().map(|tables| group(0, &[(3, tables)]));
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(1, &ours, &[]);
        if let Some(theirs) = &theirs {
            pass.set_bind_group(0, theirs, &[]);
        }
        pass.dispatch_workgroups(COUNT / 64, 1, 1);
    }
    Ok(read(host, encoder, &[&values]).remove(0))
}

const BUFFER: TableStorage = TableStorage::Buffer { group: 0, binding: 3 };

#[test]
fn a_host_draws_what_the_cpu_draws() {
    let host = host::device();
    let stream = Stream::named(u64::from(SEED), "walls");
    for (name, recipe) in recipes() {
        let scalar = recipe.scalar_sampler::<f32>();
        let expected: Vec<u32> = (0..u64::from(COUNT))
            .flat_map(|i| {
                let drawn = scalar.draw(stream, FIRST + i);
                let values: Vec<u32> = drawn.spectrum().iter().map(|value| value.to_bits()).collect();
                values.into_iter().chain([drawn.status().attempts()])
            })
            .collect();
        let is_gaussian = *recipe.model().distribution() == Distribution::Gaussian;
        let fits = recipe.keeps_tables_constant();
        if !is_gaussian {
            let constant = ModuleOptions { tables: Some(TableStorage::Const), ..ModuleOptions::default() };
            assert_eq!(recipe.wgsl_with("spectrum", constant), Err(WgslError::ConstantCentres), "{name}");
        }
        for arithmetic in [Arithmetic::Plain, Arithmetic::Exact] {
            // Other adapters may have other bytes in the plain form.
            if arithmetic == Arithmetic::Plain && !gpu_is_software() {
                continue;
            }
            let places = if fits { vec![TableStorage::Const, BUFFER] } else { vec![BUFFER] };
            for tables in places {
                let options = ModuleOptions { arithmetic, tables: Some(tables) };
                let found = drawn(&host, &recipe, options, stream).unwrap_or_else(|e| panic!("{name}: {e}"));
                let differ = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "{name}, {options:?}: of {} values", expected.len());
            }
        }
    }
}

/// A recipe of any kind, with any numbers.
fn any_recipe(rng: &mut StreamRng) -> Option<RecipeBuilder> {
    let grids = ["400:10:700", "400:5:700", "400:1:700", "390:33:720", "450,455,500,640"];
    let grid: Grid = grids[rng.random_range(0..grids.len())].parse().expect("a grid");
    let components = rng.random_range(1..=grid.len().min(6));
    let is_light = rng.random_bool(0.3);
    let name = if is_light { "granada" } else { "munsell-vrhel" };
    let mut builder = Recipe::builder(&Model::builtin_with(name, grid, components).ok()?)
        .covariance_scale([0.01, 1.0, 4.0, 25.0][rng.random_range(0..4)]);
    if is_light {
        builder = match rng.random_range(0..4) {
            0 => builder.intensity(Intensity::Fixed(3.0)),
            1 => builder.intensity(Intensity::LogUniform(1e-3, 1e3)),
            2 => builder.intensity(Intensity::Data),
            _ => builder,
        };
    } else if rng.random_bool(0.7) {
        let bounds = [Bounds::Base, Bounds::Scaled, Bounds::Both][rng.random_range(0..3)];
        let lrv = rng.random_range(0.05..0.9);
        builder = match rng.random_bool(0.5) {
            true => builder.lrv(lrv).bounds(bounds),
            false => builder.lrv(0.5 * lrv..lrv).bounds(bounds),
        };
    }
    let proposals = [ProposalKind::Auto, ProposalKind::Plain, ProposalKind::Cover];
    builder = builder.proposal(proposals[rng.random_range(0..3)]);
    let kind = if is_light { SpectrumKind::Illuminant } else { SpectrumKind::Reflectance };
    let quantities = Quantity::ALL.iter().copied().filter(|q| match q {
        Quantity::Intensity => false,
        Quantity::Lrv => kind == SpectrumKind::Reflectance,
        _ => true,
    });
    let some: Vec<Quantity> = quantities.filter(|_| rng.random_bool(0.5)).collect();
    Some(match some.is_empty() {
        true => builder,
        false => builder.quantities(some),
    })
}

/// Naga takes every text, with no optional feature.
#[test]
fn no_recipe_that_can_be_drawn_is_refused() {
    let mut rng = Stream::named(20, "recipes").rng();
    let mut texts = 0;
    for trial in 0..30 {
        let Some(recipe) = any_recipe(&mut rng).and_then(|builder| builder.build().ok()) else { continue };
        for arithmetic in [Arithmetic::Plain, Arithmetic::Exact] {
            for tables in [None, Some(TableStorage::Const), Some(BUFFER)] {
                let text = match recipe.wgsl_with("any", ModuleOptions { arithmetic, tables }) {
                    Err(WgslError::LargeTable { .. }) if tables == Some(TableStorage::Const) => continue,
                    other => other.unwrap_or_else(|e| panic!("{trial}: {e}")),
                };
                let module = naga::front::wgsl::parse_str(&text)
                    .unwrap_or_else(|e| panic!("{trial}: {}", e.emit_to_string(&text)));
                let flags = naga::valid::ValidationFlags::all();
                let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
                validator
                    .validate(&module)
                    .unwrap_or_else(|e| panic!("{trial}: {}", e.emit_to_string(&text)));
                texts += 1;
            }
        }
    }
    println!("{texts} texts");
    assert!(texts > 50, "{texts} texts");
}
