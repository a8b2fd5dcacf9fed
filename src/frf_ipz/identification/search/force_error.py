"""Error of the force: a smooth factor that all FRFs of one excitation share.

The force of an impact is kept over its pulse and the ringing after it, a few milliseconds, and its noise is kept with
it. So the FRFs of one excited DOF are all off by one factor ``1 + e(omega)``, and e, the spectrum of so short a time,
hardly changes over many lines. Residues follow e at their poles. What e changes over the tails of a strong mode they
cannot follow: it looks like broad modes, on which so many lines agree that a criterion for white noise believes them.

So e is offered as ``sum_k c_k exp(-i omega t_k)`` over the times of a window, with c normally distributed. The size of
c and the window are those of the highest evidence, c itself being integrated out [MacKay1992]. A size of zero is no
error at all.

Where recordings show the noise of the force beside their pulses, all this is known: e is a few samples of that noise
over the force, large where the force has a null. What a pole takes off the misfit is then compared with what that noise
is likely to take off in its place.

[MacKay1992] D. J. C. MacKay, Bayesian interpolation, Neural Computation 4, 1992, 415-447,
doi:10.1162/neco.1992.4.3.415.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.identification.likelihood.compression import model_columns, response
from frf_ipz.identification.likelihood.refinement import RefinedPoles, refine_poles
from frf_ipz.identification.likelihood.sandwich import NoiseInTime
from frf_ipz.numerics.partial_fractions import unstacked

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
    from frf_ipz.frf import ForceNoise
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import WeightedLines

# how long after the impact, in times of one over the band: a pulse that excites the band lasts one to two of them, and
# its filter rings for ten
TAILS = (2, 4, 8, 16, 32)
LEAD = 0.25  # of that before the impact: pulses are divided by, whose inverse reaches back
FINER = 2  # coefficients in a time of one over the band: the error does not repeat beyond it
SIZES = np.geomspace(1e-4, 1e8, 73)  # variances tried, by that of the coefficient that the lines tell best
FEWEST_FRFS = 2  # of an excitation: a factor of a single one takes the place of any modes
MOST_FRFS = 8  # of an excitation, those that weigh most: all have the same error, and few tell it as well
ROUNDS = 4  # of finding the error, and the modes without it
ITERATIONS = 4  # of poles, in a round
LINES_AT_ONCE = 4096  # whose waves are in memory


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceError:
    """Error of the force that FRFs share.

    Parameters
    ----------
    relative : (n_lines, n_frfs) complex array
        By which the FRFs are off.
    force : (n_frfs,) int array
        Which FRFs share a force, by its number.
    window_s : (n_forces,) array
        How long after the impact each force has its error, s; 0 where it has none.
    rms : (n_forces,) array
        Expected relative size.
    receptance : (n_lines, n_frfs) complex array
        The receptances without it, m/N.
    cost : float
        What it takes off the misfit beyond minus twice the log of the evidence: what it costs, as poles cost what the
        BIC demands.
    """

    relative: ComplexArray
    force: IntArray
    window_s: FloatArray
    rms: FloatArray
    receptance: ComplexArray
    cost: float

    @property
    def rms_of_frfs(self) -> FloatArray:
        """Expected relative size in each FRF, (n_frfs,) array."""
        return np.asarray(self.rms[np.unique(self.force, return_inverse=True)[1]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Evidence:
    evidence: float = 0.0
    coefficients: FloatArray = field(default_factory=lambda: np.zeros(0))
    tail: int = 0
    variance: float = 0.0
    gain: float = 0.0


def find_force_error(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms
) -> tuple[ForceError, RefinedPoles] | None:
    """Find the error of each force, if there is one.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights, the same profile for all FRFs; with the force of each FRF.
    fit : RefinedPoles
        A fit of the modes that are beyond doubt.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    (ForceError, RefinedPoles) or None
        The error, and the fit to the FRFs without it; None where no force shows an error.
    """
    if data.force is None:
        return None
    found, least = None, fit.misfit
    for _ in range(ROUNDS):
        error = _error_beside(data, data.force, fit, terms)
        if error is None:
            break
        fit = refine_poles(replace(data, receptance=error.receptance), fit.poles, terms, iterations=ITERATIONS)
        # less than a number is worth by the BIC is no better
        if fit.misfit + error.cost > least - np.log(2 * len(data.s)):
            break
        found, least = (error, fit), fit.misfit + error.cost
    return found


def _error_beside(data: WeightedLines, force: IntArray, fit: RefinedPoles, terms: SmoothTerms) -> ForceError | None:
    """Find the error of each force beside modes and residues that are known but for small changes."""
    basis = _model_basis(data, fit, terms)
    if data.force_noise is not None:
        return _error_of_known_noise(data, data.force_noise, fit, terms, basis)
    modelled = response(fit.system, terms, data.s)
    longest = FINER * max(TAILS)
    first = -int(LEAD * longest)
    step_s = 2 * np.pi / (data.s.imag[-1] - data.s.imag[0]) / FINER
    waves = np.exp(-1j * data.s.imag[:, None] * (step_s * np.arange(first, longest + 1)))
    relative = np.zeros(modelled.shape, complex)
    forces = np.unique(force)
    window_s, rms = np.zeros(len(forces)), np.zeros(len(forces))
    cost = 0.0
    for number, one in enumerate(forces):
        of_force = np.flatnonzero(force == one)
        if len(of_force) < FEWEST_FRFS:
            continue
        best = _best_error(data, modelled, basis, waves, of_force)
        if not best.tail:
            continue
        used = _part(best.tail)
        real, imag = np.split(best.coefficients, 2)
        relative[:, of_force] = (waves[:, used] @ (real + 1j * imag))[:, None]
        window_s[number] = best.tail * step_s
        rms[number] = np.sqrt(best.variance * len(best.coefficients))
        cost += best.gain - best.evidence
    if not rms.any():
        return None
    return ForceError(
        relative=relative,
        force=force,
        window_s=window_s,
        rms=rms,
        receptance=data.receptance / (1 + relative),
        cost=cost,
    )


def share_beyond_known_noise(data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms) -> FloatArray:
    """Tell how much of what poles take off the misfit remains if the known noise of the force may make it as well.

    A residue's square over its variance, ``c^T W^-1 c``, becomes ``c^T (W + G G^T)^-1 c``, with G what each sample of
    that noise adds to the residues of the FRFs that share it.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights, the same profile for all FRFs.
    fit : RefinedPoles
        A fit to them.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    (n_poles,) array
        1 where nothing is known of such noise.
    """
    noise, n_poles = data.force_noise, len(fit.poles)
    if noise is None or not n_poles:
        return np.ones(n_poles)
    columns = model_columns(data.s, fit.poles, terms, real_modes=data.real_modes) * np.tile(data.profile, 2)[:, None]
    basis, triangle = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))
    of_residues = np.linalg.pinv(triangle)[fit.system.n_smooth :]  # real parts of all poles, then imaginary
    to_residues = unstacked(basis @ of_residues.T)
    weight = np.linalg.inv(_by_pole(of_residues, n_poles) @ _by_pole(of_residues, n_poles).swapaxes(1, 2))
    frequency_hz, middle_s = data.s.imag / (2 * np.pi), float(np.mean(noise.interval_s))
    in_time = NoiseInTime.within(frequency_hz, noise.interval_s)
    error = response(fit.system, terms, data.s) * noise.relative * np.exp(-1j * data.s.imag * middle_s)[:, None]
    alone, explained = np.zeros(n_poles), np.zeros(n_poles)
    for one in np.unique(noise.force):
        gram, right = np.zeros((n_poles, 1, 1)), np.zeros((n_poles, 1, 1))
        for frf in np.flatnonzero(noise.force == one).tolist():
            of_line = data.profile * data.gain[frf]
            by_noise = _by_pole(in_time(to_residues.conj() * (of_line * error[:, frf])[:, None]).T, n_poles)
            residues = _by_pole((to_residues.conj().T @ (of_line * data.receptance[:, frf])).real[:, None], n_poles)
            weighed = by_noise.swapaxes(1, 2) @ weight
            gram = gram + weighed @ by_noise
            right = right + weighed @ residues
            alone += np.sum(residues * (weight @ residues), axis=(1, 2))
        explained += np.sum(right * np.linalg.solve(gram + np.eye(gram.shape[1]), right), axis=(1, 2))
    return np.asarray(1 - explained / np.maximum(alone, np.finfo(float).tiny))


def _by_pole(rows: FloatArray, n_poles: int) -> FloatArray:
    """Put rows of real parts of all poles, then of imaginary parts, side by side, (n_poles, 1 or 2, n)."""
    return rows.reshape(-1, n_poles, rows.shape[1]).swapaxes(0, 1)


def _error_of_known_noise(
    data: WeightedLines, noise: ForceNoise, fit: RefinedPoles, terms: SmoothTerms, basis: ComplexArray
) -> ForceError:
    """Find the error of each force whose noise is known: its few samples, over the force."""
    modelled = response(fit.system, terms, data.s)
    first_s, last_s = noise.interval_s
    step_s = 2 * np.pi / (data.s.imag[-1] - data.s.imag[0]) / FINER
    times = np.linspace(first_s, last_s, 1 + max(int(np.ceil((last_s - first_s) / step_s)), 1))
    relative = np.zeros(modelled.shape, complex)
    forces = np.unique(noise.force)
    rms = np.zeros(len(forces))
    cost = 0.0
    for number, one in enumerate(forces):
        of_force = np.flatnonzero(noise.force == one)
        weight = data.profile[:, None] * data.gain[of_force]
        values = modelled[:, of_force] * weight
        misfit = (data.receptance - modelled)[:, of_force] * weight
        misfit = misfit - basis @ (basis.conj().T @ misfit).real
        # of samples that are one in the mean square together
        sizes = values * noise.relative[:, of_force] / np.sqrt(len(times))
        gram, right = np.zeros((len(times), len(times))), np.zeros(len(times))
        followed = np.zeros((len(of_force), basis.shape[1], len(times)))
        for some in _blocks_of(len(data.s)):
            waves = np.exp(-1j * data.s.imag[some, None] * times)
            power = np.sum(np.abs(sizes[some]) ** 2, axis=1)[:, None]
            gram += (waves.conj().T @ (power * waves)).real
            right += (waves.conj().T @ np.sum(sizes[some].conj() * misfit[some], axis=1)).real
            for number_of_frf, size in enumerate(sizes[some].T):
                followed[number_of_frf] += (basis[some].conj().T @ (size[:, None] * waves)).real
        gram -= np.einsum("kij,kil->jl", followed, followed)
        found = _evidence(gram, right, np.ones(1))
        samples = found.coefficients / np.sqrt(len(times))
        blocks = [np.exp(-1j * data.s.imag[some, None] * times) @ samples for some in _blocks_of(len(data.s))]
        relative[:, of_force] = noise.relative[:, of_force] * np.concatenate(blocks)[:, None]
        energy = np.abs(values) ** 2
        rms[number] = np.sqrt(np.sum(energy * np.abs(noise.relative[:, of_force]) ** 2) / np.sum(energy))
        cost += found.gain - found.evidence
    return ForceError(
        relative=relative,
        force=noise.force,
        window_s=np.full(len(forces), last_s),
        rms=rms,
        receptance=data.receptance / (1 + relative),
        cost=cost,
    )


def _blocks_of(n_lines: int) -> list[slice]:
    """Cut lines into blocks, in which waves take little memory."""
    return [slice(start, start + LINES_AT_ONCE) for start in range(0, n_lines, LINES_AT_ONCE)]


def _part(tail: int) -> slice:
    """Select the waves of a window."""
    before = int(LEAD * FINER * max(TAILS))
    return slice(before - int(LEAD * tail), before + tail + 1)


def _model_basis(data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms) -> ComplexArray:
    """Orthonormal basis of what residues, smooth terms and steps of the poles can follow, (n_lines, n)."""
    columns = model_columns(data.s, fit.poles, terms, real_modes=data.real_modes, with_slopes=True)
    columns = columns * np.tile(data.profile, 2)[:, None]
    return unstacked(np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0])


def _best_error(
    data: WeightedLines, modelled: ComplexArray, basis: ComplexArray, waves: ComplexArray, of_force: IntArray
) -> _Evidence:
    """Find window and size of the highest evidence."""
    weight = data.profile[:, None] * data.gain[of_force]
    energy = np.sum(np.abs(modelled[:, of_force] * weight) ** 2, axis=0)
    strongest = np.argsort(-energy)[:MOST_FRFS]
    values = (modelled[:, of_force] * weight)[:, strongest]
    misfit = ((data.receptance - modelled)[:, of_force] * weight)[:, strongest]
    misfit = misfit - basis @ (basis.conj().T @ misfit).real
    # a real coefficient and an imaginary one for each wave
    products = waves.conj().T @ (np.sum(np.abs(values) ** 2, axis=1)[:, None] * waves)
    gram = np.block([[products.real, -products.imag], [products.imag, products.real]])
    sides = waves.conj().T @ np.sum(values.conj() * misfit, axis=1)
    right = np.concatenate([sides.real, sides.imag])
    for of_frf in values.T:
        followed = (basis.conj() * of_frf[:, None]).T @ waves
        followed_parts = np.concatenate([followed.real, -followed.imag], axis=1)
        gram -= followed_parts.T @ followed_parts
    best = _Evidence()
    demanded = 2 * np.log(2 * misfit.size)  # of two numbers, by the BIC
    for tail in (FINER * tail for tail in TAILS):
        used = _part(tail)
        part = np.concatenate([np.arange(used.start, used.stop), len(sides) + np.arange(used.start, used.stop)])
        found = replace(_evidence(gram[np.ix_(part, part)], right[part]), tail=tail)
        if found.evidence > max(best.evidence, demanded):
            best = found
    return best


def _evidence(gram: FloatArray, right: FloatArray, variances: FloatArray | None = None) -> _Evidence:
    """Evidence of the best size, over that of none, and the real coefficients expected with it."""
    values, vectors = np.linalg.eigh(gram)
    values = np.maximum(values, 0.0)
    if not values[-1] > 0:
        return _Evidence(coefficients=np.zeros(len(right)))
    along = vectors.T @ right
    tried = (SIZES / values[-1] if variances is None else variances)[:, None]
    shrunk = tried / (1 + tried * values)
    evidence = np.sum(along**2 * shrunk - np.log1p(tried * values), axis=1)
    top = int(np.argmax(evidence))
    expected = shrunk[top] * along
    return _Evidence(
        evidence=float(evidence[top]),
        coefficients=vectors @ expected,
        variance=float(tried[top, 0]),
        gain=float(np.sum(2 * along * expected - values * expected**2)),
    )
