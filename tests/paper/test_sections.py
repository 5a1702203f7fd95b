"""The registry of sections, and how they are computed."""

import os
import re
import signal
import time
from concurrent.futures import CancelledError, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial

import pytest

from chilopod.errors import ParameterError
from chilopod.paper import ahead, duration
from chilopod.paper.ahead import Studio, walked_ahead
from chilopod.paper.measures import kept
from chilopod.paper.registry import REGISTRY, chosen, load_sections
from chilopod.paper.robot.sections import FILMS
from chilopod.paper.section import Context, Found, Section, Size, reproduce
from chilopod.paper.straight.sections import MODE, UNIFORM
from chilopod.paper.table import Result, Row, Verdict
from chilopod.trials import batch

SECTIONS = load_sections()


def names(sections):
    return [section.name for section in sections]


def test_every_section_is_registered_by_its_name():
    assert tuple(names(SECTIONS)) == tuple(REGISTRY)
    assert {each for section in SECTIONS for each in section.beside} <= set(SECTIONS)


def test_the_papers_own_experiments_come_first_and_what_is_needed_comes_before():
    beyond = [section.beyond for section in SECTIONS]
    assert beyond == sorted(beyond)
    for index, section in enumerate(SECTIONS):
        assert set(section.needs) <= set(SECTIONS[:index]), section.name


def test_sections_come_in_their_own_order_and_misspelt_ones_are_refused():
    assert names(chosen(["uniform", "mode"])) == ["mode", "uniform"]
    with pytest.raises(ParameterError, match="uniform"):
        chosen(["unifrom"])


def test_what_is_left_out_unless_it_is_named():
    everything = set(names(chosen()))
    assert set(names(SECTIONS)) - everything == {"robot-structures", "robot-why-sets"}
    assert names(chosen(size=Size.FULL)) == names(chosen())
    headlines, others = (
        {"identification", "robot-why", "courses", "scaling"},
        {"robot-spread", "robot-numerics", "atlas"},
    )
    others |= {"robot-courses", "courses-movie", "robot-strategies", "courses-robust"}
    assert everything - set(names(chosen(size=Size.MAIN))) == others
    named = chosen(["robot-structures", "robot-spread"], Size.QUICK)
    assert names(named) == ["robot-spread", "robot-structures"]
    paper = names(chosen(paper=True))
    assert names(chosen(size=Size.QUICK)) == paper
    assert everything - set(paper) == headlines | others
    with pytest.raises(ParameterError, match="robot-why"):
        chosen(["robot-why"], paper=True)


def test_rows_put_the_paper_beside_what_was_computed():
    seen = []
    found = reproduce([MODE, UNIFORM], progress=lambda what, done, words: seen.append((what, done)))
    assert list(found.values) == [MODE, UNIFORM]
    assert not found.failures
    (rows,) = found.planar_rows().values()
    verdicts = {row.quantity: row.verdict for row in rows}
    assert verdicts["critical k1"] == "agrees"
    assert verdicts["critical mode, joint 1"] == "agrees"
    assert seen[-1] == (UNIFORM.sentence, 1.0)


def test_a_main_report_has_the_papers_experiments_in_full_and_headlines_from_fewer_trials():
    seen = {}
    for name, beyond in (("paper", False), ("beyond", True)):
        section = Section(name, "chapter", name, lambda context, report: context.size, beyond=beyond, headline=beyond)
        seen[name] = reproduce([section], Context(size=Size.MAIN))[section]
    assert seen == {"paper": Size.FULL, "beyond": Size.QUICK}


def test_the_plan_says_what_a_report_has_and_how_long_it_takes(monkeypatch):
    monkeypatch.setattr(duration, "pace", lambda: 2.0)
    for size, words, larger in (
        (Size.QUICK, "The paper's main experiments", "Without --quick"),
        (Size.MAIN, "one headline of every chapter beyond", "--all adds"),
        (Size.FULL, "everything beyond", ""),
    ):
        planned = duration.plan(chosen(size=size), size)
        for said, lasting in (
            (planned.words(), r": about [\d.]+ (minutes|hours) here"),
            (planned.words(180.0), "; it took about 3 min"),
        ):
            assert re.search(rf"{words}.*{lasting}", said)
            assert (larger in said) if larger else ("--all" not in said)
    assert duration.plan([MODE], Size.FULL, named=True).words() == "1 of all sections: less than a minute."
    assert set(duration.SECONDS) <= set(REGISTRY)


def test_sections_that_are_walked_beside_others_take_no_longer_than_the_longer_part(monkeypatch):
    sections = chosen(size=Size.MAIN)
    monkeypatch.setattr(duration, "cores", lambda: 1)
    beside, others = ([each for each in sections if each.ahead is apart] for apart in (True, False))
    parts = [duration.seconds(part, Size.MAIN) for part in (beside, others)]
    assert duration.seconds(sections, Size.MAIN) == sum(parts)
    monkeypatch.setattr(duration, "cores", lambda: 2)
    assert max(parts) < duration.seconds(sections, Size.MAIN) < sum(parts)
    assert duration.seconds(beside, Size.MAIN) == parts[0]


