"""Draws: the bytes of the program's, whatever the quantity, layout and engine, of ranges and of lists of indices."""

import pickle

import numpy as np
import pytest

import spectroll
from spectroll import Sampler

ALL = ["spectra", "weights", "xyz", "linear_srgb", "lrv", "attempts", "chromaticity"]
LIGHTS = ["spectra", "weights", "xyz", "linear_srgb", "attempts", "intensity", "chromaticity"]

# Settings, the program's words for them, and quantities.
CASES = {
    "plain": ("munsell-vrhel", {}, [], ALL),
    "target": ("munsell-vrhel", {"lrv": 0.4, "bounds": "both"}, ["--lrv", 0.4, "--bounds", "both"], ALL),
    "targets": (
        "munsell-vrhel-5nm",
        {"lrv": (0.2, 0.6), "bounds": "scaled", "illuminant": "A"},
        ["--lrv", "0.2..0.6", "--bounds", "scaled", "--illuminant", "a"],
        ALL,
    ),
    "cover": ("munsell-vrhel", {"lrv": 0.98, "bounds": "scaled"}, ["--lrv", 0.98, "--bounds", "scaled"], ALL),
    "base": ("munsell-vrhel", {"lrv": 0.6}, ["--lrv", 0.6], ALL),
    "lights": (
        "granada",
        {"intensity": (0.15, 150), "covariance_scale": 4, "xyz_scale": "unit-y"},
        ["--intensity", "0.15..150", "--cov-scale", 4, "--xyz-scale", "unit-y"],
        LIGHTS,
    ),
    "data": ("granada-5nm", {"intensity": "data", "max_attempts": 99}, ["--intensity", "data", "--max-attempts", 99], LIGHTS),
}
SOME = range(2**32 - 350, 2**32 + 351)


@pytest.mark.parametrize("case", CASES)
def test_draws_are_those_of_the_program(case, engine, program, tmp_path):
    model, settings, words, quantities = CASES[case]
    program(
        "sample", model, "-n", len(SOME), "--start", SOME.start, "--seed", 2**64 - 3, "--stream", "walls",
        "--quantities", ",".join(quantities), "--engine", engine, "-o", "draws.npz", *words,
    )  # fmt: skip
    made = np.load(tmp_path / "draws.npz")
    key = {"seed": 2**64 - 3, "stream": "walls"}
    shuffled = np.random.default_rng(1).permutation(len(SOME))
    for layout in ["rows", "padded-rows", "planes"]:
        sampler = Sampler(model, engine=engine, layout=layout, **settings)
        drawn = sampler.draw(SOME, quantities=quantities, **key)
        listed = sampler.at(shuffled + SOME.start, quantities=quantities, **key)
        assert list(drawn) == list(listed) == quantities
        for name in quantities:
            expected = made[name]
            assert drawn[name].dtype == expected.dtype and drawn[name].shape == expected.shape, name
            assert drawn[name].tobytes() == expected.tobytes(), (name, layout)
            assert listed[name].tobytes() == expected[shuffled].tobytes(), (name, layout)
            # One quantity alone is that of the same draws.
            assert sampler.draw(SOME, quantities=name, **key).tobytes() == expected.tobytes()
        if layout == "planes":
            assert drawn["spectra"].T.strides[1] == 4
        if layout == "padded-rows":
            assert drawn["spectra"].strides[0] % 16 == 0


def test_16_bits_are_those_of_the_program(engine, program, tmp_path):
    program("sample", "munsell-vrhel", "-n", 501, "--dtype", "f16", "--engine", engine, "-o", "half.npy")
    expected = np.load(tmp_path / "half.npy")
    for layout in ["rows", "padded-rows", "planes"]:
        sampler = Sampler(dtype="float16", layout=layout, engine=engine)
        assert sampler.draw(501).dtype == expected.dtype
        assert sampler.draw(501).tobytes() == expected.tobytes()
        assert sampler.at(np.arange(501)[::-1]).tobytes() == expected[::-1].tobytes()


def test_threads_do_not_show():
    expected = Sampler(engine="cpu").draw(5000).tobytes()
    for threads in [1, 2, 7]:
        assert Sampler(engine="cpu", threads=threads).draw(5000).tobytes() == expected


def test_many_draws_are_those_of_few_whatever_the_layout():
    """More than are drawn between two looks for Ctrl-C."""
    count = 2**19 + 2**18 + 3
    expected = Sampler(engine="cpu").draw(range(count - 1001, count))
    for layout in ["rows", "padded-rows", "planes"]:
        sampler = Sampler(engine="cpu", layout=layout)
        drawn = sampler.draw(count)
        assert drawn[-1001:].tobytes() == expected.tobytes(), layout
        assert drawn[:1000].tobytes() == sampler.draw(1000).tobytes(), layout
        assert drawn[2**19 - 2 : 2**19 + 2].tobytes() == sampler.draw(range(2**19 - 2, 2**19 + 2)).tobytes()


