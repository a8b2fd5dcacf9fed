"""Gains of the measured FRFs over a model, where the test does not know its scale.

Poles and zeros do not depend on gains, so an update needs none; a prediction does. They are fitted to the updated
model's modes: at every paired mode the logarithm of the measured amplitude of an FRF (its residue, mass-normalised) is
that of the model plus the logarithms of the gains. Three errors stand against it: the noise of the residue; what the
targets leave open, taken from the ensemble, whose members have gains of their own; and what no member expresses, in
proportion to the mean amplitude of the FRF, whose size follows from the scatter itself ([Paule1982]).

Where the scale is known, the gain common to all FRFs is fitted all the same: it shows by how much the mass of the model
is in doubt, which poles and zeros do not tell. The model stays as it is (a slip in the units of the test looks alike).
As many members of the ensemble as `mass_evidence` finds probable take the gain that was found for that of the
structure: bands reach from the model to it, and hold the truth either way.

Masses differ along a structure too, which poles and zeros hardly tell beside stiffness. The squares of the amplitudes
of all modes at a point add up to 1 over the mass that moves there, so that members have amplitudes of their own at
every node, by half of what masses are off; they shift the gains that are found at measured ones. Where the scale is
unknown, what is predicted is in the unit of fitted gains, and masses are taken as they are.

``common``: one factor for all FRFs. ``per_channel``: one for every sensor and one for every excitation. Only products
of the two show, so the sensors' are 1 in the geometric mean: a point without a sensor is seen by such a mean one.

[Paule1982]: R. C. Paule, J. Mandel, Consensus values and weighting factors, Journal of Research of the National Bureau
of Standards 87 (1982) 377-385 (doi:10.6028/jres.087.022).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray, read_only
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.pencils import modes_of_stack
from frf_ipz.pairing.poles import AMPLITUDE_STD, measured_amplitudes
from frf_ipz.updating.mass_evidence import probability_of_mass
from frf_ipz.updating.parameters import LOCAL_MASS_STD
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from scipy.optimize import brentq, linear_sum_assignment

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.structure import ReducedModel
else:
    brentq = import_late("scipy.optimize", "brentq")
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

SEED = 0  # of the draws: the same bands from the same inputs
DRAWS = 200  # without an ensemble
DECIBEL = 20 / np.log(10.0)
HALF_OF_MASS = 0.5  # of its logarithm: squares of amplitudes go with the inverse of a mass
UNSEEN = 1e-8  # of the largest amplitude: what rounding leaves of a mode along another axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MeasuredScale:
    """Gains of measured FRFs over a model: 1 where the test knows its scale.

    Parameters
    ----------
    kind : str
        ``none``, ``common`` or ``per_channel``, as the test says.
    labels : tuple of FrfLabel
        The measured FRFs; empty where no mode is paired, so that no gain can be fitted.
    log_gain : (n,) array
        Logarithm of the modulus of each gain: the common one; or the sensors', then the excitations'.
    sign : (n,) array
        1 or -1.
    draws : (m, n) array
        Of the logarithms: one a member of the update's ensemble, all with the errors of the fit.
    level : float
        Measured FRFs over those of the model in their unit, where the test knows its scale; else 1.
    believes : (m,) bool array
        Which members take `level` for a property of the structure, the others for a slip of the test.
    probability_of_mass : float
        That `level` is a property of the structure.
    local_std : float
        Standard deviation of the logarithm of a mode's amplitude at a node, by the mass there; 0 where measured shapes
        tell amplitudes.
    member : int
        Which member of the ensemble the gains are those of; -1 for the fitted ones.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = 40.0 * frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4),
    ...     unknown_scale="common",
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> scale = frf_ipz.update_model(fit, reduced_model, fe_model=beam).scale
    >>> round(scale.gain(frf_ipz.FrfLabel("9:+z", tip, frf_ipz.FrfQuantity.ACCELERANCE)), 2)
    40.0
    """

    kind: str = "none"
    labels: tuple[FrfLabel, ...] = ()
    log_gain: FloatArray = field(default_factory=lambda: np.zeros(0))
    sign: FloatArray = field(default_factory=lambda: np.zeros(0))
    draws: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    level: float = 1.0
    believes: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    probability_of_mass: float = 0.5
    local_std: float = 0.0
    member: int = -1

    def __repr__(self) -> str:
        return f"MeasuredScale: {self.kind}, {counted(len(self.labels), 'FRF')}, {len(self.draws)} draws"

    @property
    def is_relative(self) -> bool:
        """Tell whether the test does not know its scale."""
        return self.kind != "none"

    @property
    def is_fitted(self) -> bool:
        """Tell whether there are gains."""
        return bool(self.labels)

    def gain(self, label: FrfLabel) -> float:
        """Give the gain of an FRF.

        Parameters
        ----------
        label : FrfLabel
            Measured, or from an excited DOF to a point that was not measured.

        Returns
        -------
        float
            FRF in the unit of the measurement over that in the unit of the model.
        """
        return self._product(self._places(label)) * self._of_member(label.output_dof, label.input_dof)

    def gains(self, labels: tuple[FrfLabel, ...]) -> FloatArray:
        """Give the gains of several FRFs.

        Parameters
        ----------
        labels : tuple of FrfLabel
            The FRFs.

        Returns
        -------
        (n_frfs,) array
            As `gain` gives them.
        """
        return np.array([self.gain(label) for label in labels], float)

    def knows_level(self, label: FrfLabel) -> bool:
        """Tell whether the level of an FRF is known in the unit of the measurement, and not its shape only.

        Parameters
        ----------
        label : FrfLabel
            Which FRF.

        Returns
        -------
        bool
            False where no gain could be fitted, and where each channel has its own and no sensor sits at the point.
        """
        if not self.is_relative:
            return True
        places = self._sensor(label.output_dof, label.output_channel)
        return self.is_fitted and (self.kind == "common" or bool(places))

    def output_gain(self, dof: AnyDof) -> float:
        """Give the gain of a sensor.

        Parameters
        ----------
        dof : Dof or PortDof
            Where it sits.

        Returns
        -------
        float
            1 without a sensor there, and where one gain is common to all.
        """
        return self._product(self._sensor(dof, "")) * self._of_member(dof)

    def input_gain(self, dof: AnyDof) -> float:
        """Give the gain of an excitation.

        Parameters
        ----------
        dof : Dof or PortDof
            Where it is.

        Returns
        -------
        float
            With that which is common to all.
        """
        return self._product(self._excitation(dof, "")) * self._of_member(dof)

    def drawn(self, label: FrfLabel, count: int) -> FloatArray:
        """Draw the gain of an FRF, over `gain`.

        Parameters
        ----------
        label : FrfLabel
            Which FRF.
        count : int
            Number of draws, one a member of the ensemble.

        Returns
        -------
        (count,) array
            Positive.
        """
        return np.asarray(np.exp(self._believed(count)) * self.drawn_about_level(label, count))

    def drawn_about_level(self, label: FrfLabel, count: int) -> FloatArray:
        """Draw the errors of the fitted gain of an FRF.

        Parameters
        ----------
        label : FrfLabel
            Which FRF.
        count : int
            Number of draws, one a member of the ensemble.

        Returns
        -------
        (count,) array
            Positive; without what members believe of the level.
        """
        places = self._places(label)
        if not places:
            return np.ones(count)
        deviation = (self.draws[:, places] - self.log_gain[places]).sum(axis=1)
        local = sum(self.local_std * local_errors(dof, len(deviation)) for dof in (label.output_dof, label.input_dof))
        return np.asarray(np.exp(np.resize(deviation + local, count)))

    def members(self, count: int) -> list[MeasuredScale]:
        """Give the gains of the first members of the ensemble.

        Parameters
        ----------
        count : int
            Number of members.

        Returns
        -------
        list of MeasuredScale
            One a member.
        """
        if not self.is_fitted:
            return [self] * count
        gains = self.draws[:count] + self._believed(count)[:, None]
        return [replace(self, log_gain=log_gain, member=member) for member, log_gain in enumerate(gains)]

    def std_db(self, label: FrfLabel) -> float:
        """Give the standard deviation of the gain of an FRF.

        Parameters
        ----------
        label : FrfLabel
            Which FRF.

        Returns
        -------
        float
            dB; where the scale is known, how far the mass of the model is in doubt.
        """
        drawn = self.drawn(label, len(self.draws)) if len(self.draws) else np.ones(1)
        return float(DECIBEL * np.std(np.log(drawn)))

    @property
    def level_std(self) -> float:
        """Standard deviation of the logarithm of `level`; 0 where nothing tells it."""
        return float(np.std(self.draws)) if self.draws.size and not self.is_relative else 0.0

    @property
    def statement(self) -> str:
        """What is known of the scale, for people; empty where the test knows it."""
        if not self.is_relative:
            return ""
        if not self.is_fitted:
            return (
                "the scale of the test is unknown, and no paired mode tells its gain: amplitudes are those of the model"
            )
        gains, width = np.abs(self.gains(self.labels)), max(self.std_db(label) for label in self.labels)
        if self.kind == "common":
            return (
                f"the scale of the test is unknown: one gain of {self.gain(self.labels[0]):.4g} (standard deviation "
                f"{width:.2g} dB) is fitted to all FRFs, and predictions are in the unit of the measurement; what is "
                "absolute in the unit of the model rests on its mass"
            )
        return (
            f"the scale of every channel is unknown: gains from {gains.min():.4g} to {gains.max():.4g} (standard "
            f"deviation {width:.2g} dB at most) are fitted; of a prediction the shape is known, and the ratio of its "
            "inputs; its level is that of a mean sensor"
        )

    def _believed(self, count: int) -> FloatArray:
        """Logarithm of the gain that is due to the structure, as the first members see it."""
        if not len(self.believes):
            return np.zeros(count)
        return np.resize(np.where(self.believes, np.log(self.level), 0.0), count)

    def _of_member(self, *dofs: AnyDof) -> float:
        """Give the factor on amplitudes at DOFs that a member has by the masses there; 1 for the fitted gains."""
        if self.member < 0 or not self.is_fitted:
            return 1.0
        errors = [local_errors(dof, len(self.draws))[self.member] for dof in dofs]
        return float(np.exp(self.local_std * np.sum(errors)))

    def _product(self, places: list[int]) -> float:
        return float(np.prod(self.sign[places]) * np.exp(self.log_gain[places].sum()))

    def _sensor(self, dof: AnyDof, channel: str) -> list[int]:
        """Place of the gain of a sensor; none where it has none of its own."""
        if self.kind != "per_channel":
            return []
        sensors = list(dict.fromkeys(map(_sensor_name, self.labels)))
        at_dof = [_sensor_name(label) for label in self.labels if label.output_dof.unsigned == dof.unsigned]
        name = channel if channel in sensors else next(iter(at_dof), "")
        return [sensors.index(name)] if name in sensors else []

    def _excitation(self, dof: AnyDof, channel: str) -> list[int]:
        """Place of the gain of an excitation: the common one, or its own after those of the sensors."""
        if self.kind != "per_channel":
            return [0] if self.is_fitted else []
        excitations = list(dict.fromkeys(map(_excitation_name, self.labels)))
        at_dof = [_excitation_name(label) for label in self.labels if label.input_dof.unsigned == dof.unsigned]
        name = channel if channel in excitations else next(iter(at_dof), "")
        n_sensors = len({_sensor_name(label) for label in self.labels})
        return [n_sensors + excitations.index(name)] if name in excitations else []

    def _places(self, label: FrfLabel) -> list[int]:
        return [
            *self._sensor(label.output_dof, label.output_channel),
            *self._excitation(label.input_dof, label.input_channel),
        ]


def _sensor_name(label: FrfLabel) -> str:
    return label.output_channel or label.output_dof.name


def _excitation_name(label: FrfLabel) -> str:
    return label.input_channel or label.input_dof.name


@lru_cache(maxsize=4096)  # asked for each FRF of each member
def local_errors(dof: AnyDof, count: int) -> FloatArray:
    """Draw errors of amplitudes at a node, the same ones at each call.

    Parameters
    ----------
    dof : Dof or PortDof
        Where: all directions of a node have the same mass.
    count : int
        Number of members.

    Returns
    -------
    (count,) array
        Standard normal.
    """
    place = str(dof.node) if isinstance(dof, Dof) else dof.unsigned.name
    return read_only(np.random.default_rng([SEED, *place.encode()]).standard_normal(count))


def fit_scale(
    fit: ModalFit,
    pairs: Pairs,
    model: ReducedModel,
    roots: ComplexArray,
    ensemble: FloatArray,
    *,
    frequency: tuple[float, float] = (0.0, np.inf),
    local_std: float = HALF_OF_MASS * LOCAL_MASS_STD,
) -> MeasuredScale:
    """Fit the gains of the measured FRFs over a model.

    Parameters
    ----------
    fit : ModalFit
        The fitted model of the measured FRFs; says whether their scale is unknown.
    pairs : Pairs
        Measured poles with their counterparts.
    model : ReducedModel
        Nominal or updated.
    roots : (n_targets,) complex array
        Poles and zeros of that model in the order of `Pairs.targets`, rad/s.
    ensemble : (m, 3, r, r) array
        Mass, damping and stiffness of models drawn from what the targets leave open; may be empty.
    frequency : (log_factor, std)
        Of squared frequencies of the nominal model, as `frequency_factor` gives them.
    local_std : float
        Standard deviation of the logarithm of a mode's amplitude at a node, by the mass there, where the scale is
        known.

    Returns
    -------
    MeasuredScale
        Without gains where no mode is paired; with gains of 1 where the scale is known.
    """
    poles = [place for place, pair in enumerate(pairs.targets) if pair.kind == "pole"]
    if not poles or not fit.labels:  # shapes without FRFs say nothing of a gain
        return MeasuredScale(kind=fit.unknown_scale)
    if fit.unknown_scale != "none":
        local_std = 0.0
    modes = np.array([pairs.targets[place].measured for place in poles])
    known = fit.gain if fit.unknown_scale == "none" else 1.0
    measured, noise = (values[modes] / np.abs(known) for values in measured_amplitudes(fit))
    computed, spread = _amplitudes(fit.labels, model, np.abs(roots[poles]), ensemble)
    root_of = np.unique(fit.model.poles[modes], return_inverse=True)[1]
    together = (root_of == np.arange(root_of.max() + 1)[:, None]).astype(float)  # of modes of one pole the sum is told
    measured, computed, spread = (together @ values for values in (measured, computed, spread))
    noise = np.sqrt(together @ noise**2)
    channels = _channels(fit.labels, fit.unknown_scale)
    local = [
        local_errors(label.output_dof, len(ensemble) or DRAWS) + local_errors(label.input_dof, len(ensemble) or DRAWS)
        for label in fit.labels
    ]
    log_gain, draws = _fit_logs(
        measured, noise, computed, spread, channels, _independent(fit.labels), local_std * np.stack(local, axis=1)
    )
    if fit.unknown_scale == "none":
        share = probability_of_mass(float(log_gain[0]), float(np.std(draws)), *frequency)
        return MeasuredScale(
            labels=fit.labels,
            log_gain=np.zeros(1),
            sign=np.ones(1),
            draws=draws - log_gain,
            level=float(np.exp(log_gain[0])),
            believes=np.random.default_rng(SEED + 1).permutation(np.arange(len(draws)) < round(share * len(draws))),
            probability_of_mass=share,
            local_std=local_std,
        )
    sign = _signs(np.sum((measured * computed).real / np.abs(computed).max(axis=0), axis=0), channels)
    log_gain, draws = _balanced(log_gain, draws, fit.labels, fit.unknown_scale)
    return MeasuredScale(kind=fit.unknown_scale, labels=fit.labels, log_gain=log_gain, sign=sign, draws=draws)


def _channels(labels: tuple[FrfLabel, ...], kind: str) -> FloatArray:
    """(n_frfs, n_gains) 1 where an FRF has a gain."""
    if kind != "per_channel":
        return np.ones((len(labels), 1))
    columns = []
    for ends in ([_sensor_name(label) for label in labels], [_excitation_name(label) for label in labels]):
        columns += [[end == name for end in ends] for name in dict.fromkeys(ends)]
    return np.array(columns, float).T


def _amplitudes(
    labels: tuple[FrfLabel, ...], model: ReducedModel, omega: FloatArray, ensemble: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Amplitudes of modes of a model in the FRFs, (n_modes, n_frfs), and of its members, (m, n_modes, n_frfs)."""
    outputs = np.array([model.row(label.output_dof) for label in labels])
    inputs = np.array([model.row(label.input_dof) for label in labels])
    squares, shapes = modes_of_stack(model.mass, model.stiffness)
    frequency = np.sqrt(np.maximum(squares, 0.0))
    seen = np.abs((outputs @ shapes) * (inputs @ shapes)).max(axis=0)
    # along another axis a mode may have the same frequency, and be in no FRF
    gaps = np.abs(frequency - omega[:, None]) + np.where(seen > UNSEEN * seen.max(), 0.0, frequency.max())
    chosen = shapes[:, linear_sum_assignment(gaps)[1]]  # of equal frequencies each its own mode
    computed = (outputs @ chosen) * (inputs @ chosen)
    members = np.zeros((len(ensemble), *computed.T.shape))
    if len(ensemble):
        _, of_members = modes_of_stack(ensemble[:, 0], ensemble[:, 2])
        likeness = (chosen.T @ model.mass @ of_members) ** 2
        same = np.array([linear_sum_assignment(-values)[1] for values in likeness])
        chosen_of_members = np.take_along_axis(of_members, same[:, None, :], axis=2)
        members = np.asarray(((outputs @ chosen_of_members) * (inputs @ chosen_of_members)).swapaxes(1, 2))
    return np.asarray(computed.T), members


