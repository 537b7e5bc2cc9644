"""Every notebook runs from its first cell to its last, and comes to what it says."""

import pathlib
import re

import nbclient
import nbformat
import pytest

FOLDER = pathlib.Path(__file__).parents[1] / "notebooks"
SAYS = {
    "damper": ["missing - proven: True", "bouc_wen", "maxwell", "calibrated.json", "image/png"],
    "tensioner": ["film", "held_out", "image/png"],
    "own_effect": ["cost 1.23e+06 -> ", "in Python", "image/png"],
    "hidden_effect": ["converged", "image/png"],
}


def run(name):
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}).execute()
    said = []
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            said.append(output.get("text", "") or str(dict(output.get("data", {}))))
    return "\n".join(said)


def test_no_notebook_is_left_out():
    assert {f.stem for f in FOLDER.glob("*.ipynb")} == set(SAYS)
    assert not any(c.get("outputs") for f in FOLDER.glob("*.ipynb") for c in nbformat.read(f, as_version=4).cells), "outputs are not kept"


@pytest.mark.parametrize("name", SAYS)
def test_a_notebook_runs(name):
    said = run(name)
    for words in SAYS[name]:
        assert words in said, said[-2000:]
    if name == "own_effect":
        costs = re.findall(r"cost [\d.e+]+ -> ([\d.e+]+)|as formula: cost ([\d.e+]+)", said)
        assert float(costs[0][0]) == pytest.approx(float(costs[1][1]), rel=1e-3) and float(costs[0][0]) < 1e4
    if name == "hidden_effect":
        own, there, away = re.search(r"SciPy: cost ([\d.e+]+); misfit: ([\d.e+]+); at most ([\d.]+) standard", said).groups()
        assert float(own) == pytest.approx(float(there), rel=0.05) and float(away) < 0.3
    assert "Traceback" not in said