def one(value):
    return Row("one", "1", Result(str(value)), "here", Verdict.AGREES)


ONE = Section("one", "chapter", "one", lambda context, report: 1, lambda value: [one(value)])


def test_a_section_sees_what_it_needs_where_that_was_computed():
    two = Section("two", "chapter", "two", lambda context, report, one: (one or 0) + 1, needs=(ONE,))
    assert reproduce([ONE, two])[two] == 2
    assert reproduce([two])[two] == 1


def test_numbers_that_a_full_disk_does_not_keep_are_given_all_the_same(tmp_path, monkeypatch, caplog):
    context, calls = Context(), []

    def again():
        return kept(tmp_path / "trials", context.whole, "how", lambda: calls.append(1) or [2.5])

    with monkeypatch.context() as full:
        full.setattr(os, "replace", lambda *_: os.stat(tmp_path / "nowhere"))
        assert [again(), again()] == [[2.5], [2.5]]
    assert [each.getMessage() for each in caplog.records] == [
        f"{tmp_path / 'multipliers'}: multipliers are not kept: cannot be written (No such file or directory)"
    ]
    assert [again(), again(), len(calls)] == [[2.5], [2.5], 3]


def test_one_that_fails_leaves_the_others_alone():
    def fail(context, report):
        raise ValueError("no luck")

    broken = Section("broken", "chapter", "broken", fail)
    after = Section("after", "chapter", "after", lambda context, report, before: before, needs=(broken,))
    told = []
    found = reproduce([broken, ONE, after], Context(size=Size.QUICK), callback=lambda _, section: told.append(section))
    assert told == [broken, ONE, after]
    assert [str(error) for error in found.failures.values()] == ["no luck"]
    assert found[ONE] == 1
    assert after in found.values
    assert found[after] is None
    assert repr(found.planar_rows()) == repr({"chapter": [one(1)]})  # NaN differs from itself


def test_lines_stand_by_chapter():
    rows = {MODE: [one(1)], ONE: [one(2)], UNIFORM: [one(3)]}
    shown = {MODE.chapter: [one(1), one(3)], "chapter": [one(2)]}
    assert repr(Found(rows=rows).planar_rows()) == repr(shown)  # NaN differs from itself


def test_trials_that_another_process_walks_ahead_are_those_that_this_one_walks(tmp_path, monkeypatch):
    one, two = (Context(size=Size.TINY, folder=tmp_path / name) for name in ("one", "two"))
    with walked_ahead([FILMS], one) as ready:
        assert not ready(FILMS)  # there is nothing to do meanwhile
        reproduce([FILMS], one, ready=ready)
    walked, told, last = [], [], time.monotonic() + 120.0
    monkeypatch.setattr(batch, "walked", lambda trials: walked.append(trials))
    other = Section("other", "chapter", "other", lambda context, report: 1)
    with walked_ahead(sections := [ONE, other, FILMS], two) as ready:
        while not ready(FILMS) and time.monotonic() < last:
            time.sleep(0.05)
        found = reproduce(sections, two, callback=lambda _, section: told.append(section), ready=ready)
    assert told == [ONE, FILMS, other]
    assert walked == []
    assert not found.failures
    records = [{path.name: path.read_bytes() for path in each.folder.iterdir()} for each in (one, two)]
    assert len(records[0]) == 6
    assert records[0] == records[1]


def test_work_is_done_in_a_studio_and_here_where_that_is_none_or_was_killed(monkeypatch):
    monkeypatch.setattr(ahead, "cores", lambda: 2)
    studio = Studio()
    assert studio.do(os.getpid) == os.getpid()
    studio.begin()
    other = studio.do(os.getpid)
    assert other != os.getpid()
    assert studio.do(partial(signal.getsignal, signal.SIGINT)) == signal.SIG_IGN  # Ctrl-C is this process's affair
    with pytest.raises(ZeroDivisionError):
        studio.do(partial(divmod, 1, 0))
    os.kill(other, signal.SIGKILL)
    assert studio.do(os.getpid) == os.getpid()
    studio.end()


def test_a_studio_that_ends_at_once_leaves_its_work(monkeypatch):
    monkeypatch.setattr(ahead, "cores", lambda: 2)
    studio = Studio()
    studio.begin()
    studio.do(os.getpid)
    with ThreadPoolExecutor(1) as thread:
        work = thread.submit(studio.do, partial(time.sleep, 3600.0))
        studio.end(at_once=True)
        assert isinstance(work.exception(), (BrokenProcessPool, CancelledError, RuntimeError))