def test_indices_reach_to_the_last(engine):
    sampler = Sampler(engine=engine)
    last = 2**64 - 1
    expected = sampler.draw(range(last - 4, last + 1))
    assert sampler.at([last, last - 4])[0].tobytes() == expected[4].tobytes()
    assert sampler.at(np.array([last], np.uint64)).tobytes() == expected[4:].tobytes()
    assert sampler.draw(range(last, last - 5, -1)).tobytes() == expected[::-1].tobytes()
    assert sampler.draw(range(last - 4, last + 1, 2)).tobytes() == expected[::2].tobytes()
    assert len(sampler.draw(range(2**70, 2**70))) == 0


def test_shapes_follow_the_indices():
    sampler = Sampler(engine="cpu")
    rows = sampler.draw(12)
    assert sampler.at(5).shape == (31,)
    assert sampler.at(np.int8(5)).tobytes() == rows[5].tobytes()
    assert sampler.at(np.arange(12).reshape(3, 4)).tobytes() == rows.tobytes()
    assert sampler.at(np.arange(12).reshape(3, 4)).shape == (3, 4, 31)
    assert sampler.at(np.arange(24)[::2]).tobytes() == sampler.draw(range(0, 24, 2)).tobytes()
    assert sampler.at([], quantities="attempts").shape == (0,)
    assert sampler.draw(0).shape == (0, 31)
    assert sampler.at(np.arange(12).reshape(3, 4), quantities="lrv").shape == (3, 4)
    planes = Sampler(engine="cpu", layout="planes")
    assert planes.at(np.arange(12).reshape(3, 4)).tobytes() == rows.tobytes()


def test_out_is_filled_and_returned(engine):
    sampler = Sampler(engine=engine)
    expected = sampler.draw(1000, seed=3)
    out = np.empty((1000, 31), np.float32)
    assert sampler.draw(1000, seed=3, out=out) is out
    assert out.tobytes() == expected.tobytes()
    assert sampler.at(np.arange(1000), seed=3, out=out[::1]).tobytes() == expected.tobytes()
    both = {"attempts": np.zeros(1000, np.uint32), "spectra": np.zeros((1000, 31), np.float32)}
    assert sampler.draw(1000, seed=3, quantities=["spectra", "attempts"], out=both) is both
    assert both["spectra"].tobytes() == expected.tobytes()
    assert both["attempts"].tobytes() == sampler.draw(1000, seed=3, quantities="attempts").tobytes()
    assert both["attempts"].min() >= 1 and both["attempts"].max() < 1000
    # An array that does not begin on a whole word is filled too.
    odd = np.zeros(1000 * 31 * 4 + 1, np.uint8)[1:].view(np.float32).reshape(1000, 31)
    assert sampler.draw(1000, seed=3, out=odd).tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    ("out", "kind"),
    [
        (np.zeros((10, 30), np.float32), ValueError),
        (np.zeros((10, 31)), ValueError),
        (np.zeros((10, 31), ">f4"), ValueError),
        (np.zeros((10, 62), np.float32)[:, ::2], ValueError),
        (np.broadcast_to(np.float32(0), (10, 31)), ValueError),
        ([[0.0] * 31] * 10, TypeError),
    ],
)
def test_what_cannot_be_filled_is_refused(out, kind):
    with pytest.raises(kind, match="out: spectra"):
        Sampler(engine="cpu").draw(10, out=out)


def test_arrays_of_the_callers_are_for_rows():
    with pytest.raises(ValueError, match='layout="planes"'):
        Sampler(engine="cpu", layout="planes").draw(10, out=np.zeros((10, 31), np.float32))
    with pytest.raises(ValueError, match="asked for"):
        Sampler(engine="cpu").draw(3, quantities=["lrv"], out={"spectra": np.zeros((3, 31), np.float32)})


