"""xarray, colour-science, PyTorch, Dask and Ray."""

import os
import pickle
import subprocess
import sys
import time
import types

import numpy as np
import pytest

from spectroll import Sampler, write


@pytest.fixture
def sampler():
    return Sampler(lrv=0.4, bounds="both", engine="cpu")


# xarray


def test_xarray_has_coordinates(sampler):
    pytest.importorskip("xarray")
    array = sampler.to_xarray(range(2**63, 2**63 + 5), seed=3)
    assert array.dims == ("draw", "wavelength") and array.name == "spectra"
    assert array.draw.values.tolist() == list(range(2**63, 2**63 + 5))
    assert array.wavelength.attrs["units"] == "nm" and array.attrs["seed"] == 3
    assert array.values.tobytes() == sampler.draw(range(2**63, 2**63 + 5), seed=3).tobytes()
    assert array.sel(wavelength=550).shape == (5,)
    some = sampler.to_xarray(5, quantities=["spectra", "xyz", "chromaticity", "weights", "lrv", "attempts"])
    assert some.xyz.dims == ("draw", "xyz_channel") and some.xyz_channel.values.tolist() == ["X", "Y", "Z"]
    assert some.chromaticity.sel(chromaticity_channel="x").shape == (5,)
    assert some.weights.dims == ("draw", "component") and some.lrv.dims == ("draw",)


# colour-science


def test_colour_science_agrees_on_the_colours(sampler):
    colour = pytest.importorskip("colour")
    spectra = sampler.to_colour(3)
    assert spectra.shape.start == 400 and spectra.labels == ["0", "1", "2"]
    ours = sampler.draw(3, quantities="xyz")
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    d65 = colour.SDS_ILLUMINANTS["D65"]
    for spectrum, xyz in zip(spectra.to_sds(), ours):
        theirs = colour.sd_to_XYZ(spectrum, cmfs.copy().align(spectrum.shape), d65.copy().align(spectrum.shape), method="Integration") / 100
        np.testing.assert_allclose(xyz, theirs, rtol=2e-3)


# PyTorch, by a stand-in: the real one is a gigabyte


@pytest.fixture
def torch(monkeypatch):
    """What is used of PyTorch: tensors are arrays here."""
    torch = types.ModuleType("torch")
    data = types.ModuleType("torch.utils.data")
    data.Dataset = type("Dataset", (), {})
    data.IterableDataset = type("IterableDataset", (data.Dataset,), {})
    data.worker = None
    data.get_worker_info = lambda: data.worker
    torch.from_numpy = lambda array: array
    torch.utils = types.ModuleType("torch.utils")
    torch.utils.data = data
    for name, module in {"torch": torch, "torch.utils": torch.utils, "torch.utils.data": data}.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "spectroll.torch", raising=False)
    yield torch
    sys.modules.pop("spectroll.torch", None)


def worker_of(number, workers):
    return types.SimpleNamespace(id=number, num_workers=workers)


def test_torch_map_style(torch, sampler):
    data = sampler.torch(range(100, 10**9), seed=7)
    assert isinstance(data, torch.utils.data.Dataset) and len(data) == 10**9 - 100
    expected = sampler.draw(range(100, 110), seed=7)
    assert data[3].tobytes() == expected[3].tobytes()
    batch = data.__getitems__([5, 1, 5])
    assert [row.tobytes() for row in batch] == [expected[i].tobytes() for i in (5, 1, 5)]
    assert data[-1].tobytes() == sampler.at(10**9 - 1, seed=7).tobytes()
    with pytest.raises(IndexError):
        data[len(data)]
    labelled = sampler.torch(10, quantities=["spectra", "attempts"])
    assert labelled[0]["attempts"].dtype == np.int64 and set(labelled.__getitems__([1, 2])[0]) == {"spectra", "attempts"}
    assert data.sampler.threads == 1


