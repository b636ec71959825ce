"""Forks, spawned processes and pools: none hangs, and all draw the same bytes."""

import concurrent.futures
import gc
import hashlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
import warnings

import numpy as np
import pytest

from spectroll import Model, Sampler, Scene

# A child that hangs is ended by this, and the test fails.
pytestmark = [pytest.mark.timeout(60), pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]

METHODS = [m for m in ("fork", "spawn", "forkserver") if m in multiprocessing.get_all_start_methods()]
NEED_FORK = pytest.mark.skipif("fork" not in METHODS, reason="there is no fork here")


def digest(sampler, part):
    """A sum of some draws, of a range and of a list."""
    first = 1000 * part
    rows = sampler.draw(range(first, first + 1000), seed=5)
    listed = sampler.at(np.arange(first, first + 1000)[::-1], seed=5)
    assert listed[::-1].tobytes() == rows.tobytes()
    return hashlib.sha256(rows.tobytes()).hexdigest()


def digest_of_new(part):
    """The same of a sampler that is made here, with its model and its pilot run."""
    return digest(Sampler(Model("munsell-vrhel"), lrv=0.4, bounds="both", engine="cpu"), part)


def in_fork(work):
    """What `work` returns in a forked child, which is killed if it hangs."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(read)
            try:
                done = work()
            except BaseException:
                done = traceback.format_exc()
            with os.fdopen(write, "wb") as pipe:
                pickle.dump(done, pipe)
            code = 0
        finally:
            os._exit(code)
    os.close(write)
    killer = threading.Timer(30, os.kill, (child, signal.SIGKILL))
    killer.start()
    with os.fdopen(read, "rb") as pipe:
        sent = pipe.read()
    _, status = os.waitpid(child, 0)
    killer.cancel()
    assert status == 0, "the child did not end by itself"
    return pickle.loads(sent)


@pytest.fixture
def sampler():
    """A sampler whose threads are running."""
    sampler = Sampler(lrv=0.4, bounds="both", engine="cpu")
    sampler.draw(10_000)
    return sampler


@NEED_FORK
def test_a_forked_child_draws(sampler):
    expected = digest(sampler, 1)
    assert in_fork(lambda: digest(sampler, 1)) == expected
    assert in_fork(lambda: in_fork(lambda: digest(sampler, 1))) == expected
    assert digest(sampler, 1) == expected


@NEED_FORK
def test_a_forked_child_builds_recipes_and_draws_scenes(sampler):
    scene = Scene("condition3", engine="cpu")
    expected = (digest_of_new(2), sums(scene))
    assert in_fork(lambda: (digest_of_new(2), sums(Scene("condition3", engine="cpu")))) == expected
    assert in_fork(lambda: sums(scene)) == expected[1]


def sums(scene):
    return {name: hashlib.sha256(array.tobytes()).hexdigest() for name, array in scene.scenes(0, 3).items()}


@NEED_FORK
def test_a_forked_child_drops_what_it_inherited(sampler):
    def drop():
        nonlocal sampler
        del sampler
        gc.collect()
        return "dropped"

    assert in_fork(drop) == "dropped"


@NEED_FORK
def test_a_fork_in_the_middle_of_draws(sampler):
    """Other threads hold whatever they hold at that moment."""
    expected, stop = digest(sampler, 3), threading.Event()

    def draw():
        while not stop.is_set():
            sampler.draw(3000)
            Sampler(engine="cpu", threads=2).draw(10)

    threads = [threading.Thread(target=draw) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(8):
            assert in_fork(lambda: digest(sampler, 3)) == expected
    finally:
        stop.set()
        for thread in threads:
            thread.join()


@NEED_FORK
def test_a_gpu_after_a_fork_draws_or_says_what_to_do():
    """Drivers need not survive a fork. Mesa's software one does."""
    sampler = Sampler(engine="gpu")
    expected = digest(sampler, 1)
    assert in_fork(lambda: digest(sampler, 1)) == expected
    assert digest(sampler, 1) == expected


@pytest.mark.parametrize("method", METHODS)
def test_processes_of_every_kind(method, sampler):
    context = multiprocessing.get_context(method)
    expected = [digest(sampler, part) for part in range(4)]
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as pool:
        assert list(pool.map(digest, [sampler] * 4, range(4))) == expected
        assert list(pool.map(digest_of_new, range(4))) == expected


@pytest.mark.parametrize("method", METHODS)
def test_pools_of_multiprocessing(method, sampler):
    expected = [digest(sampler, part) for part in range(4)]
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.starmap(digest, [(sampler, part) for part in range(4)]) == expected


def test_joblib(sampler):
    joblib = pytest.importorskip("joblib")
    expected = [digest(sampler, part) for part in range(4)]
    for backend in ("loky", "threading", "multiprocessing"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = joblib.Parallel(2, backend=backend)(joblib.delayed(digest)(sampler, p) for p in range(4))
        assert found == expected, backend


def test_what_is_pickled_is_small(sampler):
    assert len(pickle.dumps(sampler)) < 30_000


@NEED_FORK
@pytest.mark.skipif(sys.platform == "darwin", reason="the driver is not for forks")
def test_a_data_set_is_written_and_resumed_in_a_fork(sampler, tmp_path):
    from spectroll import write

    path = tmp_path / "shared.zarr"
    write(path, sampler, 3000, chunk=1000, shard=(0, 2))
    assert in_fork(lambda: write(path, sampler, 3000, chunk=1000, shard=(1, 2)).complete) is True
    # What is there is checked, by several threads.
    again = write(path, sampler, 3000, chunk=1000, resume=True)
    assert again.complete and again.draws == 0
    assert in_fork(lambda: tuple(write(path, sampler, 3000, chunk=1000, resume=True))) == again
