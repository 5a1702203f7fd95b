"""The report is whole, stands on its own, and says what the datasets hold."""

import csv
import re
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from chilopod import load_robot
from chilopod.errors import OutputError
from chilopod.output import write_all
from chilopod.paper.printed import Said
from chilopod.paper.registry import load_sections
from chilopod.paper.robot.sections import WALKS
from chilopod.paper.section import Context, Found
from chilopod.paper.straight import schematic
from chilopod.paper.straight.sections import IDENTIFICATION, MODE
from chilopod.paper.table import Kind, OfPlanar, OfTwin, Result, Row, Statement, Verdict, within
from chilopod.show.figures import identification
from chilopod.show.files import panel_files
from chilopod.show.panel import Panel
from helpers.html_page import Page
from helpers.reports import write_report


def figures(found):
    panels = [panel for each in load_sections() if each in found.values for panel in each.figures(found)]
    return sorted([schematic.panel(found.context.robot), *panels], key=lambda panel: panel.letter)


def only(found, section, context=None):
    return Found(context or found.context, {section: found[section]})


@pytest.fixture(scope="module")
def folder(full, tmp_path_factory):
    where = tmp_path_factory.mktemp("report") / "new"
    assert write_report(full, where) == where / "index.html"
    return where


@pytest.fixture(scope="module")
def html(folder) -> str:
    return (folder / "index.html").read_text(encoding="utf-8")


