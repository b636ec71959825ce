"""The documents: their Python runs, from top to bottom, and so does the notebook."""

import json
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ["README.md", "docs/python.md", "docs/clusters.md"]


def blocks(text):
    """The blocks of Python that import the package, each with its line."""
    for found in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        if "import spectroll" in found[1]:
            yield text.count("\n", 0, found.start()) + 1, found[1]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_python_of_documents_runs(name, tmp_path, monkeypatch):
    text = (ROOT / name).read_text()
    assert list(blocks(text)), "there is none: is it still found?"
    monkeypatch.chdir(tmp_path)
    for line, code in blocks(text):
        # A hundred million draws take a while to write.
        code = re.sub(r"10\*\*8\b", "10**4", code)
        exec(compile("\n" * line + code, str(ROOT / name), "exec"), {"__name__": "document"})


def test_every_module_has_its_names_in_the_documents():
    import spectroll

    text = (ROOT / "docs/python.md").read_text() + (ROOT / "docs/clusters.md").read_text()
    missing = [name for name in ("sample", "draw", "at", "fit", "read", "write", "Scene") if name not in text]
    assert not missing and all(name in dir(spectroll) for name in ("dask", "ray", "torch"))


@pytest.mark.timeout(300)
def test_the_notebook_runs(tmp_path, monkeypatch):
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient")
    path = ROOT / "docs/notebooks/spectra.ipynb"
    notebook = nbformat.read(path, as_version=4)
    kept = json.loads(path.read_text())
    pictures = sum("image/png" in json.dumps(c.get("outputs", [])) or "image/svg" in json.dumps(c.get("outputs", [])) for c in kept["cells"])
    assert pictures >= 4, "the notebook is kept with its pictures: make notebook"
    monkeypatch.setenv("SPECTROLL_DATA", str(ROOT / "data"))
    client.NotebookClient(
        notebook, timeout=200, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    errors = [o for c in notebook.cells for o in c.get("outputs", []) if o.output_type == "error"]
    assert not errors and not os.path.exists(tmp_path / "error")
