"""Threads, signals, forks and other interpreters."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import ppa

from conftest import QUICK_XRAY, Files


pytestmark = pytest.mark.usefixtures("listen")


def seconds_until_interrupted(call: Callable[[], Any], after: float) -> float:
    """Send SIGINT to this process and return the time until the call ends."""
    sent: list[float] = []

    def interrupt() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        call()
        timer.join()
        pytest.fail("the call ended before it was interrupted")
    return time.monotonic() - sent[0]


def computes_on() -> bool:
    """Return whether this process is still computing some seconds later."""
    for _ in range(10):
        before = time.process_time()
        time.sleep(0.5)
        if time.process_time() - before < 0.1:
            return False
    return True


def test_ctrl_c_ends_a_radiograph_within_a_second(case: ppa.Case, scene: ppa.Scene) -> None:
    pose = case.place(0, scene=scene)
    pose.radiograph()
    assert seconds_until_interrupted(lambda: pose.radiograph(engine="analog", histories=1e11), 0.5) < 1
    assert not computes_on()
    fine = {"engine": {"scatter_histories": 50_000_000}}
    assert seconds_until_interrupted(lambda: pose.radiograph(xray=fine), 0.5) < 1
    assert not computes_on()


def test_ctrl_c_ends_what_cannot_stop_within_a_second() -> None:
    assert seconds_until_interrupted(lambda: ppa.phantom(spacing_mm=0.5), 0.2) < 1


def test_ctrl_c_ends_a_dataset_that_is_then_resumed(files: Files, tmp_path: Path) -> None:
    plan = ppa.Plan(
        [(files.case, 0)], rotation={"from_deg": 0, "to_deg": 30, "step_deg": 10}, shapes={"variants": ["orig"]}, xray=QUICK_XRAY)
    seen = threading.Event()

    def progress(done: float, total: float) -> None:
        if done >= 1 and not seen.is_set():
            seen.set()
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        ppa.generate(plan, tmp_path / "data", progress=progress)
    assert seen.is_set()
    summary: dict[str, Any] = {}
    deadline = time.monotonic() + 300
    while not summary and time.monotonic() < deadline:
        try:
            summary = ppa.generate(plan, tmp_path / "data")
        except ppa.PpaError:
            # Poses in progress are being finished in the background.
            time.sleep(1)
    assert summary["units"] == 4
    assert summary["made"] < 4


def test_an_exception_of_a_progress_function_ends_the_call(case: ppa.Case, scene: ppa.Scene) -> None:
    class Enough(Exception):
        pass

    def progress(done: float, total: float) -> None:
        raise Enough

    with pytest.raises(Enough):
        case.place(0, scene=scene).radiograph(engine="analog", histories=1e11, progress=progress)


def test_other_threads_run_meanwhile(case: ppa.Case, scene: ppa.Scene) -> None:
    pose, turns, over = case.place(0, scene=scene), [0], threading.Event()

    def count() -> None:
        while not over.is_set():
            turns[0] += 1
            time.sleep(0.005)

    counter = threading.Thread(target=count)
    counter.start()
    pose.radiograph(engine="analog", seconds=1)
    over.set()
    counter.join()
    assert turns[0] > 20


def test_calls_from_several_threads_agree(case: ppa.Case, scene: ppa.Scene) -> None:
    pose, images = case.place(0, scene=scene), []
    callers = [
        threading.Thread(target=lambda t=t: images.append(pose.radiograph(threads=t).total.tobytes()))
        for t in (1, 2, 3, None)
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(set(images)) == 1 and len(images) == 4


def test_a_call_takes_less_than_a_tenth_of_a_millisecond() -> None:
    """Overhead of a call whose work is negligible: the fastest of many, since other programs run too."""
    quickest = float("inf")
    for _ in range(2000):
        begin = time.perf_counter()
        ppa.permutation_test([1.0, 2.0], [0.5, 1.5])
        quickest = min(quickest, time.perf_counter() - begin)
    assert quickest < 1e-4


VIEWS = """
import os
from pathlib import Path
import ppa
def used():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
fine = ppa.phantom(spacing_mm=1.5)
case = ppa.prepare(fine, "r")
poses = [case.place(0)]
voxels, before = fine.voxels.nbytes, used()
views = [fine.voxels for _ in range(30)] + [case.volume.voxels for _ in range(30)]
poses += [case.place(angle) for angle in range(30)]
assert used() - before < 3 * voxels, "views and poses"
copies = [view.copy() for view in views[:30]]
assert used() - before > 10 * voxels, "copies"
assert len(poses) == len(copies) + 1
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not say how much memory is used")
def test_views_cases_and_poses_take_no_memory_for_voxels() -> None:
    # In a separate process, since memory freed by other tests would be reused.
    ran = subprocess.run([sys.executable, "-c", VIEWS], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


FORK = """
import os, sys, time
import numpy as np, ppa
transport = ppa.Transport(np.zeros((4, 4, 4), np.uint8), np.ones((4, 4, 4), np.float32), ["water"], np.eye(4))
pose = np.eye(4); pose[2, 3] = -1000
def image():
    return transport.radiograph(pose, 1100.0, xray={"detector": {"columns": 8, "rows": 8, "pixel_mm": 4.0}}).total.tobytes()
before = image()
child = os.fork()
if child == 0:
    os._exit(0 if image() == before else 3)
for _ in range(600):
    done, status = os.waitpid(child, os.WNOHANG)
    if done:
        sys.exit(os.waitstatus_to_exitcode(status))
    time.sleep(0.1)
os.kill(child, 9)
sys.exit(4)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_forked_process_computes_on() -> None:
    ran = subprocess.run([sys.executable, "-c", FORK], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


SUBINTERPRETER = """
import sys
try:
    import _interpreters as interpreters
except ImportError:
    import _xxsubinterpreters as interpreters
import ppa
other = interpreters.create()
code = '''
try:
    import ppa
except ImportError as error:
    assert "interpreter" in str(error), error
else:
    raise AssertionError("it was imported")
'''
failed = interpreters.exec(other, code) if hasattr(interpreters, "exec") else interpreters.run_string(other, code)
sys.exit(0 if failed is None else str(failed))
"""


def test_a_second_interpreter_is_refused() -> None:
    ran = subprocess.run([sys.executable, "-c", SUBINTERPRETER], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def test_ctrl_c_ends_the_program_of_the_package_as_any_program(files: Files, tmp_path: Path) -> None:
    script = Path(sys.executable).parent / "ppa"
    if not script.exists():
        pytest.skip("the package is not installed")
    out = tmp_path / "data"
    running = subprocess.Popen(
        [script, "generate", files.plan, "--out", out], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        if (out / "dataset.json").exists():
            break
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130, said
    assert "stopped" in said
    assert "Traceback" not in said
