"""The pictures of a fleet: how far each pole, zero and parameter of each machine is from the others'."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.picture import Axis, Layer, Line, Panel, Picture, Points, Role

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.fleet.analysis import FleetAnalysis, FleetRoots
    from frf_ipz.fleet.drift import Drift
    from frf_ipz.fleet.population import Population

STRIP = 0.7  # of the distance between two modes, over which the machines of one are spread
MOST_TICKS = 40  # with a text
PERCENT = "{text}: {y:.3g} %"


def draw_spread(analysis: FleetAnalysis, roots: FleetRoots, *, frf: str = "", name: str) -> Picture:
    """Show frequency and damping of each mode, or zero of an FRF, of every machine against the mean.

    Parameters
    ----------
    analysis : FleetAnalysis
        Names the machines.
    roots : FleetRoots
        Poles, or zeros.
    frf : str
        Of which FRF; empty for poles.
    name : str
        Of the picture.

    Returns
    -------
    Picture
        Two panels: frequency, damping.
    """
    rows = np.array([row for row, of in enumerate(roots.frf) if of == frf], int)
    numbers = roots.number[rows]
    machines = roots.machine[rows]
    places = machine_order(analysis)[machines]
    x = numbers + STRIP * (places / max(len(analysis.records) - 1, 1) - 0.5)
    what = f"zero {{}} of {frf}" if frf else "mode {}"
    texts = [
        f"{analysis.records[machine].machine}, {what.format(number)}"
        for machine, number in zip(machines.tolist(), numbers.tolist(), strict=True)
    ]
    is_off = roots.is_outlier[rows]
    panels = []
    for title, values in (("Frequency, %", roots.frequency_hz[rows]), ("Damping, %", roots.damping_ratio[rows])):
        y = percent_of_centre(values, numbers)
        panels.append(Panel(y=Axis(title=title, has_zero_line=True), layers=_layers(x, y, texts, is_off)))
    ticks = np.unique(numbers).tolist()
    labels = [f"{number}: {np.median(roots.frequency_hz[rows][numbers == number]):.4g} Hz" for number in ticks]
    has_ticks = 0 < len(ticks) <= MOST_TICKS
    return Picture(
        name=name,
        title=f"Zeros of {frf} over machines" if frf else "Poles over machines",
        alt=f"Frequency and damping of {len(ticks)} {'zeros' if frf else 'modes'} of {len(set(machines.tolist()))} "
        f"machines, in per cent from their median; {int(is_off.sum())} points are marked as outliers.",
        panels=tuple(panels),
        x=Axis(
            title="Zero" if frf else "Mode",
            ticks=tuple(map(float, ticks)) if has_ticks else None,
            tick_labels=tuple(labels) if has_ticks else (),
        ),
        note="Per cent from the median of all machines. Within each mode the machines stand from left to right in the "
        "order of their dates, serial numbers or ids.".replace("mode", "zero" if frf else "mode"),
        height_px=520,
    )


def machine_order(analysis: FleetAnalysis) -> IntArray:
    """Give the place of each machine: by date, then by serial number, then by id.

    Parameters
    ----------
    analysis : FleetAnalysis
        Of the fleet.

    Returns
    -------
    (n_machines,) int array
        From 0.
    """
    keys = [
        (*(record.particulars.get(along, "") for along in ("date", "serial_number")), record.machine)
        for record in analysis.records
    ]
    order = sorted(range(len(keys)), key=keys.__getitem__)
    return np.argsort(np.array(order, int))


def percent_of_centre(values: FloatArray, groups: IntArray) -> FloatArray:
    """Give the difference of each number to the median of its group, in per cent of that.

    Parameters
    ----------
    values : (n,) array
        The numbers.
    groups : (n,) int array
        Which group.

    Returns
    -------
    (n,) array
        Per cent.
    """
    percent = np.zeros(len(values))
    for group in np.unique(groups):
        centre = np.median(values[groups == group])
        percent[groups == group] = 100 * (values[groups == group] / centre - 1) if centre else np.nan
    return percent


def _layers(x: FloatArray, y: FloatArray, texts: Sequence[str], is_off: np.ndarray) -> tuple[Layer, ...]:
    layers = []
    for name, chosen, colour, symbol in (
        ("machines", ~is_off, Role.MEASURED, "circle"),
        ("outliers", is_off, Role.BAD, "diamond"),
    ):
        if chosen.any():
            layers.append(
                Points(
                    name=name,
                    group=name,
                    colour=colour,
                    symbol=symbol,
                    size=6.0 if colour is Role.MEASURED else 10.0,
                    x=x[chosen],
                    y=y[chosen],
                    texts=[text for text, is_chosen in zip(texts, chosen, strict=True) if is_chosen],
                    hover=PERCENT,
                )
            )
    return tuple(layers)


def draw_drift(analysis: FleetAnalysis, along: str, drifts: Sequence[Drift], positions: FloatArray) -> Picture:
    """Show frequencies along dates or serial numbers.

    Parameters
    ----------
    analysis : FleetAnalysis
        Of the fleet.
    along : str
        ``date`` or ``serial_number``.
    drifts : sequence of Drift
        The modes to show.
    positions : (n_machines,) array
        Where each machine stands.

    Returns
    -------
    Picture
        One panel.
    """
    poles = analysis.poles
    start = np.nanmin(positions)
    layers = []
    for colour, drift in enumerate(drifts):
        rows = np.flatnonzero((poles.number == drift.mode) & np.isfinite(positions[poles.machine]))
        rows = rows[np.argsort(positions[poles.machine[rows]], kind="stable")]
        texts = [f"{analysis.records[place].machine}, mode {drift.mode}" for place in poles.machine[rows]]
        layers.append(
            Points(
                name=f"mode {drift.mode}",
                group=f"mode {drift.mode}",
                colour=colour,
                x=positions[poles.machine[rows]] - (start if along == "date" else 0.0),
                y=percent_of_centre(poles.frequency_hz[rows], poles.number[rows]),
                texts=texts,
                hover=PERCENT,
                size=6.0,
            )
        )
    word = along.replace("_", " ")
    return Picture(
        name=f"drift-{along.replace('_', '-')}",
        title=f"Natural frequencies along the {word}",
        alt=f"Frequencies of {len(drifts)} modes, in per cent from their median, along the {word}.",
        panels=(Panel(y=Axis(title="Frequency, %", has_zero_line=True), layers=tuple(layers)),),
        x=Axis(title="Days from the first machine" if along == "date" else "Serial number"),
    )


def draw_population(population: Population, names: Sequence[str]) -> Picture:
    """Show mean and spread of updated parameters.

    Parameters
    ----------
    population : Population
        Of the fleet.
    names : sequence of str
        Parameters of one kind, which are ratios.

    Returns
    -------
    Picture
        One panel.
    """
    places = [population.names.index(name) for name in names]
    mean, std = 100 * (population.mean[places] - 1), 100 * population.std[places]
    kind = names[0].partition(" of ")[0]
    texts = [f"{name}, +-{deviation:.2g} % (1 sigma)" for name, deviation in zip(names, std, strict=True)]
    numbers = np.arange(1.0, len(names) + 1)
    return Picture(
        name=f"population-{kind}",
        title=f"Updated {kind} over machines",
        alt=f"Mean and deviation of the {kind} of {len(names)} parts over {len(population.machines)} machines, "
        "in per cent from the model.",
        panels=(
            Panel(
                y=Axis(title=f"{kind.capitalize()}, % from the model", has_zero_line=True),
                layers=(
                    Line(
                        name="mean and standard deviation",
                        colour=Role.UPDATED,
                        x=numbers,
                        y=mean,
                        deviation=std,
                        symbol="circle",
                        width=1.0,
                        texts=texts,
                        hover=PERCENT,
                    ),
                ),
            ),
        ),
        x=Axis(title=f"{names[0].rpartition(' ')[0].partition(' of ')[2].capitalize() or 'Part'}, in order"),
        has_legend=False,
    )