@pytest.mark.parametrize(("workers", "ranks"), [(0, 1), (3, 1), (2, 2)])
def test_torch_iterable_gives_each_batch_once(torch, sampler, workers, ranks):
    data = sampler.torch(1001, seed=7, batch_size=100)
    assert isinstance(data, torch.utils.data.IterableDataset) and len(data) == 11
    found = []
    for rank in range(ranks):
        torch.distributed = types.SimpleNamespace(
            is_available=lambda: True,
            is_initialized=lambda: True,
            get_rank=lambda rank=rank: rank,
            get_world_size=lambda: ranks,
        )
        for number in range(max(workers, 1)):
            torch.utils.data.worker = worker_of(number, workers) if workers else None
            found += [batch.tobytes() for batch in data]
    rows = sampler.draw(1001, seed=7)
    assert sorted(found) == sorted(rows[i : i + 100].tobytes() for i in range(0, 1001, 100))


def load(data, items, pipe):
    """A worker of a loader: a process that fetches batches."""
    pipe.send([row.tobytes() for row in data.__getitems__(items)])
    pipe.close()


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_worker_of_a_loader_is_a_fork(torch, sampler):
    """As `DataLoader(num_workers=2)` does on Linux, after the parent has drawn."""
    import multiprocessing

    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("there is no fork here")
    context = multiprocessing.get_context("fork")
    data = sampler.torch(10**8, seed=7)
    expected = [row.tobytes() for row in data.__getitems__([4, 10**7])]
    for _ in range(2):
        here, there = context.Pipe(duplex=False)
        worker = context.Process(target=load, args=(data, [4, 10**7], there))
        worker.start()
        assert here.poll(30), "the worker hangs"
        assert here.recv() == expected
        worker.join(30)
        assert worker.exitcode == 0


# Dask


def test_dask_is_lazy_and_has_the_draws(sampler):
    pytest.importorskip("dask.array")
    array = sampler.dask(10_000, seed=7, chunks=3000)
    assert array.shape == (10_000, 31) and array.chunks[0] == (3000, 3000, 3000, 1000)
    assert array.compute().tobytes() == sampler.draw(10_000, seed=7).tobytes()
    some = array[[5, 9999], 3:].compute()
    assert some.tobytes() == sampler.at([5, 9999], seed=7)[:, 3:].tobytes()
    lrv = sampler.dask(range(100, 200), quantities="lrv", chunks=30)
    assert lrv.compute().tobytes() == sampler.draw(range(100, 200), quantities="lrv").tobytes()
    assert sampler.dask(10_000, seed=7, chunks=3000).name == array.name
    assert sampler.dask(10_000, seed=8, chunks=3000).name != array.name
    assert sampler.dask(0).compute().shape == (0, 31)


def test_dask_takes_ten_thousand_million_draws(sampler):
    pytest.importorskip("dask.array")
    start = time.monotonic()
    array = sampler.dask(10**10, seed=7)
    last = array[-1000:].compute(scheduler="threads")
    taken = time.monotonic() - start
    assert last.tobytes() == sampler.draw(range(10**10 - 1000, 10**10), seed=7).tobytes()
    assert len(pickle.dumps(array)) < 1_000_000
    assert taken < 20, taken  # seconds; 2 on a machine that is not busy


