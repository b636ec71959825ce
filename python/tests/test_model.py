"""Models and measured spectra."""

import pickle

import numpy as np
import pytest

import spectroll
from spectroll import Model, Sampler, Spectra

CSV = """wavelength,leaf,brick,sand,bark,moss
400,0.10,0.20,0.31,0.08,0.42
450,0.12,0.25,0.30,0.09,0.41
500,0.20,0.31,0.28,0.11,0.45
550,0.33,0.33,0.24,0.18,0.51
600,0.41,0.30,0.22,0.35,0.55
650,0.44,0.27,0.25,0.46,0.58
700,0.45,0.29,0.30,0.50,0.60
"""


@pytest.fixture
def csv(tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text(CSV)
    return path


def test_a_built_in_model_has_its_parts():
    model = Model("munsell-vrhel")
    assert (model.kind, model.components, model.bands, model.name) == ("reflectance", 6, 31, "munsell-vrhel")
    assert model.wavelengths.tolist() == list(range(400, 701, 10))
    assert model.mean.shape == (31,) and model.basis.shape == (6, 31)
    assert model.weight_mean.shape == (6,) and model.weight_covariance.shape == (6, 6)
    np.testing.assert_allclose(model.basis @ model.basis.T, np.eye(6), atol=1e-9)
    assert 0.9975 < model.explained_variance.sum() < 0.9977
    weights = model.project(model.mean)
    np.testing.assert_allclose(weights, 0, atol=1e-12)
    np.testing.assert_allclose(model.reconstruct(np.zeros((2, 6))), [model.mean] * 2)
    assert "munsell-vrhel" in spectroll.models()
    assert Model("granada", wavelengths="380:5:780").bands == 81
    assert Model("granada", wavelengths=np.arange(380, 781, 5)) == Model("granada", "380:5:780")


def test_models_are_immutable_and_values():
    model = Model()
    with pytest.raises(AttributeError, match="immutable"):
        model.mean = 3
    with pytest.raises(ValueError, match="read-only"):
        model.mean[0] = 3
    other = pickle.loads(pickle.dumps(model))
    assert other == model and hash(other) == hash(model) and other.name == model.name
    assert other.to_json() == model.to_json() and Model.from_json(model.to_json()) == model
    assert model != Model("granada") and model != 3


def test_a_fit_is_that_of_the_program(csv, program, tmp_path):
    program("fit", csv, "--kind", "reflectance", "-k", 2, "--wavelengths", "400:50:700", "-o", "mine.json")
    read = spectroll.read(csv)
    assert read.shape == (5, 7) and len(read) == 5 and read.kind is None
    expected = Model(tmp_path / "mine.json")
    for model in [
        Model.fit(read, kind="reflectance", components=2),
        Model.fit(np.asarray(read), read.wavelengths, kind="reflectance", components=2),
        Model.fit(read.values.tolist(), "400:50:700", kind="reflectance", components=2),
    ]:
        assert model.sources == expected.sources or model.sources == ["X (5 spectra)"]
        np.testing.assert_array_equal(model.basis, expected.basis)
        np.testing.assert_array_equal(model.weight_covariance, expected.weight_covariance)
    model.save(tmp_path / "own.json")
    with pytest.raises(FileExistsError, match="overwrite=True"):
        model.save(tmp_path / "own.json")
    model.save(tmp_path / "own.json", overwrite=True)
    assert Model(tmp_path / "own.json") == model
    assert Sampler(tmp_path / "own.json", engine="cpu").draw(3).shape == (3, 7)


def test_fits_take_their_settings(csv):
    read = spectroll.read(csv)
    fine = Model.fit(read, kind="reflectance", components=2, at="400:10:700")
    assert fine.bands == 31
    assert Model.fit(read, kind="reflectance", components=0.9).components < 3
    lights = Model.fit(read, kind="illuminant", components=1, normalize="none")
    assert lights.kind == "illuminant" and lights != Model.fit(read, kind="illuminant", components=1)
    held = Model.fit(read, kind="reflectance", components=2, at="390:10:710", extrapolate="hold")
    assert held.bands == 33
    two = Model.fit([read, Spectra(read.values, read.wavelengths)], kind="reflectance", components=2)
    np.testing.assert_allclose(two.mean, Model.fit(read, kind="reflectance", components=2).mean)
    assert len(two.sources) == 2


def test_draws_are_as_varied_as_the_data():
    gaussian, kernel = Model("munsell-vrhel"), Model("munsell-vrhel-kernel")
    assert (gaussian.distribution, gaussian.bandwidth, kernel.distribution) == ("gaussian", None, "kernel")
    measured = gaussian.project(np.concatenate([spectroll.read(name).at("400:10:700").values for name in ("munsell", "vrhel")]))
    drawn = [model.project(Sampler(model, engine="cpu").draw(20_000)) for model in (gaussian, kernel)]
    shifts = [abs(weights[:, 0].mean() - measured[:, 0].mean()) / measured[:, 0].std() for weights in drawn]
    assert shifts[0] > 0.3 and shifts[1] < 0.12
    assert pickle.loads(pickle.dumps(kernel)) == kernel


def test_distributions_have_settings_of_their_own(csv):
    read = spectroll.read(csv)

    def fit(**settings):
        return Model.fit(read, kind="reflectance", components=2, **settings)

    assert fit(distribution="kernel", bandwidth=0.5).bandwidth == 0.5
    assert 0 < fit(distribution="kernel").bandwidth <= 1
    assert fit(distribution="mixture", mixture_components=2).distribution == "mixture"
    for settings, said in [
        ({"bandwidth": 0.5}, 'belongs to distribution="kernel"'),
        ({"distribution": "kernel", "mixture_components": 2}, 'belongs to distribution="mixture"'),
        ({"distribution": "kernal"}, 'did you mean "kernel"'),
    ]:
        with pytest.raises(ValueError, match=said):
            fit(**settings)
    with pytest.raises(ValueError, match="a bandwidth of 2"):
        fit(distribution="kernel", bandwidth=2.0)


def test_files_are_read_with_the_settings_of_the_program(tmp_path):
    grid = np.arange(400, 701, 50)
    values = np.random.default_rng(3).uniform(0.2, 0.8, (5, 7)).round(3)
    rows = ["\t".join(["id", *(f"{w / 1000:.2f}" for w in grid)])]
    rows += ["\t".join([f"s{i}", *(f"{100 * v:.1f}" for v in row)]) for i, row in enumerate(values)]
    text = "measured by nobody\n" + "\n".join(rows).replace(".", ",") + "\n"
    path = tmp_path / "um.txt"
    path.write_text(text)
    with pytest.raises(spectroll.DataError, match=r'unit="um"'):
        spectroll.read(path)
    settings = {"unit": "um", "scale": 0.01, "layout": "rows", "separator": "\t", "decimal": ",", "skip": 1}
    read = spectroll.read(path, **settings)
    np.testing.assert_allclose(read, values, atol=1e-9)
    np.testing.assert_allclose(read.wavelengths, grid)
    assert any("skipped the first 1 line" in note for note in read.notes)

    values[1, 2] = -999
    path = tmp_path / "marked.csv"
    np.savetxt(path, np.column_stack([grid, values.T]), delimiter=";")
    with pytest.raises(spectroll.DataError, match=r"missing_values=\[-999\]"):
        Model.fit(spectroll.read(path), kind="reflectance", components=2)
    marked = spectroll.read(path, missing_values=-999)
    assert np.isnan(marked.values[1, 2]) and np.isnan(marked).sum() == 1
    with pytest.raises(spectroll.DataError, match="missing="):
        Model.fit(marked, kind="reflectance", components=2)
    dropped = Model.fit(marked, kind="reflectance", components=2, missing="drop")
    whole = Model.fit(np.delete(values, 1, 0), grid, kind="reflectance", components=2)
    np.testing.assert_array_equal(dropped.basis, whole.basis)
    filled = marked.at("400:50:700", missing="interpolate")
    assert 0 < filled.values[1, 2] < 1 and "filled" in filled.notes[-1]


def test_tables_are_built_in():
    assert {"munsell", "macbeth", "houser"} <= set(spectroll.tables())
    lamps = spectroll.read("houser")
    assert lamps.kind == "illuminant" and len(lamps) > 300
    coarse = Model.fit(lamps, components=4, at="400:20:700")
    assert coarse != Model.fit(lamps, components=4, at="400:20:700", resample="interpolate")


def test_models_have_uneven_wavelengths():
    bands = [443.0, 490.0, 560.0, 665.0]
    model = Model.fit(spectroll.read("munsell"), kind="reflectance", components=2, at=bands)
    sampler = Sampler(model, lrv=0.3, bounds="both", engine="cpu")
    assert sampler.wavelengths.tolist() == bands == model.wavelengths.tolist()
    drawn = sampler.draw(1000, seed=3, quantities=["spectra", "lrv"])
    assert drawn["spectra"].shape == (1000, 4) and drawn["spectra"].min() > 0 and drawn["spectra"].max() < 1
    again = Model.from_json(model.to_json())
    assert Sampler(again, lrv=0.3, bounds="both", engine="cpu").draw(9, seed=3).tobytes() == drawn["spectra"][:9].tobytes()
    assert Model.fit(spectroll.read("munsell"), kind="reflectance", components=2, at="as-measured").bands > 31


def test_spectra_are_arrays(csv, tmp_path):
    read = spectroll.read(csv)
    assert np.mean(read, axis=0).shape == (7,) and read[1].tolist() == read.values[1].tolist()
    assert [len(each) for each in read] == [7] * 5
    again = pickle.loads(pickle.dumps(read))
    assert again.values.tobytes() == read.values.tobytes() and again.name == read.name
    finer = read.at("400:25:700")
    np.testing.assert_array_equal(finer.values[:, ::2], read.values)
    np.save(tmp_path / "rows.npy", read.values)
    rows = spectroll.read(tmp_path / "rows.npy", wavelengths=read.wavelengths)
    np.testing.assert_array_equal(rows, read)
    assert "5 spectra" in repr(read)


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (lambda p: Model("munsel-vrhel"), ValueError, "did you mean \"munsell-vrhel\""),
        (lambda p: Model("models/none.json"), FileNotFoundError, "models/none.json"),
        (lambda p: spectroll.read(p / "none.csv"), FileNotFoundError, "none.csv"),
        (lambda p: spectroll.read(p / "bad.csv"), spectroll.DataError, "bad.csv"),
        (lambda p: Model(p / "bad.json"), spectroll.DataError, "bad.json"),
        (lambda p: Model(p / "mine.csv"), spectroll.DataError, "Model.fit"),
        (lambda p: Model("granada", "100:10:200"), ValueError, "300 to 1100 nm"),
        (lambda p: Model("granada", "400:7:700"), ValueError, "whole number of steps"),
        (lambda p: Model.fit(np.ones((3, 4)), [400, 410, 420, 430], kind="reflectance"), ValueError, "at least 7 spectra"),
        (lambda p: Model.fit(np.ones((3, 4)), [400, 410], kind="reflectance"), ValueError, "3 x 4"),
        (lambda p: Model.fit(np.ones((3, 4)), kind="reflectance"), TypeError, "wavelengths"),
        (lambda p: Model.fit(np.ones((3, 4)), [1, 2, 3, 4]), TypeError, "kind"),
        (lambda p: Model.fit(np.ones((3, 4)), [1, 2, 3, 4], kind="reflectanse"), ValueError, "did you mean"),
        (
            lambda p: Model.fit(np.full((9, 4), np.nan), [400, 410, 420, 430], kind="reflectance"),
            spectroll.DataError,
            "spectrum 1 of X",
        ),
    ],
)
def test_errors_have_their_kind_and_the_librarys_message(call, kind, message, csv):
    (csv.parent / "bad.csv").write_text("wavelength,a\n400,x\n")
    (csv.parent / "bad.json").write_text("{}")
    with pytest.raises(kind, match=message):
        call(csv.parent)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"lrv": 40}, "did you mean 0.4"),
        ({"lrv": 0.9999}, "the largest is 0.9959"),
        ({"lrv": float("nan")}, "finite"),
        ({"lrv": (0.6, 0.2)}, "first must be below the second"),
        ({"lrv": (0.1, 0.2, 0.3)}, "two between"),
        ({"lrv": 0.4, "bounds": "bot"}, "did you mean 'both'"),
        ({"bounds": "both"}, "needs a target"),
        ({"intensity": 3}, "belongs to illuminants"),
        ({"covariance_scale": 1e6, "proposal": "plain"}, "none of 65536"),
        ({"max_attempts": 0}, "at least 1 attempt"),
        ({"illuminant": "D66"}, "no illuminant: there are d65, d50"),
        ({"illuminant": [1.0, 2.0]}, "2 values where the model has 31"),
        ({"xyz": (0.1, 0.2)}, "three values"),
        ({"dtype": "float64"}, "one of 'float32', 'float16'"),
        ({"layout": "columns"}, "one of 'rows'"),
        ({"threads": 0}, "from 1 to"),
    ],
)
def test_what_cannot_be_drawn_is_refused_at_once(settings, message):
    with pytest.raises(ValueError, match=message):
        Sampler("munsell-vrhel", **settings)