def test_rng_is_that_of_spec_7():
    sampler = Sampler(engine="cpu")
    seven = sampler.sample(20, rng=7)
    assert seven.tobytes() == sampler.sample(20, rng=7).tobytes()
    assert seven.tobytes() == sampler.sample(20, rng=np.random.default_rng(7)).tobytes()
    assert seven.tobytes() == sampler.sample(20, rng=np.random.SeedSequence(7)).tobytes()
    generator = np.random.default_rng(7)
    assert sampler.sample(20, rng=generator).tobytes() == seven.tobytes()
    assert sampler.sample(20, rng=generator).tobytes() != seven.tobytes()
    assert sampler.sample(20).tobytes() != sampler.sample(20).tobytes()
    seed = int(np.random.default_rng(7).integers(2**64 - 1, dtype=np.uint64, endpoint=True))
    assert sampler.draw(20, seed=seed).tobytes() == seven.tobytes()


def test_seeds_and_streams_set_draws_apart():
    sampler = Sampler(engine="cpu")
    draws = [sampler.draw(50, seed=seed, stream=stream) for seed in (0, 1) for stream in (None, "a", "b")]
    assert len({each.tobytes() for each in draws}) == 6


def test_a_tensor_library_takes_the_arrays_as_they_are():
    spectra = Sampler(engine="cpu").draw(5)
    shared = np.from_dlpack(spectra)
    assert np.shares_memory(shared, spectra)


def test_spectra_keep_their_bounds_and_targets():
    sampler = Sampler("munsell-vrhel", lrv=0.4, bounds="both", engine="cpu")
    drawn = sampler.sample(5000, rng=1, quantities=["spectra", "lrv", "xyz"])
    assert 0 < drawn["spectra"].min() and drawn["spectra"].max() < 1
    np.testing.assert_allclose(drawn["lrv"], 0.4, atol=1e-6)
    np.testing.assert_allclose(drawn["xyz"][:, 1], 0.4, atol=1e-6)
    xyz = Sampler(xyz=(0.35, 0.3, 0.2), engine="cpu").draw(100, quantities="xyz")
    np.testing.assert_allclose(xyz, np.tile([0.35, 0.3, 0.2], (100, 1)), atol=1e-6)


def test_an_illuminant_may_be_given_as_powers():
    flat = Sampler(illuminant=np.ones(31), engine="cpu").draw(9, quantities="xyz")
    equal = Sampler(illuminant="E", engine="cpu").draw(9, quantities="xyz")
    np.testing.assert_allclose(flat, equal, rtol=1e-6)


def test_responses_are_sums_with_the_sensors(tmp_path):
    grid = np.arange(400, 701, 10)
    functions = {"R": np.exp(-((grid - 600) / 40) ** 2), "G": np.exp(-((grid - 540) / 40) ** 2)}
    path = tmp_path / "camera.csv"
    rows = [f"{nm},{r!r},{g!r}" for nm, r, g in zip(grid.tolist(), functions["R"].tolist(), functions["G"].tolist())]
    path.write_text("\n".join(["nm,R,G", *rows]))
    powers = np.linspace(1, 2, 31)
    for sensors in (path, str(path), functions):
        sampler = Sampler(sensors=sensors, illuminant=powers, engine="cpu")
        drawn = sampler.draw(500, quantities=["spectra", "responses"])
        weights = powers * np.array(list(functions.values()))
        expected = drawn["spectra"].astype(float) @ (weights / weights.sum(1, keepdims=True)).T
        np.testing.assert_allclose(drawn["responses"], expected, atol=5e-7)
    lights = Sampler("granada", sensors="ss2", engine="cpu")
    assert lights.draw(9, quantities="responses").shape == (9, 3)
    aimed = Sampler(target=("ss2", "L", (0.2, 0.6)), sensors="ss2", illuminant="5600K", engine="cpu")
    assert "5600K" in repr(aimed) and "'L'" in repr(aimed)
    found = aimed.draw(500, quantities="responses")[:, 0]
    assert 0.2 <= found.min() and found.max() <= 0.6 + 1e-6
    labels = aimed.to_xarray(5, quantities=["responses"])["sensor"]
    assert labels.values.tolist() == ["L", "M", "S"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sensors": "ss3"}, 'did you mean "ss2"'),
        ({"sensors": 3}, "it is the name of a set, a file, or a mapping"),
        ({"target": "L"}, "it is three things"),
        ({"target": ("ss2", "K", 0.3)}, "has no channel"),
        ({"target": ("ss2", "L", 3.0)}, "did you mean 0.03"),
        ({"illuminant": "3000K"}, "from 4000 to 25000"),
        ({"observer": "cie1932"}, "did you mean 'cie1931'"),
    ],
)
def test_what_no_sensor_is_says_why(settings, message):
    with pytest.raises((TypeError, ValueError), match=message):
        Sampler(engine="cpu", **settings)


