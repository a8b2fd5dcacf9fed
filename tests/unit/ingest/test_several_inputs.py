"""Two shakers at once: FRFs of correlated forces, their coherences and errors, and what is refused."""

import numpy as np
import pytest

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.ingest.estimation.several_inputs import estimate_several_inputs

RATE_HZ, SAMPLES = 1024.0, 2**16
SHORT = 2**14  # samples, where errors do not count: writing and reading a table takes most of the time
FORCES, SENSORS = ("8:+z", "17:-z"), ("21:+z", "12:-z", "8:+z")
TRIALS = 150
MONTE_CARLO = 0.08  # of a ratio of variances from that many trials of 33 lines
CHANNEL = '[[channel]]\ncolumn = "{}"\nrole = "{}"\nquantity = "{}"\nunit = "{}"\ndof = "{}"\n'
INPUTS = [CHANNEL.format(f"shaker {place}", "input", "force", "N", dof) for place, dof in enumerate(FORCES)]
OUTPUTS = [CHANNEL.format(f"acc {place}", "output", "acceleration", "m/s^2", dof) for place, dof in enumerate(SENSORS)]
TEST = "\n".join(['[test]\nkind = "random"', *INPUTS, *OUTPUTS, '[[record]]\nfiles = ["run.csv"]\n'])


def beam():
    return frf_ipz.make_beam(**BEAM | {"modal_ratio": 0.02})


def labels():
    return [frf_ipz.FrfLabel(output, force, "accelerance") for output in SENSORS for force in FORCES]


def simulate(seed, *, correlation=0.8, noise=0.02):
    """Forces and responses in the signs of the test; the record is a period of a motion without a beginning."""
    rng = np.random.default_rng(seed)
    spectra = np.fft.rfft(rng.standard_normal((2, SAMPLES)))
    spectra[1] = correlation * spectra[0] + np.sqrt(1 - correlation**2) * spectra[1]
    frequency_hz = np.fft.rfftfreq(SAMPLES, 1 / RATE_HZ)
    spectra *= (frequency_hz > 2) & (frequency_hz < 450)
    values = frf_ipz.compute_frfs(beam(), labels(), 2j * np.pi * frequency_hz).reshape(len(frequency_hz), 3, 2)
    responses = np.fft.irfft(np.einsum("koi,ik->ok", values, spectra), SAMPLES)
    responses += noise * responses.std(axis=1, keepdims=True) * rng.standard_normal(responses.shape)
    return np.fft.irfft(spectra, SAMPLES), responses


def write(folder, forces, responses, *, test=TEST):
    table = np.column_stack([np.arange(forces.shape[1]) / RATE_HZ, *forces, *responses])
    header = "time," + ",".join([*(f"shaker {k}" for k in range(2)), *(f"acc {k}" for k in range(3))])
    np.savetxt(folder / "run.csv", table, fmt="%.9g", delimiter=",", header=header, comments="")
    (folder / "test.toml").write_text(test)
    return folder / "test.toml"


@pytest.fixture(scope="module")
def estimate(tmp_path_factory):
    path = write(tmp_path_factory.mktemp("mimo"), *simulate(1))
    return frf_ipz.estimate_frfs(frf_ipz.read_test(path))


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.95])
def test_stated_variance_is_that_of_many_trials(correlation):
    rng = np.random.default_rng(7)
    true = np.array([[1 + 2j, -0.5j], [0.3, 2.0]])
    squares, stated = [], []
    for _ in range(TRIALS):
        forces = rng.standard_normal((30, 2, 33, 2)).view(complex)[..., 0]
        forces[:, 1] = correlation * forces[:, 0] + np.sqrt(1 - correlation**2) * forces[:, 1]
        responses = np.einsum("oi,nik->nok", true, forces)
        responses += 0.3 * rng.standard_normal((*responses.shape, 2)).view(complex)[..., 0]
        got = estimate_several_inputs(forces, responses, 30.0)
        squares.append(np.abs(got.values - true) ** 2)
        stated.append(got.variance)
    ratio = np.mean(squares, axis=(0, 1)) / np.mean(stated, axis=(0, 1))
    np.testing.assert_allclose(ratio, 1.0, atol=MONTE_CARLO)


def test_frfs_are_those_of_the_structure_within_their_errors(estimate):
    frfs = estimate.frfs
    assert [str(label) for label in frfs.labels] == [str(label) for label in labels()]
    inside = (frfs.frequency_hz > 25) & (frfs.frequency_hz < 400)
    true = frf_ipz.compute_frfs(beam(), frfs.labels, 2j * np.pi * frfs.frequency_hz)
    errors = np.abs(frfs.values - true)[inside] ** 2 / frfs.variance[inside]
    assert 0.5 < np.median(errors) < 1.0  # the median of an exponential distribution is 0.69
    assert np.median(np.abs(frfs.values / true - 1)[inside]) < 0.05


def test_segments_under_hann_windows_are_an_option(tmp_path):
    test = frf_ipz.read_test(write(tmp_path, *simulate(8)))
    frfs = frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions(segment_s=2.0)).frfs
    inside = (frfs.frequency_hz > 25) & (frfs.frequency_hz < 400)
    true = frf_ipz.compute_frfs(beam(), frfs.labels, 2j * np.pi * frfs.frequency_hz)
    assert np.median(np.abs(frfs.values / true - 1)[inside]) < 0.05


def test_coherences(estimate):
    table = estimate.to_frame("coherence")
    inside = table[(table["frequency_hz"] > 25) & (table["frequency_hz"] < 400)]
    assert inside["multiple_coherence"].median() > 0.99
    assert 0.2 < inside["ordinary_coherence"].median() < inside["multiple_coherence"].median()
    np.testing.assert_array_equal(estimate.frfs.coherence[:, 0], table["multiple_coherence"][: estimate.frfs.n_lines])
    assert "coherence of the forces: shaker 0 and shaker 1 0.6" in estimate.choices[1]


