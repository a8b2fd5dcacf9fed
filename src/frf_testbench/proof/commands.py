"""Run the public command in processes of their own, with what they cost; what is done already is not done again."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import frf_ipz

LONGEST_S = 900.0  # of one command
STOPPED = -9  # exit status of a command that took too long: of SIGKILL, on every system
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

Step = Callable[[], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandOutcome:
    """How a command went.

    Parameters
    ----------
    status : int
        Its exit status; negative where it was stopped.
    message : str
        Last line that it wrote to the error stream.
    wall_s : float
        Time it took.
    cpu_s : float or None
        Processor time with all its threads and children; None where the system does not tell.
    code : str
        Digest of the package that ran.
    """

    status: int
    message: str
    wall_s: float
    cpu_s: float | None
    code: str


def find_public_command() -> list[str]:
    """Find the command that a user types, of the environment that runs this.

    Returns
    -------
    list of str
        Its path, or the interpreter with the module where no script is installed.
    """
    script = shutil.which("frf-ipz", path=str(Path(sys.executable).parent))
    return [script] if script else [sys.executable, "-m", "frf_ipz.cli.main"]


def compute_code_digest() -> str:
    """Digest the package's source: what it diagnosed before a change is diagnosed again."""
    root = Path(frf_ipz.__file__).parent
    total = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        total.update(path.relative_to(root).as_posix().encode())
        total.update(path.read_bytes())
    return total.hexdigest()[:16]


def run_all(
    jobs: Mapping[str, Callable[[], Sequence[Sequence[str]]]], logs: Path, *, workers: int, code: str, step: Step
) -> None:
    """Run one chain of commands for each case.

    Parameters
    ----------
    jobs : mapping of str to callable
        Case names, and what gives its commands, which run one after the other until one fails.
    logs : Path
        Folder of what they cost: `<name>.json`. A case that has one of the same code is left alone.
    workers : int
        Commands at the same time.
    code : str
        Digest of the package.
    step : callable
        Called after each case.
    """
    logs.mkdir(parents=True, exist_ok=True)

    def work(name: str) -> None:
        if not is_finished(logs, name, code):
            outcome = run_chain(jobs[name](), code=code)
            (logs / f"{name}.json").write_text(json.dumps(asdict(outcome), indent=1) + "\n", encoding="utf-8")
        step()

    with ThreadPoolExecutor(workers) as pool:
        for future in [pool.submit(work, name) for name in jobs]:
            future.result()


def run_chain(commands: Sequence[Sequence[str]], *, code: str) -> CommandOutcome:
    """Run commands one after the other until one fails.

    Parameters
    ----------
    commands : sequence of sequence of str
        What a user would type.
    code : str
        Digest of the package.

    Returns
    -------
    CommandOutcome
        Of the last one that ran, with the cost of all.
    """
    outcomes: list[CommandOutcome] = []
    for command in commands:
        outcomes.append(run(command, code=code))
        if outcomes[-1].status:
            break
    costs = [outcome.cpu_s for outcome in outcomes if outcome.cpu_s is not None]
    return CommandOutcome(
        status=outcomes[-1].status if outcomes else 0,
        message=outcomes[-1].message if outcomes else "",
        wall_s=sum(outcome.wall_s for outcome in outcomes),
        cpu_s=sum(costs) if len(costs) == len(outcomes) else None,
        code=code,
    )


def is_finished(logs: Path, name: str, code: str) -> bool:
    """Whether a case has been worked on by this code."""
    outcome = read_outcome(logs, name)
    return outcome is not None and outcome.code == code


def read_outcome(logs: Path, name: str) -> CommandOutcome | None:
    """Read how a command went; None where it has not run."""
    path = logs / f"{name}.json"
    return CommandOutcome(**json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def run(command: Sequence[str], *, code: str, longest_s: float = LONGEST_S) -> CommandOutcome:
    """Run one command and wait for it.

    Parameters
    ----------
    command : sequence of str
        What a user would type.
    code : str
        Digest of the package.
    longest_s : float
        It is stopped after this time, with all processes that it has started.

    Returns
    -------
    CommandOutcome
        How it went.
    """
    start = time.perf_counter()
    process = subprocess.Popen(
        command,
        env={**os.environ, **ONE_THREAD},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,  # a group of its own, so that it can be stopped as a whole; Windows ignores it
    )
    has_ended = threading.Event()
    was_stopped = threading.Event()

    def stop() -> None:
        if not has_ended.is_set():
            was_stopped.set()
            _stop_process_tree(process)

    alarm = threading.Timer(longest_s, stop)
    alarm.start()
    lines = _read_error_stream(process)
    status, cpu_s = _wait(process)
    has_ended.set()
    alarm.cancel()
    return CommandOutcome(
        status=STOPPED if was_stopped.is_set() else status,
        message=lines[-1] if lines else "",
        wall_s=round(time.perf_counter() - start, 2),
        cpu_s=None if cpu_s is None else round(cpu_s, 2),
        code=code,
    )


def _read_error_stream(process: subprocess.Popen[bytes]) -> list[str]:
    if process.stderr is None:
        return []
    with process.stderr as stream:
        return stream.read().decode(errors="replace").strip().splitlines()


def _wait(process: subprocess.Popen[bytes]) -> tuple[int, float | None]:
    """Wait for a process: its exit status, and its processor time where the system tells it."""
    if not hasattr(os, "wait4"):
        return process.wait(), None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_utime + usage.ru_stime


def _stop_process_tree(process: subprocess.Popen[bytes]) -> None:
    """Stop a process and all that it has started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):  # it has ended just now
            os.killpg(process.pid, signal.SIGKILL)
        return
    taskkill = shutil.which("taskkill")
    if taskkill:
        subprocess.run([taskkill, "/F", "/T", "/PID", str(process.pid)], check=False, capture_output=True)
    process.kill()
