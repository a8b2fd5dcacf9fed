"""A sensor that is hidden is left out of FRFs, diagnosis and model alike, on the command line as on the page."""

import pytest

from frf_ipz.diagnosis.observations import observe
from frf_ipz.errors import FileFormatError
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.sensors import without_sensors
from synthetic_campaign import hammer_campaign, write_test

OPTIONS = IngestOptions()


@pytest.fixture
def campaign(tmp_path):
    hammer_campaign(tmp_path)
    return tmp_path


BAND = FitOptions(band_hz=(20.0, 200.0))


def hiding(folder, *dofs):
    text = f'[pipeline]\ntest = "test.toml"\n[ingest]\nhide = {list(dofs)}\n'
    (folder / "pipeline.toml").write_text(text.replace("'", '"'), encoding="utf-8")
    return folder / "pipeline.toml"


def sensors(frfs):
    return [str(label.output_dof) for label in frfs.labels]


def test_the_frfs_of_the_others_stay_as_they_were(campaign):
    test = read_test(campaign / "test.toml")
    whole_frfs = estimate_frfs(test, options=OPTIONS).frfs
    remaining = estimate_frfs(read_inputs(hiding(campaign, "1:z")).test, options=OPTIONS).frfs
    assert (sensors(whole_frfs), sensors(remaining)) == (["1:+z", "2:+z"], ["2:+z"])
    assert (remaining.values[:, 0] == whole_frfs.values[:, 1]).all()


def test_a_diagnosis_sees_records_without_it(campaign):
    test = without_sensors(read_test(campaign / "test.toml"), ["1:+z"])
    observations = observe(test, ingest=OPTIONS, frfs=estimate_frfs(test, options=OPTIONS).frfs, fit=BAND)
    whole = read_test(campaign / "test.toml")
    unreduced = observe(whole, ingest=OPTIONS, frfs=estimate_frfs(whole, options=OPTIONS).frfs, fit=BAND)
    assert [[sensor.channel for sensor in record.sensors] for record in observations.records] == [["acc_2"]] * 3
    assert (observations.records[0].responses[0] == unreduced.records[0].responses[1]).all()


def test_a_known_mass_stays_where_it_is(campaign):
    path = campaign / "test.toml"
    path.write_text(path.read_text(encoding="utf-8").replace('dof = "1:+z"', 'dof = "1:+z"\nmass_kg = 0.004'))
    assert read_inputs(hiding(campaign, "1:+z")).test.sensor_masses == {1: 0.004}


def test_of_frfs_that_were_estimated_elsewhere_too(tmp_path):
    rows = [f"{hz},{node}:+z,7:+z,{node},0.5" for node in (1, 2) for hz in (10.0, 20.0, 30.0)]
    head = "frequency_hz,output_dof,input_dof,real,imag"
    (tmp_path / "frf.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    write_test(tmp_path, '[[frf]]\nfile = "frf.csv"\nquantity = "accelerance"\n', kind="frf")
    frfs = estimate_frfs(read_inputs(hiding(tmp_path, "1:-z")).test, options=OPTIONS).frfs
    assert sensors(frfs) == ["2:+z"]
    assert frfs.values[0, 0] == 2.0 + 0.5j


@pytest.mark.parametrize(
    ("dofs", "message"),
    [
        (["3:+z"], "there is no sensor at '3:[+]z'"),
        (["1:z", "2:z"], "leaves no sensor"),
        (["1:zz"], "no DOF label"),
        (["tip"], "no sensor at 'tip'"),
    ],
)
def test_invalid_limits_are_refused(campaign, dofs, message):
    with pytest.raises(FileFormatError, match=f"ingest.hide.*{message}"):
        read_inputs(hiding(campaign, *dofs))
