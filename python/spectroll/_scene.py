"""Scenes of lights, surfaces and targets."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _spectroll
from ._settings import engine_of
from ._values import whole


class SceneArray(NamedTuple):
    """An array of a scene."""

    name: str
    group: str
    quantity: str
    shape: tuple[int, ...]
    """Shape of an entry: (elements, bands) for spectra."""
    per_scene: bool
    """Whether there is an entry for each scene, and not one for all."""


class Scene:
    """Scenes of a TOML file, or of an example: "condition1", "condition2" or "condition3".

    Parameters
    ----------
    name : str or path
    seed : int, optional
        Takes the place of the file's.
    engine, arithmetic, threads
        Those of `Sampler`.

    `scenes(0, 100)` draws a hundred scenes. Scenes are immutable and can be pickled, and may be used after a fork.
    """

    __slots__ = ("_arguments", "_native", "_wavelengths")

    def __init__(
        self,
        name: str | os.PathLike[str],
        *,
        seed: int | None = None,
        engine: str | int = "auto",
        arithmetic: str = "auto",
        threads: int | None = None,
    ) -> None:
        path = os.fspath(name)
        seed = None if seed is None else whole("seed", seed)
        if os.path.exists(path):
            path = os.path.abspath(path)  # what is pickled may be opened from another folder
        self._arguments = (path, seed, tuple(engine_of(engine, threads, arithmetic)))
        self._native = _spectroll.Scene(*self._arguments)
        self._wavelengths = self._native.wavelengths
        self._wavelengths.flags.writeable = False

    def scenes(self, start: int = 0, stop: int | None = None) -> dict[str, NDArray[Any]]:
        """Scenes start to stop - 1: a mapping of arrays by name, (scenes, elements, bands) float32 for spectra, where the
        elements are the lights or surfaces of a group. What all scenes share has no axis of scenes, as `arrays` tells. One
        number is a stop, as in `range`, and none asks for all, of which `len` is the number."""
        if stop is None:
            start, stop = 0, start or len(self)
        asked = self._range(range(whole("start", start), whole("stop", stop)))
        drawn = self._native.draw(asked.start, asked.stop)
        return {name: data.view(dtype).reshape(shape) for name, shape, dtype, data, _ in drawn}

    def _range(self, scenes: range | int) -> range:
        asked = scenes if isinstance(scenes, range) else range(whole("n", scenes))
        if asked.step != 1 or not 0 <= asked.start <= asked.stop <= len(self):
            raise ValueError(f"scenes {asked.start} to {asked.stop}: there are {len(self)}, from 0 on")
        return asked

    @property
    def arrays(self) -> list[SceneArray]:
        """The arrays that `scenes` gives, each with its name, its group, its quantity and the shape of an entry."""
        all = self._native.arrays()
        return [SceneArray(name, group, quantity, tuple(shape), each) for name, group, quantity, shape, each in all]

    @property
    def groups(self) -> list[str]:
        """The names of the groups."""
        return self._native.groups

    @property
    def seed(self) -> int:
        """The seed."""
        return self._native.seed

    @property
    def wavelengths(self) -> NDArray[np.float64]:
        """The wavelengths in nm: (bands,) float64."""
        return self._wavelengths

    @property
    def text(self) -> str:
        """The text of the scene file."""
        return self._native.text

    def __len__(self) -> int:
        return self._native.count

    def __reduce__(self) -> Any:
        return _restored, self._arguments

    def __repr__(self) -> str:
        groups = ", ".join(self.groups)
        return f"<Scene {os.path.basename(self._arguments[0])!r}: {len(self)} scenes of {groups}; seed {self.seed}>"


def _restored(path: str, seed: int | None, engine: tuple[str, int | None, str]) -> Scene:
    name, threads, arithmetic = engine
    return Scene(path, seed=seed, engine=name, threads=threads, arithmetic=arithmetic)
