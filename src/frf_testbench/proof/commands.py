"""Run the public command in processes of their own, with what they cost; what is done already is not done again."""

from __future__ import annotations

import hashlib
import json
import os
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
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

Step = Callable[[], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """How a command went.

    Parameters
    ----------
    status : int
        Its exit status; negative where it was stopped.
    message : str
        Last line that it wrote to the error stream.
    wall_s, cpu_s : float
        Time it took, and processor time with all its threads.
    code : str
        Digest of the package that ran.
    """

    status: int
    message: str
    wall_s: float
    cpu_s: float
    code: str


def public_command() -> list[str]:
    """Return the command that a user types, of the environment that runs this."""
    return [str(Path(sys.executable).with_name("frf-ipz"))]


def code_digest() -> str:
    """Digest of the package's source: what it diagnosed before a change is diagnosed again."""
    root = Path(frf_ipz.__file__).parent
    total = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        total.update(str(path.relative_to(root)).encode())
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
        if not is_done(logs, name, code):
            done = [Done(status=0, message="", wall_s=0.0, cpu_s=0.0, code=code)]
            for command in jobs[name]():
                done.append(run(command, code=code))
                if done[-1].status:
                    break
            last = done[-1]
            total = Done(
                status=last.status,
                message=last.message,
                wall_s=sum(one.wall_s for one in done),
                cpu_s=sum(one.cpu_s for one in done),
                code=code,
            )
            (logs / f"{name}.json").write_text(json.dumps(asdict(total), indent=1) + "\n", encoding="utf-8")
        step()

    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(work, name) for name in jobs]:
            done.result()


def is_done(logs: Path, name: str, code: str) -> bool:
    """Whether a case has been worked on by this code."""
    done = read_done(logs, name)
    return done is not None and done.code == code


def read_done(logs: Path, name: str) -> Done | None:
    """Read how a command went; None where it has not run."""
    path = logs / f"{name}.json"
    return Done(**json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def run(command: Sequence[str], *, code: str, longest_s: float = LONGEST_S) -> Done:
    """Run one command and wait for it.

    Parameters
    ----------
    command : sequence of str
        What a user would type.
    code : str
        Digest of the package.
    longest_s : float
        It is stopped after this time.

    Returns
    -------
    Done
        How it went.
    """
    started = time.perf_counter()
    process = subprocess.Popen(
        command,
        env={**os.environ, **ONE_THREAD},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    alarm = threading.Timer(longest_s, lambda: os.killpg(process.pid, signal.SIGKILL))
    alarm.start()
    said = process.stderr.read().decode(errors="replace").strip().splitlines()
    process.stderr.close()
    _, status, usage = os.wait4(process.pid, 0)
    alarm.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return Done(
        status=process.returncode,
        message=said[-1] if said else "",
        wall_s=round(time.perf_counter() - started, 2),
        cpu_s=round(usage.ru_utime + usage.ru_stime, 2),
        code=code,
    )
