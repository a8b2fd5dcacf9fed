"""The workers of a Dask cluster, which see the same folders as this machine.

Dask itself gives what a killed worker was at to another one, and gives up on a machine that has killed several.
"""

from __future__ import annotations

from importlib import import_module
from secrets import token_hex
from typing import TYPE_CHECKING, Any

from frf_ipz.errors import InputError
from frf_ipz.fleet.machine_record import FAILED, MachineRecord
from frf_ipz.fleet.machine_run import MachineTask, run_machine

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from frf_ipz.pipeline.shared_model import SharedModel

EXTRA = "a cluster needs the package 'distributed': pip install 'frf_ipz[cluster]'"
LOST = "the scheduler at {} is gone; machines that were done are whole: start the fleet again for the others"


def run_on_cluster(
    tasks: Sequence[MachineTask], shared: SharedModel | None, *, scheduler: str
) -> Iterator[MachineRecord]:
    """Run machines on the workers of a Dask cluster.

    Parameters
    ----------
    tasks : sequence of MachineTask
        What is to be done.
    shared : SharedModel, optional
        The FE model of the fleet.
    scheduler : str
        Address of the scheduler, as ``tcp://host:8786``.

    Yields
    ------
    MachineRecord
        Of each machine as soon as it is done.

    Raises
    ------
    InputError
        If Dask is not installed, or the scheduler does not answer.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(scheduler, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"no Dask scheduler answers at {scheduler} ({reason}); start one with 'dask scheduler', or name another "
            "with --scheduler tcp://HOST:PORT"
        ) from None
    with client:
        call = token_hex(8)  # of this call: what an earlier one has left on the cluster is not this one's
        model = client.submit(_hold, shared, pure=False, key=f"frf-ipz-model-{call}")
        futures = {
            client.submit(run_machine, task, model, pure=False, key=f"frf-ipz-{task.machine}-{call}"): task
            for task in tasks
        }
        try:
            for future in distributed.as_completed(futures, loop=client.loop):
                task = futures[future]
                if future.status == "finished":
                    yield future.result()
                elif future.status == "cancelled":
                    raise InputError(LOST.format(scheduler))
                else:
                    yield MachineRecord(machine=task.machine, status=FAILED, message=_said(future.exception()))
        except (distributed.CancelledError, OSError):
            raise InputError(LOST.format(scheduler)) from None


def _distributed() -> Any:  # noqa: ANN401  a module without types
    try:
        return import_module("distributed")
    except ImportError:
        raise InputError(EXTRA) from None


def _hold(shared: SharedModel | None) -> SharedModel | None:
    """Give the model, as a result of the cluster: where all workers that have it are killed, it is made again."""
    return shared


def _said(error: BaseException | None) -> str:
    name = type(error).__name__
    if name == "KilledWorker":
        return "the workers that were at it were killed, for want of memory most often"
    return f"the cluster could not run it: {name}: {error}"
