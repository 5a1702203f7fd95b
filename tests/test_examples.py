"""Every example runs as the notebook that the gallery makes of it, draws a figure, and states what is known."""

import copy
import io
import re
import sys
from contextlib import redirect_stdout
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import nbformat
import pytest
from IPython.core.interactiveshell import InteractiveShell
from nbclient import NotebookClient
from sphinx_gallery.gen_gallery import DEFAULT_GALLERY_CONF
from sphinx_gallery.notebook import jupyter_notebook
from sphinx_gallery.py_source_parser import split_code_and_text_blocks
from traitlets.config import Config

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9][0-9]_*.py"))

# What each prints that is known: from the paper, in closed form, from scipy, or from tests with other means.
KNOWN = {
    "01_straight_walk": ["15 N.mm/deg: .* stable: True", "10 N.mm/deg: .* stable: False", r"\n11\.991430 ± "],
    "02_past_the_pitchfork": ["stable: True"],
    "03_spring_sets_the_radius": [
        r"as they are: supercritical, pitchfork at 11\.9914",
        r"nearer: subcritical, pitchfork at 9\.6026",
        r"fold at 10\.3067",
    ],
    "04_turn_to_a_target": ["tried: .* arrived", "by the law: .* bulged outside"],
    "05_slalom": ["gate 3: arrived"],
    "06_batch_study": ["8 N.mm/deg: 20 of 20", "13 N.mm/deg:  0 of 20"],
    "07_twenty_modules": ["first spring: pitchfork", "all springs: Neimark-Sacker", "2 of 41"],
    "09_own_engine": [r"good feet: radius (\S+) m to the left, \1 m to the right"],
    "10_duffing": [r"supercritical pitchfork at F = 2\.403377116057"],
    "11_mathieu_chart": [r"5 curves, at most \de-1[3-6] beside"],
    "12_van_der_pol": [r"period 6\.663286859323, multiplier 0\.000859695064"],
    "13_bouncing_ball": [r"period doubling at (\S+) mm, in closed form \1 mm"],
    "15_twin": ["arrived"],
    "16_two_parameters": [r"degenerate pitchfork at 11\.88384 N.mm/deg and 47\.8332 mm"],
    "17_a_cycle_beside_chaos": [r"fold  5\.6431157912", r"period doubling  4\.9449592164\d* .* supercritical"],
}


def notebook(example: Path) -> nbformat.NotebookNode:
    _, blocks = split_code_and_text_blocks(str(example))
    made = jupyter_notebook(blocks, copy.deepcopy(DEFAULT_GALLERY_CONF), str(example.parent))
    made["cells"] = [{**cell, "source": "".join(cell["source"])} for cell in made["cells"]]
    return nbformat.from_dict(made)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_example_runs_as_a_notebook(example, tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path_factory.mktemp("ipython")))
    # A shell puts itself in the place of the module that was started.
    monkeypatch.setitem(sys.modules, "__main__", sys.modules["__main__"])
    mpl.use("Agg")
    plt.close("all")
    shell, said = InteractiveShell(config=Config(HistoryManager={"enabled": False})), io.StringIO()
    with redirect_stdout(said):
        for cell in notebook(example).cells:
            if cell.cell_type == "code":
                shell.run_cell(cell.source, store_history=False).raise_error()
    assert plt.get_fignums()
    for number in plt.get_fignums():
        for axes in plt.figure(number).axes:
            assert axes.get_xlabel()
    for known in KNOWN.get(example.stem, []):
        assert re.search(known, said.getvalue()), (known, said.getvalue())
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_kernel_runs_a_notebook(tmp_path):
    (example,) = (each for each in EXAMPLES if each.stem == "13_bouncing_ball")
    run = NotebookClient(
        notebook(example), timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()
    shown = [output for cell in run.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in shown)


def test_examples_read_like_a_gallery():
    assert len(EXAMPLES) >= 12
    for example in EXAMPLES:
        first, *others = notebook(example).cells
        assert first.cell_type == "markdown"
        assert re.match(r"\s*# \w", first.source), example
        assert len([cell for cell in others if cell.cell_type == "markdown"]) >= 1