def test_an_adapter_that_is_not_there_is_named():
    with pytest.raises(spectroll.EngineError, match='no adapter "none such"'):
        Sampler(engine="none such").draw(1)


@pytest.mark.parametrize(
    ("call", "kind"),
    [
        (lambda s: s.draw(-1), ValueError),
        (lambda s: s.draw(range(-5, 5)), ValueError),
        (lambda s: s.draw(range(2**64 - 1, 2**64 + 1)), ValueError),
        (lambda s: s.draw(2.5), TypeError),
        (lambda s: s.draw(3, seed=-1), ValueError),
        (lambda s: s.draw(3, seed=2**64), ValueError),
        (lambda s: s.draw(3, seed="x"), TypeError),
        (lambda s: s.draw(3, stream=3), TypeError),
        (lambda s: s.at([-1]), IndexError),
        (lambda s: s.at([0.5]), TypeError),
        (lambda s: s.draw(3, quantities="spectrum"), ValueError),
        (lambda s: s.draw(3, quantities=["lrv", "lrv"]), ValueError),
        (lambda s: s.draw(3, quantities=[]), ValueError),
        (lambda s: s.draw(3, quantities="intensity"), ValueError),
        (lambda s: s.sample(-1), ValueError),
        (lambda s: s.wgsl("1a"), ValueError),
    ],
)
def test_arguments_that_make_no_sense_are_refused(call, kind):
    with pytest.raises(kind):
        call(Sampler(engine="cpu"))


