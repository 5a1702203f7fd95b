"""A page that is there at once and whole at any time, whatever happens while it fills in."""

import errno
import json
import os
import re
import shutil
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from chilopod.cli import main
from chilopod.errors import OutputError
from chilopod.paper import registry
from chilopod.paper.duration import Plan
from chilopod.paper.page import Report
from chilopod.paper.page.page import Drawings, Film, State, page
from chilopod.paper.section import Context, Found, Section, reproduce
from chilopod.paper.table import Result, Row, Verdict
from chilopod.show.panel import Panel
from helpers.html_page import Page as PAGE
from helpers.reports import write_report

RUNNING = 'data-state="running"'
THERE = """new Promise((done) => {
  const look = () => %s ? done(true) : setTimeout(look, 50);
  look();
})"""
HASTE = "const wait = setTimeout; window.setTimeout = (call, time) => wait(call, time / 10)"
CONTEXT = Context()
AGAIN = "The same command begins the page anew: it reads the kept trials and computes the rest again, in a few minutes."


def rows(value):
    return [Row(f"quantity {value}", "1", Result("1"), "here", Verdict.AGREES)]


def panel(name):
    data = xr.Dataset({"y": ("x", np.arange(3.0))})
    return Panel(name, f"Figure {name}", lambda narrow: Figure(), "nothing to be seen", (), data)


def figure(name):
    return lambda value: [panel(name)]


ONE = Section("one", "First chapter", "the first", lambda context, report: 1, rows, figure("one"))
TWO = Section("two", "Second chapter", "the second", lambda context, report: 2, rows, figure("two"))


def failing(*_):
    raise ValueError("no <luck>")


@pytest.fixture(autouse=True)
def _schematic(monkeypatch):
    """Little is drawn of the robot itself."""
    monkeypatch.setattr("chilopod.paper.page.report.schematic.panel", lambda robot: panel("schematic"))


def text(report):
    html = report.page.read_text(encoding="utf-8")
    PAGE(html)  # whole and valid at any time
    return html


def test_page_is_there_before_anything_is_computed(tmp_path):
    with Report([ONE, TWO], CONTEXT, tmp_path, plan=Plan("All", "an hour")) as report:
        html = text(report)
        assert RUNNING in html
        assert "All: an hour." in html
        assert "0 of 2 sections" in html
        assert re.findall("Still to come:</b> (.*).</p>", html) == ["the first", "the second"]


def test_what_two_threads_cannot_load_at_once_is_loaded_before_there_are_two(monkeypatch, tmp_path):
    report, loaded = Report([ONE], CONTEXT, tmp_path), []
    monkeypatch.setattr("chilopod.record.import_module", lambda name: loaded.append((name, threading.current_thread())))
    monkeypatch.setattr(report._thread, "submit", lambda *work: loaded.append("drawing"))
    with pytest.raises(KeyboardInterrupt), report:
        raise KeyboardInterrupt
    assert loaded == [(name, threading.main_thread()) for name in ("xarray", "dask.array")] + ["drawing"]


