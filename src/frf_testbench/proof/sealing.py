"""Make the cases, put their answers away, and see to it that nobody changes them before they are opened."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from frf_testbench.proof.plan import Folders, Order
from frf_testbench.simulator.cases.case import Case, make_case

SEAL = "seal.json"
NEXT_SEED = 100_000  # added to a seed for which no specimen is found that shows the effect
TRIES = 5

Step = Callable[[], None]


class BrokenSealError(Exception):
    """An answer has changed since it was sealed."""


def make_cases(orders: Sequence[Order], folders: Folders, *, workers: int, step: Step) -> None:
    """Make all cases that are not there yet, and seal the answers.

    Parameters
    ----------
    orders : sequence of Order
        What is to be made.
    folders : Folders
        Where.
    workers : int
        Processes.
    step : callable
        Called after each case.
    """
    missing = [order for order in orders if not is_made(order.name, folders)]
    for _ in range(len(orders) - len(missing)):
        step()
    # not forked: the progress bar has a thread
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(make_sealed_case, order, folders) for order in missing]):
            future.result()
            step()
    seal(folders, [order.name for order in orders])


def is_made(name: str, folders: Folders) -> bool:
    """Whether a case and its answer are there."""
    return (folders.cases / name).is_dir() and (folders.sealed / f"{name}.json").is_file()


def make_sealed_case(order: Order, folders: Folders) -> None:
    """Make one case: the answer is put away before the case appears.

    Parameters
    ----------
    order : Order
        What is to be made.
    folders : Folders
        Where.

    Raises
    ------
    RuntimeError
        If no specimen was found on which the effect can be seen.
    """
    case = _draw_case(order)
    unfinished = folders.cases / f".{order.name}"
    shutil.rmtree(unfinished, ignore_errors=True)
    case.write(unfinished, folders.sealed / f"{order.name}.json")
    case_folder = folders.cases / order.name
    shutil.rmtree(case_folder, ignore_errors=True)  # of a case whose answer is gone: nothing may stand in the way
    unfinished.rename(case_folder)


def _draw_case(order: Order) -> Case:
    for i in range(TRIES - 1):
        try:
            return make_case(order.seed + i * NEXT_SEED, order.effect)
        except RuntimeError:
            continue
    return make_case(order.seed + (TRIES - 1) * NEXT_SEED, order.effect)


def seal(folders: Folders, names: Sequence[str]) -> None:
    """Write down a digest of each answer that has none yet.

    Parameters
    ----------
    folders : Folders
        Where the answers are.
    names : sequence of str
        Cases.
    """
    path = folders.sealed / SEAL
    digests = _read_digests(path)
    new_digests = {name: compute_digest(folders.sealed, name) for name in names if name not in digests}
    if new_digests:
        path.write_text(json.dumps(dict(sorted((digests | new_digests).items())), indent=1) + "\n", encoding="utf-8")


def check_seal(folders: Folders, names: Sequence[str]) -> None:
    """Check answers against their digests; answers of others, without a seal, are taken as they are.

    Parameters
    ----------
    folders : Folders
        Where the answers are.
    names : sequence of str
        Cases.

    Raises
    ------
    BrokenSealError
        If an answer is not what was sealed.
    """
    path = folders.sealed / SEAL
    if not path.is_file():
        return
    digests = _read_digests(path)
    broken = [name for name in names if digests.get(name) != compute_digest(folders.sealed, name)]
    if broken:
        raise BrokenSealError(
            f"the answers of {', '.join(broken[:5])} are not those that were sealed in {path}; "
            f"delete the folder {folders.root} and begin again"
        )


def _read_digests(path: Path) -> dict[str, str]:
    digests: dict[str, str] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return digests


def compute_digest(sealed: Path, name: str) -> str:
    """Compute the SHA-256 of the files of an answer.

    Parameters
    ----------
    sealed : Path
        Folder of the answers.
    name : str
        Of the case.

    Returns
    -------
    str
        Hexadecimal.
    """
    total = hashlib.sha256()
    for suffix in (".json", "_points.csv"):
        path = sealed / f"{name}{suffix}"
        if path.is_file():
            with path.open("rb") as file:
                for block in iter(partial(file.read, 1 << 20), b""):
                    total.update(block)
    return total.hexdigest()