@pytest.mark.parametrize("engine", ["cpu", "gpu"])
def test_metamers_have_their_colours(engine, program, tmp_path):
    sampler = Sampler(spectroll.Model("munsell-vrhel"), engine=engine)
    colours = np.array([[0.30, 0.30, 0.25], [0.20, 0.25, 0.10]])
    spectra = sampler.given(colours, each=20, seed=2)
    assert spectra.shape == (2, 20, 31) and 0 < spectra.min() and spectra.max() < 1
    # What takes spectra of this model to their XYZ, from draws that have both.
    drawn = Sampler(engine="cpu").draw(100, quantities=["spectra", "xyz"])
    weights = np.linalg.lstsq(drawn["spectra"].astype(float), drawn["xyz"].astype(float), rcond=1e-6)[0]
    assert np.abs(spectra @ weights - colours[:, None]).max() < 1e-5
    (tmp_path / "c.csv").write_text("\n".join(",".join(map(str, colour)) for colour in colours))
    program("metamers", "c.csv", "-k", 6, "--per-colour", 20, "--seed", 2, "--engine", "cpu", "-o", "c.npz")
    assert (np.load(tmp_path / "c.npz")["spectra"] == spectra).all()
    np.testing.assert_array_equal(sampler.given(colours[1:])[0].shape, (31,))
    details = sampler.given([[1, 1, 1], [0.3, 0.3, 0.25]], nearest=True, details=True)
    assert details["status"].tolist() == [3, 1] and details["distance"][1] == 0
    far = np.abs(details["spectra"][0] @ weights - 1) / [0.9505, 1, 1.0888]
    np.testing.assert_allclose(far.max(), details["distance"][0], rtol=1e-2)
    mode = sampler.given(colours, each=0)
    assert mode.shape == (2, 31) and (mode == sampler.given(colours, each=0, seed=9)).all()
    cones = Sampler(sensors="ss2", engine=engine).given([[0.3, 0.3, 0.2]], space="responses")
    assert cones.shape == (1, 31)
    for settings, message in [
        ({"space": "rgb"}, "space='rgb'"),
        ({"space": "responses"}, "needs a sampler with sensors"),
        ({"hard": "eror"}, "did you mean 'error'"),
    ]:
        with pytest.raises(ValueError, match=message):
            sampler.given(colours, **settings)
    with pytest.raises(ValueError, match="the last axis has 3 values"):
        sampler.given([[1, 2]])
    with pytest.raises(ValueError, match="no spectrum of this model has"):
        sampler.given([[1, 1, 1]], hard="error")


def test_threads_of_python_draw_at_the_same_time():
    from concurrent.futures import ThreadPoolExecutor

    for threads in (1, None):
        sampler = Sampler(engine="cpu", threads=threads)
        expected = [sampler.draw(2000, seed=seed).tobytes() for seed in range(16)]
        with ThreadPoolExecutor(8) as pool:
            found = list(pool.map(lambda seed: sampler.draw(2000, seed=seed).tobytes(), range(16)))
        assert found == expected


def test_the_module_says_what_it_has():
    assert set(spectroll.__all__) <= set(dir(spectroll))
    assert all(getattr(spectroll, name) is not None for name in spectroll.__all__)
    with pytest.raises(AttributeError, match="no attribute 'Smpler'"):
        spectroll.Smpler  # noqa: B018


# Arithmetic


def test_every_arithmetic_of_an_adapter_has_the_bytes_of_the_cpu():
    expected = Sampler(lrv=0.4, bounds="scaled", engine="cpu").draw(5000, seed=3)
    for arithmetic in ("auto", "exact"):
        sampler = Sampler(lrv=0.4, bounds="scaled", engine="gpu", arithmetic=arithmetic)
        assert sampler.draw(5000, seed=3).tobytes() == expected.tobytes(), arithmetic
        assert pickle.loads(pickle.dumps(sampler)) == sampler
    assert "arithmetic='exact'" in repr(sampler)
    with pytest.raises(ValueError, match="arithmetic='fast'"):
        Sampler(arithmetic="fast")


def test_shader_text_comes_in_both_forms_with_its_tables():
    plain = Sampler()
    assert "fn wall_draw(seed: vec2<u32>, index: vec2<u32>) -> wall_Draw" in plain.wgsl("wall")
    assert "index: vec2<u32>, zero: u32) -> wall_Draw" in plain.wgsl("wall", arithmetic="exact")
    assert plain.wgsl_tables() == b""
    covered = Sampler(lrv=0.99, bounds="scaled")
    assert "var<storage, read> draw_tables" in covered.wgsl()
    assert len(covered.wgsl_tables()) > 4 * 2047 and len(covered.wgsl_tables()) % 4 == 0
