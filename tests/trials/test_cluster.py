"""Trials on a cluster: the same bits as here, whatever is killed meanwhile.

CHILOPOD_KILLS says how often each kind of process is killed, each time at another moment; once by default.
"""

import contextlib
import importlib
import os
import random
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import distributed
import psutil
import pytest

from chilopod import load_robot
from chilopod.cli import main
from chilopod.errors import AnalysisError, ClusterError, ParameterError
from chilopod.steering import LegYawController, Target
from chilopod.trials import Cluster, Here, Trial, run, using

KILLS = range(int(os.environ.get("CHILOPOD_KILLS", "1")))
ROBOT = load_robot("aoi2022-planar")
BASE = Trial(ROBOT, 15.0, target=Target(0.7, 1.3), controller=LegYawController(), rate=20.0)
TRIALS = [replace(BASE, seed=seed) for seed in range(96)]
PATIENCE = 60.0  # s, on a busy machine
CONTROLLERS = '''
    """Controllers of somebody's own."""

    import os
    import signal
    from dataclasses import dataclass

    import numpy as np

    from chilopod.engine import Command, Event


    @dataclass(frozen=True)
    class Counted:
        """Does nothing, and writes down how many robots it was asked for at the start of a walk."""

        log: str

        def events(self, gait):
            return [Event("once a cycle", 0.0, 0.1)]

        def act(self, event, seen):
            if seen.time < 0.01:
                with open(self.log, "a") as file:
                    file.write(f"{len(seen.bearing)}\\n")
            return Command(leg_yaw=np.zeros((len(seen.bearing), 2)), within=0.1)


    @dataclass(frozen=True)
    class Deadly(Counted):
        """Kills the process that it runs in."""

        def act(self, event, seen):
            os.kill(os.getpid(), signal.SIGKILL)


    @dataclass(frozen=True)
    class Faulty(Counted):
        def act(self, event, seen):
            raise ZeroDivisionError("no way")
'''
CLIENT = """
    import sys
    from pathlib import Path

    from chilopod import load_robot
    from chilopod.cli import main
    from chilopod.steering import LegYawController, Target
    from chilopod.trials import Cluster, Trial, run

    if __name__ == "__main__":
        robot = load_robot("aoi2022-planar")
        asked = [
            Trial(robot, 15.0, seed, target=Target(0.7, 1.3), controller=LegYawController(), rate=20.0)
            for seed in range(96)
        ]
        with Cluster(2) as cluster:
            run(asked, sys.argv[1], executor=cluster)
"""


@pytest.fixture(scope="module")
def controllers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("path")
    (folder / "somebodys_own.py").write_text(textwrap.dedent(CONTROLLERS))
    sys.path.insert(0, str(folder))
    import somebodys_own

    yield somebodys_own
    sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def cluster(controllers):
    with Cluster(2) as there:
        yield there


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """What the files of all trials are, walked here."""
    folder = tmp_path_factory.mktemp("here")
    run(TRIALS, folder)
    return contents(folder)


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def written(folder):
    """When every file was."""
    return {file.name: file.stat().st_mtime_ns for file in folder.glob("*.nc")}


def resumed_as_if_nothing_was(folder, uninterrupted):
    """Go on here; what was there stays as it was, and all is there in the end."""
    before = written(folder)
    run(TRIALS, folder)
    after = written(folder)
    assert {name: after[name] for name in before} == before
    assert {name: content for name, content in contents(folder).items() if name in after} == uninterrupted
    return len(before)


def worker_processes(pid=None):
    """Those a client started, by what they are called."""
    return [
        child
        for child in psutil.Process(pid).children(recursive=True)
        if "spawn_main" in " ".join(child.cmdline()) and child.status() != psutil.STATUS_ZOMBIE
    ]


def gone(processes):
    _, alive = psutil.wait_procs(processes, timeout=PATIENCE)
    return not alive


