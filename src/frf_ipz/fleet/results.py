"""What a fleet's folder holds: its tables, its population, and the results of each machine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from frf_ipz.arguments import as_path
from frf_ipz.errors import FileFormatError, InputError, did_you_mean
from frf_ipz.fleet.summary import summarise
from frf_ipz.fleet.tables import FILES
from frf_ipz.input_files import require_regular_file
from frf_ipz.json_files import read_json
from frf_ipz.late_imports import import_late
from frf_ipz.runs.results import Results, open_results

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
else:
    pd = import_late("pandas")

FLEET = "fleet.parquet"
POPULATION, ENSEMBLE, PAGE = "population.json", "population_ensemble.mat", "fleet.html"
MACHINES, PIPELINES, REDUCED = "machines", "pipelines", "reduced"  # folders


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetResults:
    """Results of a fleet.

    Parameters
    ----------
    path : Path
        Its folder.

    Examples
    --------
    >>> import frf_ipz
    >>> results = frf_ipz.open_fleet("results/line3")  # doctest: +SKIP
    >>> results.to_frame("fleet_poles").query("outlier")["machine"].tolist()  # doctest: +SKIP
    ['m07']
    """

    path: Path

    def __repr__(self) -> str:
        return f"FleetResults ({self.path}): {self.summary().splitlines()[0]}"

    @property
    def machines(self) -> tuple[str, ...]:
        """Ids of all machines."""
        return tuple(self.to_frame("fleet")["machine"])

    @property
    def population(self) -> Mapping[str, Any]:
        """Mean and covariance of the updated parameters, as in ``population.json``."""
        return read_json(self.path / POPULATION)

    def to_frame(self, table: str = "fleet") -> pd.DataFrame:
        """Give a table of the fleet.

        Parameters
        ----------
        table : str
            The name of its file without the ending: ``fleet``, ``fleet_poles``, ``fleet_zeros``, ``fleet_parameters``
            or ``fleet_findings``.

        Returns
        -------
        DataFrame
            The table.

        Raises
        ------
        InputError
            If there is no such table, or it cannot be read.
        """
        known = [name.removesuffix(".parquet") for name in FILES]
        if table not in known:
            raise InputError(f"a fleet has no table '{table}'; {did_you_mean(table, known)}")
        file = self.path / f"{table}.parquet"
        require_regular_file(file)
        try:
            return pd.read_parquet(file)
        except (OSError, ValueError) as error:  # errors of Arrow are errors of values
            reason = " ".join(str(error).split())[:200]
            raise FileFormatError(file, f"is damaged ({reason}); start the fleet again") from None

    def open(self, machine: str) -> Results:
        """Open the results of one machine.

        Parameters
        ----------
        machine : str
            Its id.

        Returns
        -------
        Results
            Of its run.

        Raises
        ------
        InputError
            If there is no such machine, or it has no results.
        """
        if machine not in self.machines:
            raise InputError(f"{self.path}: there is no machine '{machine}'; {did_you_mean(machine, self.machines)}")
        return open_results(self.path / MACHINES / machine)

    def summary(self) -> str:
        """Sum up what was found.

        Returns
        -------
        str
            At most a screen of text.
        """
        fleet, poles, findings = (self.to_frame(name) for name in ("fleet", "fleet_poles", "fleet_findings"))
        return f"{summarise(fleet, poles, findings)}\n{'page':<12}{self.path / PAGE}"


def open_fleet(path: str | Path) -> FleetResults:
    """Open the results of a fleet.

    Parameters
    ----------
    path : str or Path
        Its folder.

    Returns
    -------
    FleetResults
        Read when they are asked for.

    Raises
    ------
    InputError
        If no fleet has been run there.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.open_fleet("nowhere")
    Traceback (most recent call last):
        ...
    frf_ipz.errors.InputError: nowhere: there is no fleet here; run one with 'frf-ipz fleet FLEET.toml --out nowhere'
    """
    path = as_path(path)
    if not (path / FLEET).is_file():
        raise InputError(f"{path}: there is no fleet here; run one with 'frf-ipz fleet FLEET.toml --out {path}'")
    return FleetResults(path=path)
