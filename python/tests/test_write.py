"""Data sets and scenes: the files of the program's, progress, Ctrl-C and resuming."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import spectroll
from spectroll import Sampler, Scene, write


def tree(path):
    """The bytes of a file, or of each file below a folder, but for what says who wrote it."""
    path = Path(path)
    if path.is_file():
        return path.read_bytes()
    files = sorted(p for p in path.rglob("*") if p.is_file())
    return {str(p.relative_to(path)): p.read_bytes() for p in files}


SAMPLER = {"lrv": (0.2, 0.6), "bounds": "both", "engine": "cpu"}
WORDS = ["--lrv", "0.2..0.6", "--bounds", "both", "--engine", "cpu", "--seed", "3", "--stream", "s", "--start", "7"]


@pytest.mark.parametrize(
    ("name", "words", "arguments"),
    [
        ("a.npy", [], {}),
        ("a.npz", ["--quantities", "spectra,lrv,attempts"], {"quantities": ["spectra", "lrv", "attempts"]}),
        ("a.csv", [], {}),
        ("a.h5", ["--dtype", "f64"], {"dtype": "float64"}),
        ("a.mat", [], {}),
        ("a.parquet", ["--quantities", "spectra,xyz"], {"quantities": ["spectra", "xyz"]}),
        ("a.zarr", ["--chunk", "300", "--dtype", "f16"], {"chunk": 300, "dtype": "float16"}),
        ("b.zarr", ["--zstd"], {"zstd": True}),
        ("parts/", ["--format", "npy", "--chunk", "400"], {"format": "npy", "chunk": 400}),
        ("spd/", ["--format", "spd"], {"format": "spd"}),
        ("a.dat", ["--format", "csv", "--sidecar"], {"format": "csv", "sidecar": True}),
    ],
)
def test_data_sets_are_those_of_the_program(name, words, arguments, program, tmp_path):
    count = 50 if name == "spd/" else 1000
    (tmp_path / "own").mkdir()
    program("sample", "munsell-vrhel", "-n", count, *WORDS, *words, "-o", name)
    path = str(tmp_path / "own" / name) + ("/" if name.endswith("/") else "")
    written = write(path, Sampler(**SAMPLER), range(7, 7 + count), seed=3, stream="s", **arguments)
    assert written.draws == count and written.complete and written.attempts >= count
    assert tree(tmp_path / "own" / name) == tree(tmp_path / name)
    if name == "a.dat":
        assert tree(tmp_path / "own/a.dat.spectroll.json") == tree(tmp_path / "a.dat.spectroll.json")
    if name == "a.zarr":
        program("verify", path)


def test_shards_make_one_set(tmp_path, program):
    sampler = Sampler(engine="cpu")
    for part in range(3):
        written = write(tmp_path / "shared.zarr", sampler, 1000, chunk=100, shard=(part, 3))
        assert written.complete == (part == 2)
    write(tmp_path / "whole.zarr", sampler, 1000, chunk=100)
    assert tree(tmp_path / "shared.zarr") == tree(tmp_path / "whole.zarr")
    write(tmp_path / "text.zarr", sampler, 1000, chunk=100, shard="1/2")
    with pytest.raises(FileExistsError, match="resume=True"):
        write(tmp_path / "text.zarr", sampler, 1000, chunk=100)


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ({"path": "x.xlsx"}, ValueError, r"\.npy, \.npz"),
        ({"path": "none/such.npy"}, FileNotFoundError, "create it first"),
        ({"path": "there.npy"}, FileExistsError, "overwrite=True"),
        ({"path": "x.npy", "quantities": ["spectra", "lrv"]}, ValueError, "quantities="),
        ({"path": "x.npy", "chunk": 10}, ValueError, "chunk="),
        ({"path": "x.npy", "resume": True}, ValueError, "resume="),
        ({"path": "x.csv", "zstd": 3}, ValueError, "zstd="),
        ({"path": "x.zarr", "zstd": 99}, ValueError, "from 1 to 22"),
        ({"path": "x.zarr", "resume": True, "overwrite": True}, ValueError, "resume=True goes on"),
        ({"path": "x.zarr", "sidecar": True}, ValueError, "sidecar=True"),
        ({"path": "x.zarr", "shard": (2, 2)}, ValueError, "counted from 0"),
        ({"path": "x.zarr", "shard": "0/2"}, ValueError, "1/N"),
        ({"path": "x.npy", "format": "numpy"}, ValueError, "one of"),
        ({"path": "x.npy", "n": range(0, 10, 2)}, ValueError, "without gaps"),
        ({"path": "x.npy", "n": None}, TypeError, "how many"),
        ({"path": "x.npy", "n": 10**15}, OSError, "free here"),
    ],
)
def test_what_cannot_be_written_is_refused(arguments, kind, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("there.npy").touch()
    arguments = {"source": Sampler(engine="cpu"), "n": 10, **arguments}
    with pytest.raises(kind, match=message):
        write(**arguments)
    assert sorted(os.listdir()) == ["there.npy"]


def test_overwriting_replaces(tmp_path):
    sampler = Sampler(engine="cpu")
    write(tmp_path / "a.npy", sampler, 10)
    write(tmp_path / "a.npy", sampler, 20, overwrite=True)
    assert np.load(tmp_path / "a.npy").shape == (20, 31)


def test_progress_is_told_and_may_end_it(tmp_path):
    sampler, told = Sampler(engine="cpu"), []
    write(tmp_path / "a.zarr", sampler, 10_000, chunk=1000, progress=lambda done, all: told.append((done, all)))
    assert told[-1] == (10_000, 10_000) and told == sorted(told)

    def stop(done, all):
        if done > 0:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        write(tmp_path / "b.npy", sampler, 10_000, progress=stop)
    assert not (tmp_path / "b.npy").exists()


def test_progress_shows_a_bar(tmp_path, capfd):
    pytest.importorskip("tqdm")
    write(tmp_path / "a.npy", Sampler(engine="cpu"), 10_000, progress=True)
    assert "a.npy: 100%" in capfd.readouterr().err
    write(tmp_path / "b.npy", Sampler(engine="cpu"), 10_000)
    assert capfd.readouterr().err == ""


def interrupt(after):
    """Presses Ctrl-C in a while."""
    timer = threading.Timer(after, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


def test_ctrl_c_ends_long_draws():
    sampler = Sampler(engine="cpu")
    out = np.empty((2_000_000, 31), np.float32)
    timer, start = interrupt(0.1), time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(10_000):
            sampler.draw(len(out), out=out)
    timer.join()
    assert time.monotonic() - start < 30
    assert sampler.draw(10).shape == (10, 31)


def test_ctrl_c_leaves_a_set_that_is_resumed(tmp_path):
    sampler = Sampler(engine="cpu")
    path = tmp_path / "a.zarr"
    raised = []

    def press(done, all):
        if done > 300_000 and not raised:
            raised.append(done)
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt, match="resume=True to go on"):
        write(path, sampler, 2_000_000, chunk=50_000, progress=press)
    assert not path.exists() and (tmp_path / "a.zarr.partial").is_dir()
    written = write(path, sampler, 2_000_000, chunk=50_000, resume=True)
    assert written.complete and 0 < written.draws < 2_000_000
    with pytest.raises(KeyboardInterrupt, match="nothing was left behind"):
        raised.clear()
        write(tmp_path / "b.npy", sampler, 2_000_000, progress=press)
    assert os.listdir(tmp_path) == ["a.zarr"]


def test_the_program_ends_on_ctrl_c(tmp_path):
    words = [sys.executable, "-m", "spectroll", "sample", "munsell-vrhel", "-n", "1e9", "-o", "x.zarr", "--engine", "cpu"]
    words.append("--force-space")
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as running:
        deadline = time.monotonic() + 60
        while not (tmp_path / "x.zarr.partial").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.3)
        running.send_signal(signal.SIGINT)
        told = running.communicate(timeout=60)[1]
    assert running.returncode == 130 and "interrupted" in told


def test_scenes_are_those_of_the_program(program, tmp_path, engine):
    program("scene", "--example", "condition3", "--scenes", "2..5", "--engine", engine, "-o", "s.npz")
    made = np.load(tmp_path / "s.npz")
    scene = Scene("condition3", engine=engine)
    drawn = scene.scenes(2, 5)
    for name, array in drawn.items():
        assert array.tobytes() == made[name].tobytes() and array.shape == made[name].shape, name
    assert set(drawn) == {array.name for array in scene.arrays} and scene.groups
    assert scene.wavelengths.shape == drawn[scene.groups[0]].shape[-1:]
    (tmp_path / "own").mkdir()
    write(tmp_path / "own/s.npz", scene, range(2, 5))
    assert tree(tmp_path / "own/s.npz") == tree(tmp_path / "s.npz")


def test_scenes_of_a_file(tmp_path, program):
    (tmp_path / "mine.toml").write_text(Scene("condition1").text)
    scene = Scene(tmp_path / "mine.toml", seed=9, engine="cpu")
    assert scene.seed == 9 and len(scene) == len(Scene("condition1"))
    program("scene", "mine.toml", "--seed", 9, "--scenes", "0..2", "--engine", "cpu", "-o", "s.npz")
    assert all(np.load(tmp_path / "s.npz")[k].tobytes() == v.tobytes() for k, v in scene.scenes(2).items())
    import pickle

    again = pickle.loads(pickle.dumps(scene))
    assert all(again.scenes(2)[k].tobytes() == v.tobytes() for k, v in scene.scenes(2).items())


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (lambda p: Scene("condition4"), ValueError, "did you mean"),
        (lambda p: Scene(p / "none.toml"), FileNotFoundError, "none.toml"),
        (lambda p: Scene(p / "bad.toml"), ValueError, "bad.toml"),
        (lambda p: Scene("condition1").scenes(5, 3), ValueError, "from 0 on"),
        (lambda p: Scene("condition1").scenes(0, 10**9), ValueError, "there are"),
        (lambda p: write(p / "x.npz", Scene("condition1"), 2, seed=3), TypeError, "seed"),
        (lambda p: write(p / "x.npz", object(), 2), TypeError, "Sampler or a Scene"),
    ],
)
def test_scenes_that_make_no_sense_are_refused(call, kind, message, tmp_path):
    (tmp_path / "bad.toml").write_text("scenes = 0\n")
    with pytest.raises(kind, match=message):
        call(tmp_path)


def test_the_program_is_of_the_same_version(program):
    assert spectroll.__version__ in program("--version")


def test_the_program_starts_without_numpy():
    code = "import sys, spectroll._spectroll; assert 'numpy' not in sys.modules; import spectroll; spectroll.Model; assert 'numpy' in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_the_type_is_the_samplers_unless_another_is_asked_for(tmp_path):
    halves = Sampler(dtype="float16", engine="cpu")
    write(tmp_path / "halves.npy", halves, 100, seed=3)
    written = np.load(tmp_path / "halves.npy")
    assert written.dtype == np.float16 and written.tobytes() == halves.draw(100, seed=3).tobytes()
    write(tmp_path / "floats.npy", halves, 100, seed=3, dtype="float32")
    assert np.load(tmp_path / "floats.npy").dtype == np.float32