def test_every_figure_has_all_its_files(folder, full):
    names = ["schematic", "exponents", "variants", "modules", "mode", "uniform", "identification"]
    assert [panel.name for panel in figures(full)] == names
    assert sorted(path.name for path in (folder / "figures").iterdir()) == sorted(
        f"{name}.{kind}" for name in names for kind in ("png", "svg")
    )
    for name in names:
        assert (folder / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG\r\n")
        root = ElementTree.parse(folder / "figures" / f"{name}.svg").getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"


def test_page_is_accessible(html, full):
    page = Page(html)
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert len(images) == len(figures(full))
    assert all(len(attrs["alt"]) > 40 for attrs in images)
    headings = [tag for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
    assert headings[0] == "h1"
    assert set(headings[1:]) == {"h2", "h3"}
    assert headings.index("h2") < headings.index("h3")
    assert dict(page.tags[0][1])["lang"] == "en"
    assert len(set(page.attributes("id"))) == len(page.attributes("id"))


def test_page_says_what_was_found(html, full):
    text = " ".join(Page(html).text.split())
    assert "11.991 N·mm/deg" in text
    assert "6.5359 N·mm/deg" in text
    for section, seconds in full.seconds.items():
        assert f"{section.sentence} {seconds:.1f}" in text
    for path in full.context.robot.parameters():
        assert path in text
        assert full.context.robot.provenance_of(path) in text
    assert "a <b> & c" in text
    assert "−2×10⁻¹⁰ N·mm/deg" in text
    assert "chilopod bifurcation aoi2022-planar" in text
    assert "supercritical for 4 modules and subcritical for 6 to 8" in text
    assert "For 5 modules the straight walk is not lost through a pitchfork" in text
    assert "≠ differs" in text
    assert "✓ agrees" in text


def test_verdict_that_rounding_leaves_open_is_named(fit):
    (panel,) = [each for each in figures(Found(values={IDENTIFICATION: fit})) if each.letter == "G"]
    words = " ".join(panel.text)
    assert "changes within the valley" in words
    assert "near a forward offset of 46.6 mm" in words


@pytest.mark.parametrize("name", ["schematic", "exponents", "variants", "modules", "mode", "uniform", "identification"])
def test_data_read_back(folder, full, name):
    (data,) = [panel.data for panel in figures(full) if panel.name == name]
    per = {str(each): str(each).replace("/", " per ") for each in data.variables}
    with xr.open_dataset(folder / "data" / f"{name}.nc", engine="h5netcdf") as stored:
        xr.testing.assert_equal(stored.load(), data.rename(per))
        for each, new in per.items():
            assert stored[new].attrs.get("units") == data[each].attrs.get("units")
        assert {key: stored.attrs[key] for key in data.attrs} == data.attrs
    lines = (folder / "data" / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    notes = [line for line in lines if line.startswith("#")]
    assert notes == [f"# {key} = {value}" for key, value in data.attrs.items()]
    header, *rows = csv.reader(lines[len(notes) :])
    expected = data.rename(per).to_dataframe().reset_index()
    units = {new: data[each].attrs.get("units", "") for each, new in per.items()}
    assert header == [f"{one} [{units[one]}]" if units.get(one) else one for one in expected.columns]
    for one, column in zip(expected.columns, zip(*rows, strict=True), strict=True):
        read = [float(text or "nan") for text in column] if expected[one].dtype.kind == "f" else list(column)
        values = expected[one].to_numpy()
        np.testing.assert_array_equal(
            read, values if expected[one].dtype.kind == "f" else [str(each) for each in values]
        )


def test_only_what_was_asked_for(results, tmp_path):
    robot = results.context.robot.set_from_text(["gait.swing=0.3 s"])
    folder = tmp_path / "a b"
    page = Page(write_report(only(results, MODE, Context(robot)), folder).read_text(encoding="utf-8"))
    assert {path.stem for path in (folder / "figures").iterdir()} == {"schematic", "mode"}
    assert [attrs["id"] for tag, attrs in page.tags if tag == "section"] == ["chapter-1", "schematic", "mode", "next"]
    assert "6.5359" not in page.text
    # It is no preset any more, so commands name the file that goes with the report.
    assert f'chilopod stability "{folder / "data" / "robot.toml"}"' in page.text
    assert load_robot(folder / "data" / "robot.toml") == robot


def test_same_results_same_bytes(folder, full, tmp_path):
    write_report(only(full, MODE), tmp_path)
    written = [path for path in tmp_path.rglob("*.*") if path.name != "index.html"]
    assert len(written) == 10
    for path in written:
        assert (folder / path.relative_to(tmp_path)).read_bytes() == path.read_bytes(), path.name


def test_identification_on_its_own(fit, tmp_path):
    files = write_all(panel_files(identification.panel(fit), tmp_path / "new", tmp_path / "new"))
    assert sorted(path.suffix for path in files) == [".csv", ".nc", ".png", ".svg"]
    assert all(path.stat().st_size > 300 for path in files)


def test_unwritable_folder(results, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file"):
        write_report(results, tmp_path / "file")


@pytest.fixture
def no_schematic(monkeypatch):
    """Nothing is drawn of the robot itself."""
    plain = Panel("schematic", "S", lambda narrow: Figure(), "nothing", (), xr.Dataset({"y": ("x", np.arange(3.0))}))
    monkeypatch.setattr("chilopod.paper.page.report.schematic.panel", lambda robot: plain)


@pytest.mark.usefixtures("no_schematic")
def test_what_scatter_leaves_open_has_its_own_mark_and_is_counted(results, tmp_path):
    def row(kind, answer, words="2"):
        return OfTwin(Statement(f"{kind}, {answer}, {words}", Said("1", "10 %"), kind), Result(words), within(answer))

    answers = ((True, "2"), (True, "3"), (False, "2"), (None, "2"))
    rows = [*(row(Kind.PREDICTED, *each) for each in answers), row(Kind.FITTED, None), row(Kind.CHECKED, True)]
    rows.append(OfPlanar(Statement("of the planar model alone", Said("1", "10 %"), Kind.PREDICTED), Result("4")))
    planar = [
        Row(each, "1", Result("2"), "here", each)
        for each in (Verdict.AGREES, Verdict.DIFFERS, Verdict.UNDECIDED, Verdict.NOT_PRINTED)
    ]
    found = Found(rows={MODE: planar, WALKS: rows})
    page = Page(write_report(found, tmp_path).read_text(encoding="utf-8"))
    text = " ".join(page.text.split())
    met = "2 met, 1 not met and 1 undecided by the scatter of its trials."
    assert f"is compared with 4 other statements about it: {met}" in text
    assert text.count("? undecided") == 3
    assert [tag for tag, attrs in page.tags if attrs.get("class") == "verdict undecided"] == ["span"] * 3


@pytest.mark.usefixtures("no_schematic")
def test_the_robot_has_a_table_and_its_numbers(results, tmp_path):
    said = Statement("where <it> bends", Said("34 N*mm/deg", "10 %"), Kind.PREDICTED)
    planar = Found(rows={WALKS: [OfPlanar(said, Result("12 N*mm/deg"))]})
    page = Page(write_report(planar, tmp_path / "planar").read_text(encoding="utf-8"))
    assert "– not computed" in " ".join(page.text.split())
    assert "other statement" not in page.text
    assert "twin.clearance" not in page.text
    found = Found(
        rows={
            WALKS: [
                OfPlanar(said, Result("12 N*mm/deg")),
                OfTwin(said, Result("33.2 N*mm/deg (-2 %)"), Verdict.OUTSIDE),
            ]
        }
    )
    page = Page(write_report(found, tmp_path).read_text(encoding="utf-8"))
    assert "robot-table" in [attrs.get("id") for tag, attrs in page.tags if tag == "section"]
    assert "33.2 N·mm/deg (−2 %)" in page.text.replace("\u00a0", " ")
    assert "is compared with 1 other statement about it: 1 not met." in page.text
    assert "twin.clearance" in page.text
    assert load_robot(tmp_path / "data" / "robot-3d.toml") == found.context.whole