def test_samplers_are_immutable_and_values():
    sampler = Sampler(lrv=(0.2, 0.6), bounds="both", engine="cpu", threads=1, dtype="float16", layout="planes")
    with pytest.raises(AttributeError, match="immutable"):
        sampler.lrv = 0.3
    other = pickle.loads(pickle.dumps(sampler))
    assert other == sampler and hash(other) == hash(sampler) and repr(other) == repr(sampler)
    assert other.draw(50).tobytes() == sampler.draw(50).tobytes()
    assert sampler.with_threads(3) != sampler and sampler.with_threads(3).threads == 3
    assert sampler.settings["lrv"] == {"uniform": [0.2, 0.6]}
    assert repr(sampler).startswith("<Sampler 'munsell-vrhel', lrv=(0.2, 0.6), bounds='both'")
    assert sampler.model.name == "munsell-vrhel" and sampler.dtype == np.float16
    assert sampler.engine == "CPU (1 thread)" and 0.5 < sampler.acceptance < 0.8


def test_shaders_are_those_of_the_program(program):
    text = program("shader", "granada", "--quantities", "linear_srgb", "--prefix", "sun")
    assert Sampler("granada").wgsl("sun", quantities="linear_srgb").strip() in text


def test_pictures_are_svg_with_as_many_curves_as_they_show():
    from xml.etree import ElementTree

    for thing, panels in [(Model(), 3), (Model("granada"), 3), (Sampler(lrv=0.4, engine="cpu"), 1)]:
        root = ElementTree.fromstring(thing._repr_svg_())
        lines = root.findall("{http://www.w3.org/2000/svg}polyline")
        assert len(lines) == (60 if panels == 1 else 60 + 1 + 6)
        assert root.attrib["width"] == str(300 * panels)
        colours = {line.attrib["stroke"] for line in lines[-60:]}
        assert len(colours) > 50
        assert "<table>" in thing._repr_html_() and thing._repr_svg_() in thing._repr_html_()
