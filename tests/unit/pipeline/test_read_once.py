"""What one stage has read and found in the recordings, the stages after it take over."""

import pytest

from frf_ipz.ingest import records
from frf_ipz.ingest.estimate import estimate_from
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.stage_runner import StageRunner
from frf_ipz.pipeline.stages import measurement, mismatch
from frf_ipz.progress import silent
from frf_ipz.runs.memory import RunMemory
from small_campaign import write_quick_campaign


class EndError(Exception):
    """Where the search of a diagnosis would begin."""


@pytest.fixture
def surveys(monkeypatch):
    """Options of each survey that is made."""
    made = []
    survey_hammer = records.SURVEYS["hammer"]

    def survey(files, options, progress):
        made.append(options)
        return survey_hammer(files, options, progress)

    monkeypatch.setitem(records.SURVEYS, "hammer", survey)
    return made


def runner_of(folder):
    inputs = read_inputs(write_quick_campaign(folder))
    files = RecordingFiles(test=inputs.test)
    return StageRunner(inputs=inputs, recordings=files, store=RunMemory(), progress=silent)


def test_a_diagnosis_takes_over_the_survey_of_the_frfs(tmp_path, monkeypatch, surveys):
    seen = []

    def search(_, observations, *__, **___):
        seen.append(observations)
        raise EndError

    monkeypatch.setattr(mismatch, "find_causes", search)
    runner = runner_of(tmp_path)
    frfs = measurement.ingest(runner).frfs
    for path in (tmp_path / "hits").iterdir():
        path.unlink()  # nor are the files read again
    with pytest.raises(EndError):
        mismatch.diagnose(runner, runner.inputs.fe_model, frfs, is_asked=True)
    assert len(surveys) == 1
    assert len(seen[0].records) == 3


def test_another_choice_is_surveyed_by_itself(tmp_path, surveys):
    files = runner_of(tmp_path).recordings
    for options in (IngestOptions(), IngestOptions(force_window_s=0.0), IngestOptions()):
        estimate_from(files, options)
    assert len(surveys) == 2