def test_dask_writes_one_chunk_a_block(sampler, tmp_path):
    pytest.importorskip("dask.array")
    zarr = pytest.importorskip("zarr")
    from spectroll import dask

    for zarr_format in (3, 2):
        path = tmp_path / f"cluster-{zarr_format}.zarr"
        dask.write(path, sampler, 5000, seed=7, quantities=["spectra", "lrv"], chunks=1000, zarr_format=zarr_format)
        group = zarr.open_group(path, mode="r")
        assert group["spectra"].chunks == (1000, 31) and group["wavelength"][:].tolist() == sampler.wavelengths.tolist()
        assert group["spectra"][:].tobytes() == sampler.draw(5000, seed=7).tobytes()
        assert group["lrv"][:].tobytes() == sampler.draw(5000, seed=7, quantities="lrv").tobytes()
        assert group.attrs["seed"] == 7 and group.attrs["recipe"]["lrv"] == 0.4
    with pytest.raises(FileExistsError):
        dask.write(tmp_path / "cluster-3.zarr", sampler, 10)
    xarray = pytest.importorskip("xarray")
    opened = xarray.open_zarr(tmp_path / "cluster-3.zarr", consolidated=False)
    assert opened.spectra.dims == ("draw", "wavelength")
    write(tmp_path / "program.zarr", sampler, 5000, seed=7, chunk=1000)
    assert zarr.open_group(tmp_path / "program.zarr", mode="r")["spectra"][:].tobytes() == opened.spectra.values.tobytes()


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_dask_cluster_has_the_bytes_of_one_process(sampler, tmp_path):
    """Two workers, one of which is killed in the middle."""
    distributed = pytest.importorskip("distributed")
    zarr = pytest.importorskip("zarr")
    from spectroll import dask

    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    )
    with cluster, distributed.Client(cluster) as client:
        array = sampler.dask(3_000_000, seed=7, chunks=2**17)
        assert array[-5:].compute().tobytes() == sampler.draw(range(2_999_995, 3_000_000), seed=7).tobytes()
        writes = dask.write(
            tmp_path / "cluster.zarr", sampler, 3_000_000, seed=7, chunks=2**17, compute=False
        )
        futures = client.compute(writes)
        time.sleep(1)
        pid = next(iter(client.run(os.getpid).values()))
        os.kill(pid, 9)
        client.gather(futures)
        start = time.monotonic()
        last = sampler.dask(10**10, seed=7)[-1000:].compute()
        assert time.monotonic() - start < 20
        assert last.tobytes() == sampler.draw(range(10**10 - 1000, 10**10), seed=7).tobytes()
    written = zarr.open_group(tmp_path / "cluster.zarr", mode="r")["spectra"]
    for first in range(0, 3_000_000, 2**17):
        rows = range(first, min(first + 2**17, 3_000_000))
        assert written[rows.start : rows.stop].tobytes() == sampler.draw(rows, seed=7).tobytes()


# Ray


RAY = """
import os, sys, time
import numpy as np, ray
from spectroll import Sampler
import spectroll.ray

ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, configure_logging=False)
sampler = Sampler(lrv=0.4, bounds="both", engine="cpu")
marker = sys.argv[1]

class Killed(spectroll.ray.Draws):
    # The first worker that comes here is killed.
    def __call__(self, batch):
        try:
            os.close(os.open(marker, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return super().__call__(batch)
        os.kill(os.getpid(), 9)

made = spectroll.ray.dataset(sampler, 200_000, seed=7, quantities=["spectra", "lrv"])
killed = ray.data.range(200_000).map_batches(Killed(sampler, seed=7).__call__, batch_size=2**15, batch_format="numpy")
for dataset, names in ((made, ["spectra", "lrv"]), (killed, ["spectra"])):
    rows = {name: np.empty((200_000, 31) if name == "spectra" else 200_000, np.float32) for name in names}
    for batch in dataset.iter_batches(batch_size=None, batch_format="numpy"):
        for name in names:
            rows[name][batch["id"]] = np.stack(batch[name])
    for name in names:
        assert rows[name].tobytes() == sampler.draw(200_000, seed=7, quantities=name).tobytes(), name
assert os.path.exists(marker)
print("the same")
"""


def test_ray_batches_are_draws(sampler):
    """What a worker of Ray calls, without Ray."""
    from spectroll.ray import Draws

    draws = pickle.loads(pickle.dumps(Draws(sampler, seed=7, quantities=["spectra", "lrv"])))
    batch = draws({"id": np.array([7, 3, 7])})
    assert batch["id"].tolist() == [7, 3, 7] and set(batch) == {"id", "spectra", "lrv"}
    assert batch["spectra"].tobytes() == sampler.at([7, 3, 7], seed=7).tobytes()
    assert draws.sampler.threads == 1


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_ray_has_the_bytes_of_one_process(tmp_path):
    pytest.importorskip("ray")
    script = tmp_path / "script.py"
    script.write_text(RAY)
    done = subprocess.run(
        [sys.executable, script, tmp_path / "marker"], capture_output=True, text=True, timeout=280, cwd=tmp_path
    )
    assert "the same" in done.stdout, done.stderr