def test_one_force_at_a_time_is_the_same_as_before():
    forces, responses = simulate(2, correlation=0.0)
    spectra = np.fft.rfft(forces)
    single = estimate_several_inputs(spectra[None, :1], np.fft.rfft(responses)[None], 2.0)
    expected = np.fft.rfft(responses) * spectra[0].conj() / np.maximum(np.abs(spectra[0]) ** 2, 1e-300)
    known = np.abs(spectra[0]) > 1e-9
    np.testing.assert_allclose(single.values[known, :, 0], expected.T[known], rtol=1e-9)


@pytest.mark.parametrize("factor", [1.0, -3.0])
def test_one_force_on_two_channels_is_refused(tmp_path, factor):
    forces, responses = (part[:, :SHORT] for part in simulate(3))
    forces[1] = factor * forces[0]
    test = frf_ipz.read_test(write(tmp_path, forces, responses))
    with pytest.raises(frf_ipz.InputError, match=r"'shaker 0' and 'shaker 1' are fully correlated"):
        frf_ipz.estimate_frfs(test)


def test_a_run_takes_two_shakers(tmp_path):
    write(tmp_path, *simulate(4))
    model = "\n".join(f"{key} = {value!r}" for key, value in BEAM.items() if key != "modal_ratio").replace("'", '"')
    (tmp_path / "model.toml").write_text(f'[model]\nkind = "beam"\n[damping]\nmodal_ratio = 0.02\n[beam]\n{model}\n')
    (tmp_path / "pipeline.toml").write_text(
        '[pipeline]\ntest = "test.toml"\nmodel = "model.toml"\n[fit]\nband_hz = [10.0, 400.0]\n'
        '[diagnose]\nrun = "never"\n[predict]\npoints = ["14:+z"]\n'
    )
    results = frf_ipz.run_pipeline(tmp_path / "pipeline.toml", tmp_path / "out", until="predict")
    assert (tmp_path / "out" / "coherence.parquet").exists()
    assert results.pairs.count("pole").paired == 3
    true = frf_ipz.compute_frfs(beam(), results.prediction.labels, 2j * np.pi * results.prediction.frequency_hz)
    assert frf_ipz.compare_frfs(true, results.prediction.values).median_db.max() < 0.2


RECORD = '[[record]]\nfiles = ["run.csv"]\n'
FAULTS = [
    (TEST.replace(f'dof = "{FORCES[1]}"\n', ""), "the input 'shaker 1' has no DOF"),
    (TEST.replace(FORCES[1], FORCES[0]), "two inputs act at the same DOF"),
    (TEST.replace(RECORD, RECORD + 'dof = "8:+z"\n'), "has one 'dof', and the test has 2 inputs"),
    (TEST.replace(RECORD, RECORD + 'input_dofs = { shaker = "8:+z" }\n'), "'input_dofs' names 'shaker'"),
    (TEST.replace('kind = "random"', 'kind = "hammer"').replace("[[record]]", "[[hit]]"), "kind 'random'"),
]


@pytest.mark.parametrize(("text", "message"), FAULTS)
def test_faults_of_the_test_are_named(tmp_path, text, message):
    (tmp_path / "run.csv").write_text("time\n")
    (tmp_path / "test.toml").write_text(text)
    with pytest.raises(frf_ipz.FileFormatError) as error:
        frf_ipz.read_test(tmp_path / "test.toml")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"estimator": "H2"}, "knows one force"), ({"segment_s": 60.0}, "need more than 3"), ({"segment_s": 0.01}, "32")],
)
def test_options_that_cannot_be_are_named(tmp_path, options, message):
    test = frf_ipz.read_test(write(tmp_path, *(part[:, :4096] for part in simulate(5))))
    with pytest.raises(frf_ipz.InputError, match=message):
        frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions(**options))


def test_forces_may_act_elsewhere_in_another_record(tmp_path):
    forces, responses = (part[:, :SHORT] for part in simulate(6))
    test = TEST.replace(RECORD, RECORD + 'input_dofs = { "shaker 1" = "15:+z" }\n')
    got = frf_ipz.estimate_frfs(frf_ipz.read_test(write(tmp_path, forces, responses, test=test)))
    assert {str(dof) for dof in got.frfs.input_dofs} == {"8:+z", "15:+z"}


def test_a_bad_record_is_left_out_beside_good_ones_and_said(tmp_path):
    forces, responses = (part[:, :SHORT] for part in simulate(1))
    for number in range(2):
        write(tmp_path, forces, responses)
        (tmp_path / "run.csv").rename(tmp_path / f"run_{number}.csv")
    overloaded = np.clip(responses, None, 0.5 * responses.max(axis=1, keepdims=True))
    write(tmp_path, forces, np.vstack([overloaded[:1], responses[1:]]), test=TEST.replace("run.csv", "run*.csv"))
    test = frf_ipz.read_test(tmp_path / "test.toml")
    estimate = frf_ipz.estimate_frfs(test)
    assert estimate.warnings == ("run.csv is left out: overload of acc 0",)
    kept = frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions(keep=("run.csv",)))
    assert not kept.warnings
    assert len(kept.frfs.frequency_hz) != len(estimate.frfs.frequency_hz)  # three records allow other parts
    alone = frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions(drop=("run_0.csv", "run_1.csv")))
    assert alone.warnings == ("run.csv is used although it is bad (overload of acc 0): there is no better record",)