def test_the_first_lines_say_what_is_computed_and_where_the_page_is(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(registry, "load_sections", lambda: (ONE,))
    assert main(["reproduce", "--out", str(tmp_path)]) == 0
    said, page, *_ = capsys.readouterr().out.splitlines()
    what, _, expected = said.partition(":")
    assert what.startswith("The paper's own experiments, and one headline of every chapter beyond")
    assert expected == " less than a minute."
    assert page == f"The page is {tmp_path / 'index.html'}"
    assert f"{what}; it took less than a minute." in PAGE((tmp_path / "index.html").read_text(encoding="utf-8")).text


def test_every_section_is_on_the_page_before_the_next_is_drawn(tmp_path):
    seen = []
    two = replace(TWO, panels=lambda value: seen.append(text(report)) or [panel("two")])
    with Report([ONE, two], CONTEXT, tmp_path) as report:
        reproduce([ONE, two], CONTEXT, callback=lambda found, section: report.add(found, [section]))
    (between,) = seen
    assert RUNNING in between
    for expected, html in ((["one"], between), (["one", "two"], text(report))):
        assert re.findall('<section id="(one|two)"', html) == expected
        assert "quantity 1" in html
    assert RUNNING not in text(report)
    assert "Still to come" not in text(report)


def test_what_is_shown_beside_others_is_drawn_once_more(tmp_path):
    seen = []
    one = replace(ONE, panels=lambda value, two: seen.append(two) or (), beside=(TWO,))
    with Report([one, TWO], CONTEXT, tmp_path) as report:
        reproduce([one, TWO], CONTEXT, callback=lambda found, section: report.add(found, [section]))
    assert seen == [None, 2]
    write_report(Found(values={one: 1, TWO: 2}), tmp_path)
    assert seen == [None, 2, 2]


def test_new_sections_are_put_in_and_the_readers_place_stays(browser, monkeypatch, tmp_path):
    monkeypatch.setattr("chilopod.paper.page.report._BETWEEN_NEWS", 0.2)
    one = replace(ONE, rows=lambda value: [*rows(value), Row("other", "1", Result("2"), "here", Verdict.DIFFERS)])
    with Report([one, TWO], CONTEXT, tmp_path) as report:
        report.add(reproduce([TWO], CONTEXT), [TWO])
        while 'id="two"' not in text(report):
            time.sleep(0.05)
        browser("Page.addScriptToEvaluateOnNewDocument", source=HASTE)
        browser.open(report.page)
        top = "document.getElementById('two').getBoundingClientRect().top"
        browser.run("window.mark = 'the same page'; document.getElementById('two').scrollIntoView()")
        before = browser.run(top)
        report.add(reproduce([one, TWO], CONTEXT), [one])
        assert browser.run(THERE % "document.getElementById('one')")
        assert browser.run(top) == pytest.approx(before, abs=1.0)
    assert browser.run(THERE % "document.body.dataset.state === 'done'")
    assert "Being computed" not in browser.run("document.body.innerText")
    assert browser.run("window.mark") == "the same page"
    browser.run("document.querySelector('.strip a.differs').click()")
    rows_shown = "[...document.querySelectorAll('tr.row:not([hidden]) th')].map((each) => each.textContent)"
    assert browser.run(rows_shown) == ["other"]
    browser.run("document.querySelector('.filter button').click(); document.querySelector('thead button').click()")
    assert browser.run(rows_shown) == ["other", "quantity 1", "quantity 2"]
    assert browser.named("Runtime.exceptionThrown") == []


def test_a_page_whose_computation_was_killed_says_so(browser, tmp_path):
    html = page(Found(CONTEXT), [ONE], Drawings(waiting=[ONE]), "aoi2022-planar", State.RUNNING)
    (tmp_path / "index.html").write_text(re.sub('data-written="[^"]*"', 'data-written="1e9"', html), encoding="utf-8")
    browser.open(tmp_path / "index.html")
    assert browser.run(THERE % "document.querySelector('#status .failed')")
    said = browser.run("document.getElementById('status').innerText")
    assert "The computation has ended: there is no sign of life of it since Sep" in said
    assert AGAIN in said


def test_films_wait_while_there_is_anything_else_to_draw(monkeypatch, tmp_path):
    seen, added = [], threading.Event()

    def film(movie, folder):
        seen.append(movie)
        assert re.findall("Still to come:</b> (.*).</p>", text(report)) == ["the first"]
        return Film(movie.name, "A walk", 1.0, False)

    def panels(value, two):
        added.wait(60.0)
        return [panel("one")]

    monkeypatch.setattr("chilopod.paper.page.report.write_movie", film)
    movie = SimpleNamespace(name="film", stills=())
    two = replace(TWO, panels=lambda value: seen.append("two") or ())
    one = replace(ONE, panels=panels, films=lambda value: [movie], beside=(two,))
    with Report([one, two], CONTEXT, tmp_path) as report:
        reproduce([one, two], CONTEXT, callback=lambda found, section: report.add(found, [section]))
        added.set()
    assert not report.failures
    assert seen == ["two", movie]
    assert 'href="movies/film.html"' in text(report)
    assert '<section id="one"' in text(report)


@pytest.mark.parametrize("what", ["computed", "drawn"])
def test_what_fails_is_said_and_the_others_are_there(monkeypatch, capsys, tmp_path, what):
    one = replace(ONE, rows=lambda value: (), **{"compute" if what == "computed" else "panels": failing})
    monkeypatch.setattr(registry, "load_sections", lambda: (one, TWO))
    assert main(["reproduce", "--out", str(tmp_path), "--json"]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["failures"] == {"one": "ValueError: no <luck>"}
    assert 0 < err.index(str(tmp_path / "index.html")) < err.index("failed: ")
    assert err.splitlines()[-1] == "failed: the first: ValueError: no <luck>"
    html = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "Failed:</b> the first. ValueError: no &lt;luck&gt;" in html
    assert '<section id="two"' in html
    assert RUNNING not in html
    assert main(["--debug", "reproduce", "--out", str(tmp_path), "--json"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_a_figure_that_cannot_be_written_is_no_fault_of_ours(monkeypatch, capsys, tmp_path):
    real = os.replace

    def full(source, target):
        if "one.csv" in str(target):
            raise OSError(errno.ENOSPC, "No space left on device")
        real(source, target)

    monkeypatch.setattr(os, "replace", full)
    monkeypatch.setattr(registry, "load_sections", lambda: (replace(ONE, rows=lambda value: ()), TWO))
    assert main(["reproduce", "--out", str(tmp_path), "--json"]) == 2
    out, err = capsys.readouterr()
    assert err.splitlines()[-1].endswith("one.csv: cannot be written (No space left on device)")
    assert json.loads(out)["rows"]


def test_a_figure_that_cannot_be_drawn_is_no_secret(tmp_path):
    with pytest.raises(ValueError, match="no <luck>"):
        write_report(Found(values={replace(ONE, panels=failing): 1}), tmp_path)


def test_a_reader_may_delete_everything_meanwhile(tmp_path):
    folder = tmp_path / "report"

    def delete(context, report):
        shutil.rmtree(folder, ignore_errors=True)
        return 2

    two = replace(TWO, compute=delete)
    with Report([ONE, two], CONTEXT, folder) as report:
        reproduce([ONE, two], CONTEXT, callback=lambda found, section: report.add(found, [section]))
    assert not report.failures
    assert "quantity 1" in text(report)
    assert (folder / "figures" / "two.png").is_file()


def test_one_that_is_stopped_says_so(tmp_path):
    with pytest.raises(KeyboardInterrupt), Report([ONE, TWO], CONTEXT, tmp_path) as report:
        raise KeyboardInterrupt
    assert RUNNING not in text(report)
    assert f"Stopped: 0 of 2 sections are there. {AGAIN}" in text(report)
    assert "Not computed:</b> the second" in text(report)


def test_a_page_that_cannot_be_written_in_the_end_is_an_error(tmp_path):
    report = Report([ONE], CONTEXT, tmp_path).__enter__()
    report.page.unlink()
    report.page.mkdir()
    with pytest.raises(OutputError, match="folder"):
        report.__exit__(None, None, None)
