//! Draws of lists of indices, and draws in the caller's arrays: the bytes of the same draws in ranges, on every engine.

mod engines;

use std::sync::OnceLock;

use engines::{cpu, gpu, lights, surfaces};
use spectroll::{
    ArrayFormat, Bounds, Draws, Dtype, Engine, EngineChoice, EngineError, Intensity, Layout, Quantity,
    Recipe, Session, Stream,
};

/// Recipes of every layout and dtype, with every quantity; one whose draws take several dispatches on some adapters, and
/// one from a cover.
fn recipes() -> &'static [Recipe] {
    static RECIPES: OnceLock<Vec<Recipe>> = OnceLock::new();
    RECIPES.get_or_init(make_recipes)
}

fn make_recipes() -> Vec<Recipe> {
    let but = |quantity| Quantity::ALL.iter().copied().filter(move |other| *other != quantity);
    let mut recipes = Vec::new();
    for layout in [Layout::Rows, Layout::PaddedRows, Layout::Planes] {
        for dtype in [Dtype::F32, Dtype::F16] {
            let surfaces = surfaces().lrv(0.2..0.6).bounds(Bounds::Both).quantities(but(Quantity::Intensity));
            let lights =
                lights().intensity(Intensity::LogUniform(0.15, 150.0)).quantities(but(Quantity::Lrv));
            for builder in [surfaces, lights] {
                recipes.push(builder.layout(layout).spectra_dtype(dtype).build().unwrap());
            }
        }
    }
    recipes.push(surfaces().covariance_scale(25.0).max_attempts(1 << 18).build().unwrap());
    recipes.push(surfaces().lrv(0.98).bounds(Bounds::Scaled).build().unwrap());
    recipes
}

/// The values of some draws, draw by draw: the bytes of each quantity.
fn drawn<'d>(session: &mut Session, draws: impl Into<Draws<'d>>) -> Vec<Vec<Vec<u8>>> {
    let mut rows = Vec::new();
    session
        .draw(draws, |batch| {
            let arrays = batch.formats().iter().map(|format| (*format, batch.bytes(format.quantity)));
            let arrays: Vec<_> = arrays.collect();
            let count = batch.draws.count;
            rows.extend((0..count).map(|n| -> Vec<Vec<u8>> {
                arrays.iter().map(|(format, bytes)| of_draw(format, bytes, n as usize, count)).collect()
            }));
            Ok::<_, EngineError>(())
        })
        .unwrap();
    rows
}

/// The bytes of draw `number` in an array of `count` draws.
fn of_draw(format: &ArrayFormat, bytes: &[u8], number: usize, count: u64) -> Vec<u8> {
    let size = format.dtype.size();
    let at = |value: usize| match format.layout {
        Layout::Planes => value * count.next_multiple_of(4) as usize + number,
        _ => number * format.stride() + value,
    };
    (0..format.width).flat_map(|value| &bytes[size * at(value)..][..size]).copied().collect()
}

/// Indices near the ends and the middle of all that there are, some of them twice, in no order.
fn indices() -> Vec<u64> {
    let scattered = (0..300).map(|i: u64| i.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    [5, 3, 3, 0, u64::MAX, 1 << 32, (1 << 32) - 1].into_iter().chain(scattered).collect()
}

#[test]
fn lists_have_the_draws_of_ranges() {
    let stream = Stream::named(7, "lists");
    for engine in
        [cpu(), gpu(), &Engine::with_threads(&EngineChoice::Cpu, Some(1.try_into().unwrap())).unwrap()]
    {
        for recipe in recipes() {
            let mut session = engine.session(recipe).unwrap();
            let range = drawn(&mut session, stream.draws((1 << 32) - 300..(1 << 32) + 300));
            let shuffled: Vec<u64> = (0..600).map(|i| (i * 137) % 600).collect();
            let list: Vec<u64> = shuffled.iter().map(|i| (1 << 32) - 300 + i).collect();
            let found = drawn(&mut session, stream.at(&list));
            assert!(shuffled.iter().zip(&found).all(|(&i, draw)| *draw == range[i as usize]), "{engine}");
            let scattered = drawn(&mut session, stream.at(&indices()));
            for (&index, draw) in indices().iter().zip(&scattered).take(9) {
                assert_eq!(drawn(&mut session, stream.draws(index..=index)), std::slice::from_ref(draw));
            }
            assert_eq!(drawn(&mut session, stream.at(&[])), Vec::<Vec<Vec<u8>>>::new());
        }
    }
}

#[test]
fn engines_agree_on_lists() {
    let stream = Stream::new(3);
    for recipe in recipes() {
        let of = |engine: &Engine| drawn(&mut engine.session(recipe).unwrap(), stream.at(&indices()));
        let ours = of(cpu());
        assert!(engines::forms().iter().all(|engine| ours == of(engine)) || !engines::gpu_is_software());
    }
}

#[test]
fn rows_of_a_stream_are_in_lists_too() {
    let recipe = surfaces().build().unwrap();
    let stream = Stream::new(5).in_rows(7);
    for engine in [cpu(), gpu()] {
        let mut session = engine.session(&recipe).unwrap();
        let range = drawn(&mut session, stream.draws(0..100));
        let list: Vec<u64> = (0..100).rev().collect();
        assert!(drawn(&mut session, stream.at(&list)).into_iter().rev().eq(range));
    }
}

#[test]
fn the_callers_arrays_hold_what_windows_do() {
    let stream = Stream::new(9);
    for engine in [cpu(), gpu()] {
        for recipe in recipes() {
            for count in [0, 1, 63, 130] {
                let list: Vec<u64> = (0..count).map(|i| i * 977).collect();
                let mut session = engine.session(recipe).unwrap();
                for draws in [stream.draws(11..11 + count).into(), stream.at(&list)] {
                    let formats = recipe.formats();
                    // One byte more before each array: what is not aligned is copied.
                    for unaligned in [0, 1] {
                        let size = |f: &ArrayFormat| f.bytes(count) as usize;
                        let words = |f: &ArrayFormat| vec![0u32; size(f).div_ceil(4) + 1];
                        let mut arrays: Vec<_> = formats.iter().map(words).collect();
                        let mut slices: Vec<&mut [u8]> = Vec::new();
                        for (words, format) in arrays.iter_mut().zip(&formats) {
                            let bytes: &mut [u8] = bytemuck::cast_slice_mut(words);
                            slices.push(&mut bytes[unaligned..][..size(format)]);
                        }
                        let summary = session.fill_arrays(draws, &mut slices).unwrap();
                        assert_eq!(summary.draws, count);
                        let expected = drawn(&mut session, draws);
                        for (n, expected) in expected.iter().enumerate() {
                            let own = formats.iter().zip(&slices);
                            let own: Vec<_> = own.map(|(f, bytes)| of_draw(f, bytes, n, count)).collect();
                            // The engine adds the status where the recipe does not ask for it.
                            assert!(own.iter().all(|values| expected.contains(values)), "{engine} {count}");
                        }
                    }
                }
            }
        }
    }
}
