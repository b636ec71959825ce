"""Runs the notebook in the documents with the package that is installed, and keeps what it shows."""

import os
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
PATH = ROOT / "docs/notebooks/spectra.ipynb"

os.environ["SPECTROLL_DATA"] = str(ROOT / "data")
notebook = nbformat.read(PATH, as_version=4)
with tempfile.TemporaryDirectory() as folder:
    NotebookClient(notebook, kernel_name="python3", resources={"metadata": {"path": folder}}).execute()
for cell in notebook.cells:
    cell.metadata = {}
    if cell.cell_type == "code":
        cell.pop("execution_count", None)
        cell.execution_count = None
notebook.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
nbformat.write(notebook, PATH)
print("wrote", PATH.relative_to(ROOT))