@contextlib.contextmanager
def started(*arguments, **environment):
    """A client in a session of its own, which never outlives the test."""
    client = subprocess.Popen(
        [sys.executable, *arguments],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | environment,
        # In the background of a script Ctrl-C is ignored, by children too.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        yield client
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(client.pid, signal.SIGKILL)
        client.communicate()


def waited_for(what):
    end = time.monotonic() + PATIENCE
    while not (found := what()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return found


@pytest.fixture
def scheduler(tmp_path):
    """A cluster as somebody starts it by hand: its address, the process, and what adds a worker."""
    file, processes = tmp_path / "scheduler.json", []

    def start(kind, *arguments, **environment):
        module = f"distributed.cli.dask_{kind}"
        command = [sys.executable, "-m", module, *arguments, "--scheduler-file", str(file), "--no-dashboard"]
        processes.append(
            subprocess.Popen(command, env=os.environ | environment, stderr=subprocess.DEVNULL, start_new_session=True)
        )
        return processes[-1]

    first = start("scheduler", "--host", "127.0.0.1", "--port", "0")
    import json

    address = waited_for(lambda: file.exists() and file.read_text() and json.loads(file.read_text())["address"])

    def worker(**environment):
        return start("worker", "--nthreads", "1", "--local-directory", str(tmp_path / "work"), **environment)

    yield address, first, worker
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


# ---- the same records -----------------------------------------------------------------------------------------------


def test_records_are_the_same_to_the_bit_wherever_they_walk(cluster, tmp_path):
    whole = load_robot("aoi2022")
    trials = [*TRIALS[:10], *(Trial(ROBOT, 5.0, seed) for seed in range(5))]
    trials += [
        Trial(whole, 0.5, seed, target=BASE.target, controller=BASE.controller, engine="twin") for seed in (1, 2)
    ]
    here = run(trials, tmp_path / "here", executor=Here())
    told = []
    with using(cluster):
        there = run(trials, tmp_path / "two", lambda done, words: told.append((done, words)))
    assert contents(tmp_path / "here") == contents(tmp_path / "two")
    for one, other in zip(here, there, strict=True):
        assert one.identical(other)
    parts = [part for part, _ in told]
    assert parts == sorted(parts)
    assert len(parts) > 8
    assert any("2 workers" in words for _, words in told)


def test_a_stranger_on_this_machine_is_refused(cluster):
    address = cluster._client.cluster.scheduler_address
    assert address.startswith("tls://127.0.0.1:")
    with pytest.raises(ClusterError, match=r"does not answer|must be a dask scheduler"):
        Cluster(address)
    with pytest.raises(ClusterError, match=r"does not answer|must be a dask scheduler"):
        Cluster(address.replace("tls:", "tcp:"))
    with pytest.raises((OSError, RuntimeError)):
        distributed.Client(address, security=distributed.Security.temporary(), timeout=2)


@pytest.mark.parametrize("folder", [True, False])
def test_a_worker_with_another_text_of_a_controller_is_refused(cluster, controllers, tmp_path, folder, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # it would not see a change within a second
    name = f"another_{folder}"
    file = Path(controllers.__file__).with_name(f"{name}.py")
    file.write_text("from somebodys_own import *\nclass Another(Counted):\n    gain = 1\n")
    own = importlib.import_module(name)
    file.write_text(file.read_text().replace("gain = 1", "gain = 2"))
    asked = [replace(BASE, duration=0.7, controller=own.Another(str(tmp_path / "log")))]
    with pytest.raises(ClusterError, match=rf"the code of {name}:Another, or of what it imports, differs between"):
        run(asked, tmp_path / "kept" if folder else None, executor=cluster)
    assert not list(tmp_path.glob("kept/*"))


def test_a_worker_with_other_sources_is_refused(cluster, monkeypatch):
    monkeypatch.setattr("chilopod.trials.on_worker.digest", lambda: "0" * 64)
    with pytest.raises(ClusterError, match=r"source code of chilopod is \w{12} on a worker and 0{12} here"):
        run([replace(BASE, duration=0.7)], executor=cluster)


def test_batches_are_shared_out_evenly(cluster):
    cut = list(cluster.cut([TRIALS[:32]] * 6 + [TRIALS[:8]]))
    assert [trial for piece in cut for trial in piece] == TRIALS[:32] * 6 + TRIALS[:8]
    assert max(map(len, cut)) <= 13
    assert list(cluster.cut([])) == []


# ---- kill -9 --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", KILLS)
def test_a_worker_that_is_killed_is_replaced_and_nothing_walks_twice(cluster, controllers, tmp_path, seed):
    log = tmp_path / "log"
    counted = [replace(trial, controller=controllers.Counted(str(log))) for trial in TRIALS]
    moment = random.Random(seed).uniform(0.1, 0.8)
    killed = []

    def kill(done, words):
        if done > moment and not killed:
            killed.append(random.Random(seed).choice(worker_processes()))
            killed[0].kill()

    there = run(counted, tmp_path / "there", kill, cluster)
    # After its walk each controller is shown the observations once more.
    walks = 0.5 * sum(int(line) for line in log.read_text().split())
    assert killed
    # A worker has two batches, and there may be one more on its way back.
    assert len(TRIALS) <= walks <= len(TRIALS) + 3 * max(map(len, cluster.cut([TRIALS])))
    here = run(counted)
    assert all(one.identical(other) for one, other in zip(here, there, strict=True))
    waited_for(lambda: len(worker_processes()) == 2)


@pytest.mark.parametrize("seed", KILLS)
def test_a_client_that_is_killed_takes_its_workers_along_and_loses_nothing(tmp_path, uninterrupted, seed):
    script, folder = tmp_path / "client.py", tmp_path / "trials"
    script.write_text(textwrap.dedent(CLIENT))
    folder.mkdir()
    rng = random.Random(seed)
    enough = rng.randrange(1, 60)
    with started(str(script), str(folder)) as client:
        waited_for(lambda: len(written(folder)) >= enough)
        time.sleep(rng.uniform(0.0, 0.2))
        workers = worker_processes(client.pid)
        client.kill()
        client.wait()
        assert len(workers) == 2
        assert gone(workers)
    assert resumed_as_if_nothing_was(folder, uninterrupted) >= enough


@pytest.mark.parametrize("seed", KILLS)
def test_a_scheduler_that_is_killed_ends_in_one_line_and_loses_nothing(
    scheduler, controllers, tmp_path, uninterrupted, seed
):
    address, process, worker = scheduler
    worker()
    folder = tmp_path / "trials"
    moment = random.Random(seed).uniform(0.05, 0.7)

    def kill(done, words):
        if done > moment and process.poll() is None:
            process.kill()
            process.wait()

    with waited_for_workers(address) as there:
        # A controller that its worker cannot import is one line, and it goes on.
        with pytest.raises(ParameterError, match="somebodys_own"):
            run([replace(BASE, duration=3.0, controller=controllers.Counted(""))], executor=there)
        with pytest.raises(ClusterError, match="the scheduler was lost"):
            run(TRIALS, folder, kill, there)
    assert resumed_as_if_nothing_was(folder, uninterrupted) > moment * len(TRIALS)


def waited_for_workers(address):
    def there():
        try:
            return Cluster(address)
        except ClusterError as error:
            if "must have at least one worker" not in str(error):
                raise
            return None

    return waited_for(there)


def test_an_interrupted_client_says_so_and_leaves_no_process(tmp_path):
    arguments = ["aoi2022-planar", "--cluster", "2", "--seed", "1", "--repeats", "3000", "--duration", "200 s"]
    with started("-m", "chilopod", "walk", *arguments, TMPDIR=str(tmp_path)) as client:
        assert any("of 3000" in line for line in client.stderr)  # first it says that it waits for the workers
        workers = waited_for(lambda: worker_processes(client.pid))
        assert len(workers) == 2
        os.killpg(client.pid, signal.SIGINT)
        _, rest = client.communicate(timeout=PATIENCE)
        assert [line for line in rest.splitlines() if not line.startswith(("walk:", "stopping ..."))] == [
            "error: interrupted"
        ]
        assert client.returncode == 130
        assert gone(workers)
    assert list(tmp_path.iterdir()) == []


# ---- what goes wrong ------------------------------------------------------------------------------------------------


def test_a_batch_that_kills_its_workers_is_named_when_all_else_is_done(cluster, controllers, tmp_path, monkeypatch):
    # A worker takes seconds to start: one death in company and one alone, in place of two each.
    monkeypatch.setattr(cluster._client.cluster.scheduler, "allowed_failures", 0)
    deadly = replace(BASE, duration=3.0, seed=77, controller=controllers.Deadly(""))
    with pytest.raises(ClusterError, match=r"repeatedly.*planar, aoi2022-planar, 3 s, seeds 77$"):
        run([deadly, *TRIALS[:20]], tmp_path, executor=cluster)
    assert set(written(tmp_path)) == {trial.file_name for trial in TRIALS[:20]}


def test_a_fault_of_a_controller_is_what_it_would_be_here(cluster, controllers):
    with pytest.raises(AnalysisError, match="ZeroDivisionError: no way"):
        run([replace(BASE, duration=3.0, controller=controllers.Faulty(""))], executor=cluster)


def test_a_worker_of_another_version_is_refused(scheduler, tmp_path):
    address, _, worker = scheduler
    other = tmp_path / "other" / "chilopod-9.9.9.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: chilopod\nVersion: 9.9.9\n")
    worker(PYTHONPATH=os.pathsep.join([str(other.parent), *sys.path]))
    with pytest.raises(ClusterError, match=r"chilopod is 9\.9\.9 on a worker and"):
        waited_for_workers(address)


def refused(capsys, *arguments):
    begin = time.monotonic()
    assert main(["walk", "aoi2022-planar", "--cluster", *arguments]) == 2
    assert time.monotonic() - begin < 15.0
    *waiting, line = capsys.readouterr().err.splitlines()
    assert all(each.startswith("walk: ") for each in waiting)  # for an answer
    return line


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("0", "1 to 1000"), ("-3", "1 to 1000"), ("tcp://127.0.0.1:1", "does not answer"),
        ("nonsense://x:1", "nonsense"), ("somewhere", "missing port"),
    ],
)  # fmt: skip
def test_a_cluster_that_is_not_there_is_one_line(capsys, where, words):
    assert words in refused(capsys, where)


def test_without_dask_the_line_says_what_to_install(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "chilopod[cluster]" in refused(capsys, "2")
