"""From hammer tests and a nearly right FE model to a controller-ready model.

The public names, loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"

_HOME = {
    "Dof": "dofs",
    "FitOptions": "identification.options",
    "FrfIpzError": "errors",
    "FrfQuantity": "quantities",
    "FrfSet": "frf",
    "IngestOptions": "ingest.options",
    "InputError": "errors",
    "ReduceOptions": "fe.options",
    "UpdateOptions": "updating.options",
    "estimate_frfs": "ingest.estimate",
    "fit_modes": "identification.fit",
    "load_state_space": "export.state_space",
    "model_frfs": "fe.response",
    "pair": "pairing.assignment",
    "parse_dof": "dofs",
    "predict_frfs": "prediction.predict",
    "read_model": "fe.model_file",
    "read_run": "runs.folder",
    "read_test": "ingest.test_file",
    "reduce_model": "fe.reduction",
    "run_pipeline": "pipeline.run",
    "save_state_space": "export.state_space",
    "solve_modes": "fe.eigen",
    "to_state_space": "export.state_space",
    "update_model": "updating.update",
}

__all__ = sorted(_HOME)  # noqa: PLE0605  the table above is the one list of public names


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