def _fit_logs(
    measured: ComplexArray,
    noise: FloatArray,
    computed: FloatArray,
    members: FloatArray,
    channels: FloatArray,
    n_independent: int,
    local: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Logarithms of the gains, (n_gains,), and draws of them, (m, n_gains), beside errors at points, (m, n_frfs)."""
    tiny = np.finfo(float).tiny
    n_modes, n_frfs = measured.shape
    log_computed = np.log(np.maximum(np.abs(computed), tiny))
    data = (np.log(np.maximum(np.abs(measured), tiny)) - log_computed).ravel()
    design = np.tile(channels, (n_modes, 1))
    of_members = (np.log(np.maximum(np.abs(members), tiny)) - log_computed).reshape(len(members), len(data))
    known = ((noise / np.maximum(np.abs(measured), tiny)) ** 2 / 2).ravel()
    known += np.mean(of_members**2, axis=0) if len(members) else 0.0
    mean = np.sqrt(np.mean(np.abs(computed) ** 2, axis=0))
    relative = ((mean / np.maximum(np.abs(computed), tiny)) ** 2).ravel()
    rank = int(np.linalg.matrix_rank(channels))
    degrees = (len(data) - rank) * n_independent / n_frfs
    is_known = degrees >= 1.0
    excess = _unexplained(data, design, known, relative, len(data) - rank) if is_known else AMPLITUDE_STD**2
    gain_of = _estimator(design, known + excess * relative)
    rng = np.random.default_rng(SEED)
    count = len(members) or DRAWS
    noise_part = (noise / np.maximum(np.abs(measured), tiny) / np.sqrt(2.0)).ravel()
    student = np.sqrt(degrees / rng.chisquare(degrees, count))[:, None] if is_known else 1.0
    errors = rng.standard_normal((count, len(data))) * noise_part
    errors += rng.standard_normal((count, len(data))) * np.sqrt(excess * relative * n_frfs / n_independent) * student
    errors -= np.tile(local, (1, n_modes))
    if len(members):
        errors -= of_members
    log_gain = gain_of @ data
    return np.asarray(log_gain), np.asarray(log_gain + errors @ gain_of.T)


def _estimator(design: FloatArray, variance: FloatArray) -> FloatArray:
    """Matrix that gives the weighted least-squares gains from the data; the smallest ones where some are free."""
    root = 1 / np.sqrt(variance)
    return np.asarray(np.linalg.pinv(design * root[:, None]) * root)


def _unexplained(data: FloatArray, design: FloatArray, known: FloatArray, relative: FloatArray, degrees: int) -> float:
    """Variance, over `relative`, with which the scatter is as expected ([Paule1982]); next to none where it is less."""

    def surplus(excess: float) -> float:
        variance = known + excess * relative
        error = data - design @ (_estimator(design, variance) @ data)
        return float(np.sum(error**2 / variance) - degrees)

    eps = float(np.finfo(float).eps)
    floor = eps * float(np.median(known + data**2) + eps)  # above 0 where neither noise nor scatter is
    if surplus(floor) <= 0:
        return floor
    top = float(np.sum(data**2) + floor)
    while surplus(top) > 0:
        top *= 2.0
    return float(brentq(surplus, floor, top))


def _signs(agreement: FloatArray, channels: FloatArray) -> FloatArray:
    """Signs of the gains from those of the FRFs, each with its weight: the best of alternating choices."""
    signs = np.ones(channels.shape[1])
    for _ in range(channels.shape[1]):
        for gain in range(channels.shape[1]):
            others = np.where(np.arange(len(signs)) == gain, 1.0, signs)
            product = np.prod(np.where(channels > 0, others, 1.0), axis=1)
            signs[gain] = -1.0 if np.sum(channels[:, gain] * agreement * product) < 0 else 1.0
    return signs


def _balanced(
    log_gain: FloatArray, draws: FloatArray, labels: tuple[FrfLabel, ...], kind: str
) -> tuple[FloatArray, FloatArray]:
    """Put the level of the sensors into the excitations."""
    if kind == "common":
        return log_gain, draws
    count = len({_sensor_name(label) for label in labels})
    side = np.where(np.arange(len(log_gain)) < count, -1.0, 1.0)
    return log_gain + side * log_gain[:count].mean(), draws + side * draws[:, :count].mean(axis=1, keepdims=True)


def _independent(labels: tuple[FrfLabel, ...]) -> int:
    """Count the errors of a mode's shape that are independent: FRFs of one sensor or excited DOF share that one's."""
    return min(len({label.output_dof.name for label in labels}), len({label.input_dof.name for label in labels}))
