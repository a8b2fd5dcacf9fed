"""Each impact against the others at its point: those that contradict are named by what explains them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, groupby
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.signals.decay import noise_power
from frf_ipz.ingest.signals.lost_samples import LostSamples, find_lost_samples
from frf_ipz.ingest.signals.windows import window_impact
from frf_ipz.ingest.survey.contradictions import (
    FEWEST,
    LEVEL,
    ImpactSpectra,
    compare_output,
    contradicts_pairwise,
    difference_of_pair,
    find_dead,
    find_two_groups,
    follows_force,
    leave_out,
    weigh_impacts,
)
from frf_ipz.quantities import RESPONSES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence, Set

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.survey.contradictions import OutputComparison, TwoGroups
    from frf_ipz.ingest.survey.record_info import RecordInfo, Survey

CONTRADICTS = "contradicts the other impacts"
OPPOSITE = "its sign is the opposite"
UNNAMED = ""
DEAD = "is dead: nothing in it follows the force"
ADVICE = "which is right does not show in two: drop the wrong one by [ingest] drop, or record a third"
GROUP_ADVICE = (
    "which is right does not show: drop the wrong ones by [ingest] drop; deviations take either for as likely"
)
DISAGREE = 0.12  # of the FRF, 1 dB: two impacts that differ by more are no repetition; what is explained to this, is
LITTLE = 0.5  # of the usual weight: less is said
FEWEST_LINES = 64  # that are compared, however many impacts there are: a band of the scatter's fit


def compare_impacts(files: RecordingFiles, survey: Survey) -> tuple[tuple[RecordInfo, ...], tuple[str, ...]]:
    """Compare the impacts at each point with one another.

    Parameters
    ----------
    files : RecordingFiles
        The recordings.
    survey : Survey
        Which are used, and on which windows.

    Returns
    -------
    records : tuple of RecordInfo
        All of the survey, with what contradicts as faults, and the relative noise of each.
    warnings : tuple of str
        Where two impacts, or two groups of them, contradict each other, and nothing tells which is right.
    """
    changed: dict[str, RecordInfo] = {}
    warnings: list[str] = []
    for setup in dict.fromkeys(record.setup for record in survey.used):
        records = [record for record in survey.used if record.setup == setup]
        if len(records) < 2:
            continue
        spectra = _transform(files, survey, records)
        records, spectra = _without_dead(files, records, spectra)
        changed |= {record.name: record for record in records}
        if len(records) == 2:
            compared, undecided = _compare_pair(files, survey, records, spectra)
        else:
            compared, undecided = _compare_setup(files, survey, records, spectra)
        warnings += undecided
        changed |= {record.name: record for record in compared}
    return tuple(changed.get(record.name, record) for record in survey.records), tuple(warnings)


def _transform(files: RecordingFiles, survey: Survey, records: Sequence[RecordInfo]) -> ImpactSpectra:
    """Transform the impacts; of all lines so few are kept that they take no more memory than one record."""
    stride = max(min(len(records), survey.n_samples // 2 // FEWEST_LINES), 1)
    lines = slice(None, None, stride)
    frequency_hz = np.asarray(np.fft.rfftfreq(survey.n_samples, survey.step_s)[lines])
    forces, responses, noises, force_noises = [], [], [], []
    for record, signals in _windowed(files, survey, records):
        transforms = np.fft.rfft(signals)[:, lines].copy()  # without what is not compared
        forces.append(transforms[0])
        responses.append(transforms[1:])
        force_window, window = window_impact(
            np.ones((2, record.n_samples)),
            survey.n_samples,
            record.force_interval,
            survey.decay_1_s * record.step_s,
            record.trigger,
        )
        unwindowed = signals[1:] / np.maximum(window, np.finfo(float).tiny)
        noise = [
            noise_power(response[record.trigger : record.n_samples], record.step_s, frequency_hz)
            for response in unwindowed
        ]
        spikes = [[record.spike_power(output, window)] for output in range(len(noise))]
        noises.append(np.nan_to_num(np.array(noise)) * np.sum(window**2) + np.array(spikes))
        force_noises.append(record.force_noise**2 * np.sum(force_window**2))
    outputs = range(len(records[0].setup.output_dofs))
    valid = np.array([[output in record.used_outputs for output in outputs] for record in records])
    return ImpactSpectra(
        force=np.array(forces),
        responses=np.array(responses),
        noise=np.array(noises),
        force_noise=np.array(force_noises),
        valid=valid,
    )


def _windowed(
    files: RecordingFiles, survey: Survey, records: Sequence[RecordInfo]
) -> Iterator[tuple[RecordInfo, FloatArray]]:
    for path, group in groupby(records, key=lambda record: record.path):
        in_file = list(group)
        segments = files.segments(in_file[0].setup, path, [(record.start, record.stop) for record in in_file])
        for record, segment in zip(in_file, segments, strict=True):
            signals = record.correct(segment[1:])
            decay = survey.decay_1_s * record.step_s
            yield record, window_impact(signals, survey.n_samples, record.force_interval, decay, record.trigger)


def _without_dead(
    files: RecordingFiles, records: Sequence[RecordInfo], spectra: ImpactSpectra
) -> tuple[list[RecordInfo], ImpactSpectra]:
    """Mark responses that hold nothing in some of the impacts, and leave these out of what is compared."""
    columns = [channel.column for channel in files.test.output_channels]
    valid = spectra.valid.copy()
    causes: list[dict[int, str]] = [{} for _ in records]
    for output in range(len(columns)):
        for impact in find_dead(spectra, output):
            causes[impact][output] = DEAD
            valid[impact, output] = False
    marked = [_with_causes(record, named, columns) for record, named in zip(records, causes, strict=True)]
    return marked, replace(spectra, valid=valid)


def _compare_setup(
    files: RecordingFiles, survey: Survey, records: Sequence[RecordInfo], spectra: ImpactSpectra
) -> tuple[list[RecordInfo], list[str]]:
    columns = [channel.column for channel in files.test.output_channels]
    comparisons = [_compare_output(files, survey, records, spectra, output) for output in range(len(columns))]
    comparisons, losses = _without_lost_of_all(files, survey, records, spectra, comparisons)
    causes = [_name_causes(columns, spectra, comparisons, impact) for impact in range(len(records))]
    unlike: set[tuple[int, int]] = set()
    for impact, named in enumerate(causes):
        for output, comparison in enumerate(comparisons):
            if comparison is not None and named.get(output) == UNNAMED:
                if (impact, output) in losses:
                    named[output] = f"{CONTRADICTS}: {_say_lost(survey, losses[impact, output], records[impact])}"
                    continue
                agreeing = [records[number] for number in comparison.agreeing]
                lost = _find_lost(files, survey, agreeing, records[impact], output)
                explained = _explain(survey, spectra, comparison, (impact, output), lost, records[impact])
                if not explained:
                    unlike.add((impact, output))
                named[output] = f"{CONTRADICTS}: {explained or _difference(spectra, comparison, (impact, output))}"
    agree = [() if comparison is None else comparison.agreeing for comparison in comparisons]
    unlike -= {(impact, spike.output) for impact, record in enumerate(records) for spike in record.spikes}  # a fault
    for output, second in _second_groups(spectra, agree, unlike).items():
        agree[output] = tuple(sorted((*agree[output], *second)))
        for impact in second:
            del causes[impact][output]
            unlike.remove((impact, output))
    mended = {
        spike.output for record in records for spike in record.spikes
    }  # what is left of it is alike, and no group
    found = dict.fromkeys(agree) | {
        impacts: find_two_groups(spectra, outputs, impacts)
        for impacts in agree
        if (outputs := [output for output, same in enumerate(agree) if same == impacts and output not in mended])
    }
    groups = [found[impacts] for impacts in agree]
    doubts = tuple(1.0 if pair is None else pair.variance_factor for pair in groups)
    compared = [
        replace(
            _with_causes(record, causes[impact], columns),
            is_unlike=all((impact, output) in unlike for output in record.used_outputs),
            doubts=doubts,
        )
        for impact, record in enumerate(_weighed(files, survey, records, spectra, agree))
    ]
    return compared, _say_groups(columns, records, groups)


def _second_groups(
    spectra: ImpactSpectra, agree: Sequence[Sequence[int]], unlike: Set[tuple[int, int]]
) -> dict[int, tuple[int, ...]]:
    """Find the impacts that contradict the majority, but agree with each other: which group is right does not show.

    Impacts that were struck beside their point contradict in all responses; in one of several a sensor is at fault.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    agree : sequence of sequences of int
        The majority in each response.
    unlike : set of pairs of int
        Impacts and responses that contradict it as nothing explains, no jump that was taken off either.

    Returns
    -------
    dict of int to tuple of int
        The second group, where there is one, by the response.
    """
    seconds = {}
    for output, majority in enumerate(agree):
        second = tuple(sorted(impact for impact, of in unlike if of == output))
        groups = find_two_groups(spectra, [output], sorted((*majority, *second))) if len(second) > 1 else None
        if groups is not None and second in (groups.first, groups.second):
            seconds[output] = second
    n_compared = sum(bool(majority) for majority in agree)
    return seconds if len(seconds) > 1 or n_compared == 1 else {}


def _say_groups(columns: Sequence[str], records: Sequence[RecordInfo], groups: Sequence[TwoGroups | None]) -> list[str]:
    """Say which impacts fall into two groups: once for all responses in which these are the same."""
    texts = []
    for found in dict.fromkeys(pair for pair in groups if pair is not None):
        first, second = (", ".join(records[number].name for number in group) for group in (found.first, found.second))
        listed = ", ".join(column for column, pair in zip(columns, groups, strict=True) if pair is found)
        texts.append(
            f"{first} and {second} are two groups, as if struck at two points: their FRFs differ by "
            f"{100 * found.between:.2g} % in {listed}, those of a group by {100 * found.within:.2g} %; {GROUP_ADVICE}"
        )
    return texts


def _weighed(
    files: RecordingFiles,
    survey: Survey,
    records: Sequence[RecordInfo],
    spectra: ImpactSpectra,
    agreeing: Sequence[Sequence[int]],
) -> list[RecordInfo]:
    """Add the weights of impacts, of which some agree in each response."""
    n_lines = spectra.force.shape[1]
    points = np.linspace(0, n_lines - 1, 2 * max(n_lines // FEWEST_LINES, 1) + 1)
    n_shown = survey.n_samples / 4 / n_lines  # half a record has a line for every second one of the whole
    weights, scales = zip(
        *(weigh_impacts(spectra, impacts, output, n_shown) for output, impacts in enumerate(agreeing)), strict=True
    )
    return [
        replace(
            record,
            noise_weights=tuple(tuple(np.interp(points, np.arange(n_lines), row[impact]).tolist()) for row in weights),
            noise_scales=tuple(float(scale[impact]) for scale in scales),
            remarks=(*record.remarks, *_find_noisy(files, spectra, agreeing, weights, impact)),
        )
        for impact, record in enumerate(records)
    ]


def _find_noisy(
    files: RecordingFiles,
    spectra: ImpactSpectra,
    agreeing: Sequence[Sequence[int]],
    weights: Sequence[FloatArray],
    impact: int,
) -> tuple[str, ...]:
    """Say which responses of an impact count little for their noise.

    Noise that is louder in a stronger impact, by as much, takes nothing from what that impact tells of an FRF.
    """
    power = np.abs(spectra.force) ** 2
    texts = []
    for channel, impacts, row in zip(files.test.output_channels, agreeing, weights, strict=True):
        if impact not in impacts:
            continue
        weighed = row * power
        total = np.maximum(weighed[list(impacts)].mean(axis=0), np.finfo(float).tiny)
        share = float(np.median(weighed[impact] / total))
        if max(share, float(np.median(row[impact]))) < LITTLE:
            texts.append(
                f"{channel.column} is noisier than in the other impacts: it counts {100 * share:.2g} % of a usual one"
            )
    return tuple(texts)


def _compare_output(
    files: RecordingFiles, survey: Survey, records: Sequence[RecordInfo], spectra: ImpactSpectra, output: int
) -> OutputComparison | None:
    """Compare one response of all impacts; of few, one with lost samples is told only by trying just that."""
    comparison = compare_output(spectra, output)
    if comparison is None:
        return None
    if len(comparison.agreeing) == FEWEST:
        return _without_lost_of_three(files, survey, records, spectra, output, comparison)
    n_tried = int(spectra.valid.sum())
    for impact in comparison.agreeing:
        if len(comparison.agreeing) < FEWEST:
            break
        without = leave_out(spectra, output, comparison, impact)
        response, noise = spectra.responses[impact, output], spectra.noise[impact, output]
        misfit = without.misfit(spectra.force[impact], response, noise)
        if not without.explains(misfit, 1.0, n_tried):  # however well it is explained
            continue
        agreeing = [records[number] for number in without.agreeing]
        _, lost, share, _ = _find_lost(files, survey, agreeing, records[impact], output)
        if lost and without.explains(misfit, max(misfit * share, 1.0), n_tried):
            comparison = without
    return comparison


def _without_lost_of_all(
    files: RecordingFiles,
    survey: Survey,
    records: Sequence[RecordInfo],
    spectra: ImpactSpectra,
    comparisons: Sequence[OutputComparison | None],
) -> tuple[list[OutputComparison | None], dict[tuple[int, int], LostSamples]]:
    """Leave out impacts that lost the same samples at the same place in several responses.

    Of few impacts no response alone may tell that. Errors that responses have in common are those of the force and of
    where it was struck, and begin with the force: of a difference that does not, each response is a witness of its own.
    The one that tells most finds the place and the number; the ratios of the others at these count.
    """
    found = list(comparisons)
    lost: dict[tuple[int, int], LostSamples] = {}
    for impact in range(len(records)):
        misfits: dict[int, float] = {}
        withouts: dict[int, OutputComparison] = {}
        for output, comparison in enumerate(found):
            if comparison is not None and impact in comparison.agreeing and len(comparison.agreeing) >= FEWEST:
                withouts[output] = leave_out(spectra, output, comparison, impact)
                response, noise = spectra.responses[impact, output], spectra.noise[impact, output]
                misfits[output] = withouts[output].misfit(spectra.force[impact], response, noise)
        if not _is_witnessed([withouts[output].log_ratio(misfits[output], 1.0) for output in misfits], len(records)):
            continue  # however well it is explained
        losses = {
            output: _find_lost(files, survey, [records[number] for number in without.agreeing], records[impact], output)
            for output, without in withouts.items()
        }
        first = min(losses.values(), key=lambda loss: loss.share)
        alike = [output for output, loss in losses.items() if _is_same_loss(loss, first)]
        ratios = [
            withouts[output].log_ratio(misfits[output], max(misfits[output] * losses[output].share, 1.0))
            for output in alike
        ]
        if _is_witnessed(ratios, len(records)):
            for output in alike:
                found[output], lost[impact, output] = withouts[output], first
    return found, lost


def _is_witnessed(log_ratios: Sequence[float], n_tried: int) -> bool:
    """Tell whether responses besides the one that tells most make what was tried so much likelier that it counts."""
    return bool(sum(log_ratios) - max(log_ratios, default=0.0) > np.log(n_tried / LEVEL))


def _is_same_loss(loss: LostSamples, first: LostSamples) -> bool:
    """Tell whether as many samples are lost at the same place, before which nothing differs."""
    is_same = loss.lost == first.lost and abs(loss.start - first.start) <= abs(loss.lost)
    return bool(loss.lost) and is_same and loss.before <= DISAGREE**2


def _without_lost_of_three(
    files: RecordingFiles,
    survey: Survey,
    records: Sequence[RecordInfo],
    spectra: ImpactSpectra,
    output: int,
    comparison: OutputComparison,
) -> OutputComparison:
    """Leave out of three impacts, two of which give no scatter to rely on, the one that lost samples, as in a pair."""
    shares: list[tuple[float, int]] = []
    for impact in comparison.agreeing:
        others = [records[number] for number in comparison.agreeing if number != impact]
        _, lost, share, _ = _find_lost(files, survey, others, records[impact], output)
        shares += [(share, impact)] if lost > 0 else []
    if not shares or min(shares)[0] > DISAGREE**2:
        return comparison
    return leave_out(spectra, output, comparison, min(shares)[1])


def _name_causes(
    columns: Sequence[str],
    spectra: ImpactSpectra,
    comparisons: Sequence[OutputComparison | None],
    impact: int,
) -> dict[int, str]:
    """Name what is wrong with responses of an impact, as far as the spectra show it; others are not named yet."""
    causes: dict[int, str] = {}
    for output, comparison in enumerate(comparisons):
        if not spectra.valid[impact, output]:
            continue
        if not follows_force(spectra, output):
            causes[output] = DEAD
        elif comparison is not None and impact in comparison.reversed_sign:
            causes[output] = f"{CONTRADICTS}: {OPPOSITE}"
        elif comparison is not None and impact in comparison.contradicting:
            causes[output] = UNNAMED
    for pair in combinations([output for output, cause in causes.items() if not cause], 2):
        if causes[pair[0]] == causes[pair[1]] == UNNAMED and _is_exchange(spectra, comparisons, impact, pair):
            names = " and ".join(columns[output] for output in pair)
            causes |= dict.fromkeys(pair, f"{CONTRADICTS}: {names} are exchanged")
    return causes


def _with_causes(record: RecordInfo, causes: Mapping[int, str], columns: Sequence[str]) -> RecordInfo:
    """Add what contradicts: to the impact where all of its responses say the same, else to the channel."""
    said = set(causes.values())
    if len(said) == 1 and len(causes) > 1 and set(causes) == set(record.used_outputs):
        (text,) = said
        if text.startswith(CONTRADICTS):
            text = text.replace(OPPOSITE, "all responses have the opposite sign, as if struck from the other side", 1)
            return replace(record, faults=(*record.faults, text))
    faults = tuple(
        (output, text if "exchanged" in text else f"{columns[output]} {text}") for output, text in causes.items()
    )
    return replace(record, channel_faults=(*record.channel_faults, *faults))


def _is_exchange(
    spectra: ImpactSpectra,
    comparisons: Sequence[OutputComparison | None],
    impact: int,
    pair: tuple[int, int],
) -> bool:
    """Tell whether two responses of an impact are like those of the others when they change places."""
    first, second = comparisons[pair[0]], comparisons[pair[1]]
    if first is None or second is None:
        return False
    n_tried = spectra.responses.shape[1] ** 2
    force = spectra.force[impact]
    for comparison, own, other in ((first, *pair), (second, *pair[::-1])):
        responses, noise = spectra.responses[impact], spectra.noise[impact]
        misfit = comparison.misfit(force, responses[own], noise[own])
        if not comparison.explains(misfit, comparison.misfit(force, responses[other], noise[other]), n_tried):
            return False
    return True


def _explain(
    survey: Survey,
    spectra: ImpactSpectra,
    comparison: OutputComparison,
    place: tuple[int, int],
    lost_samples: LostSamples,
    record: RecordInfo,
) -> str:
    """Say what fault makes one response of an impact contradict those of the others; empty where none does."""
    impact, output = place
    force, response, noise = spectra.force[impact], spectra.responses[impact, output], spectra.noise[impact, output]
    misfit = comparison.misfit(force, response, noise)
    lost, share = lost_samples.lost, lost_samples.share
    expected = comparison.frf * force
    weight = 1.0 / np.maximum(np.maximum(comparison.scatter, noise), np.finfo(float).tiny)
    factor = complex(np.sum(weight * expected.conj() * response) / np.sum(weight * np.abs(expected) ** 2))
    scaled = comparison.misfit(force, response / factor, noise) if factor else misfit
    is_lost = lost and (share <= DISAGREE**2 or comparison.explains(misfit, max(misfit * share, 1.0), 1))
    if is_lost and not scaled < misfit * share:
        return _say_lost(survey, lost_samples, record)
    if comparison.explains(misfit, scaled, 1):
        return f"it is {abs(factor):.3g} times as large"
    return ""


def _say_lost(survey: Survey, loss: LostSamples, record: RecordInfo) -> str:
    if loss.start <= record.trigger + abs(loss.lost):  # of what came before, nothing shows where it stood
        late = "earlier" if loss.lost > 0 else "later"
        shift_ms = 1e3 * abs(loss.lost) * survey.step_s
        return f"it comes {abs(loss.lost)} samples ({shift_ms:.3g} ms) {late} after its force than in the others"
    what = f"{abs(loss.lost)} samples {'are lost' if loss.lost > 0 else 'came in'}"
    return f"{what} {loss.start * survey.step_s:.4g} s after its beginning"


def _difference(spectra: ImpactSpectra, comparison: OutputComparison, place: tuple[int, int]) -> str:
    """Say by how much one response of an impact differs from what those of the others make of its force."""
    impact, output = place
    response, expected = spectra.responses[impact, output], comparison.frf * spectra.force[impact]
    size = max(float(np.sum(np.abs(expected) ** 2)), np.finfo(float).tiny)
    difference = np.sqrt(np.sum(np.abs(response - expected) ** 2) / size)
    usual = np.sqrt(np.sum(comparison.scatter) / size)
    return (
        f"it is {100 * difference:.2g} % off what the other impacts make of its force (root of mean square over the "
        f"lines, where noise and their own scatter are {100 * usual:.2g} %)"
    )


def _find_lost(
    files: RecordingFiles, survey: Survey, agreeing: Sequence[RecordInfo], record: RecordInfo, output: int
) -> LostSamples:
    """Compare an impact's response with what the FRF of the others makes of its force."""
    power, cross = np.zeros(survey.n_samples // 2 + 1), np.zeros(survey.n_samples // 2 + 1, complex)
    for _, signals in _windowed(files, survey, agreeing):
        force, response = np.fft.rfft(signals[[0, 1 + output]])
        power += np.abs(force) ** 2
        cross += force.conj() * response
    ((_, signals),) = _windowed(files, survey, [record])
    frf = np.divide(cross, power, out=np.zeros_like(cross), where=power > 0.0)
    expected = np.fft.irfft(frf * np.fft.rfft(signals[0]), survey.n_samples)
    n = record.n_samples
    return find_lost_samples(signals[1 + output, :n], np.asarray(expected[:n]))


def _compare_pair(
    files: RecordingFiles, survey: Survey, records: Sequence[RecordInfo], spectra: ImpactSpectra
) -> tuple[list[RecordInfo], list[str]]:
    """Compare two impacts: one of two that contradict each other is left out where an explanation names the fault.

    The mean of two FRFs of opposite sign is noise, and that of two channels is no channel; one impact alone is right
    but for what is said.
    """
    columns = [channel.column for channel in files.test.output_channels]
    shared = [output for output in range(len(columns)) if spectra.valid[:, output].all()]
    lost = _lost_of_pair(files, survey, records, shared)
    if lost is not None:
        impact, text = lost
        fault = f"{CONTRADICTS}: {text}"
        return [_with_causes(records[impact], dict.fromkeys(shared, fault), columns)], []
    causes: dict[int, str] = {}
    opposite = [output for output in shared if contradicts_pairwise(spectra, output)]
    impact, reason = _wrong_of_pair(files, survey, records, spectra, opposite)
    causes |= dict.fromkeys(opposite, f"{CONTRADICTS}: {OPPOSITE}, {reason}")
    for first, second in combinations([output for output in shared if output not in opposite], 2):
        exchanged = spectra.responses.copy()
        exchanged[0, [first, second]] = -exchanged[0, [second, first]]
        pair = replace(spectra, responses=exchanged)
        if contradicts_pairwise(pair, first) and contradicts_pairwise(pair, second):
            names = f"{columns[first]} and {columns[second]}"
            causes |= dict.fromkeys((first, second), f"{CONTRADICTS}: {names} are exchanged, {reason}")
    if causes:
        return [_with_causes(records[impact], causes, columns)], []
    differences = {columns[output]: difference_of_pair(spectra, output) for output in shared}
    listed = ", ".join(f"{column} {100 * part:.0f} %" for column, part in differences.items() if part > DISAGREE)
    names = " and ".join(record.name for record in records)
    text = f"{names} contradict each other: their FRFs differ by {listed} (rms); {ADVICE}"
    agree = [tuple(np.flatnonzero(spectra.valid[:, output]).tolist()) for output in range(len(columns))]
    return _weighed(files, survey, records, spectra, agree), [text] if listed else []


def _lost_of_pair(
    files: RecordingFiles, survey: Survey, records: Sequence[RecordInfo], outputs: Sequence[int]
) -> tuple[int, str] | None:
    """Tell which of two impacts lost samples: allowed for in it, the two agree; the other way round they do not."""
    found: list[tuple[float, int, int, int]] = []
    for impact in (0, 1):
        losses = [_find_lost(files, survey, [records[1 - impact]], records[impact], output) for output in outputs]
        if losses and len({loss.lost for loss in losses}) == 1 and losses[0].lost > 0:
            start, lost, *_ = losses[0]
            found.append((max(loss.share for loss in losses), impact, lost, start))
    if not found or min(found)[0] > DISAGREE**2:
        return None
    _, impact, lost, start = min(found)
    return impact, f"{lost} samples are lost {start * survey.step_s:.4g} s after its beginning"


def _wrong_of_pair(
    files: RecordingFiles,
    survey: Survey,
    records: Sequence[RecordInfo],
    spectra: ImpactSpectra,
    opposite: Sequence[int],
) -> tuple[int, str]:
    """Tell which of two impacts is wrong, and by what: the force's sign, power at the driving point, or nothing."""
    signs = [np.sign(record.peak_force) for record in records]
    usual = np.sign(sum(np.sign(record.peak_force) for record in survey.used if record.setup != records[0].setup))
    if signs[0] != signs[1] and usual:
        return signs.index(-usual), "and that of its force too, against the impacts at other points"
    setup = records[0].setup
    for output in opposite:
        if setup.output_dofs[output].unsigned != setup.input_dof.unsigned:
            continue
        channel = files.test.output_channels[output]
        turn = (-1j) ** (RESPONSES.index(channel.quantity) - 1)  # from the response to the velocity
        turn *= setup.output_dofs[output].sign * setup.input_dof.sign
        power = np.sum(spectra.force.conj() * spectra.responses[:, output] * turn, axis=1).real
        if power.min() < 0.0 < power.max():
            return int(np.argmin(power)), f"and {channel.column}, at the point of the force, would give power to it"
    return 1, f"and {ADVICE}; without that, {records[0].name} is used"
