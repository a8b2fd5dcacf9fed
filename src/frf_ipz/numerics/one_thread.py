"""One thread for stages whose matrices are small: several threads of linear algebra would only wait for each other."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def on_one_thread(stage: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let a stage use one thread of linear algebra, and give the others back behind it.

    Parameters
    ----------
    stage : callable
        What is computed.

    Returns
    -------
    callable
        The same, whatever number of threads the process has.
    """

    @wraps(stage)
    def held(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        with threadpool_limits(limits=1, user_api="blas"):
            return stage(*args, **kwargs)

    return held
