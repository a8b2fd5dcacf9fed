"""A diagnosis in a session that knows nothing of threads of linear algebra."""

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from frf_ipz.diagnosis import diagnose as stage
from frf_ipz.diagnosis.observations import Observations
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.structure import StructuralModel


def threads():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_a_diagnosis_uses_one_thread_and_gives_the_others_back(monkeypatch):
    used = []

    def look(_):
        used.extend(threads())
        raise KeyboardInterrupt

    monkeypatch.setattr(stage, "split_data", look)
    model = StructuralModel.from_matrices([[1.0]], [[1.0]], dofs=["1:x"])
    nothing = Observations(kind="frf", records=(), band_hz=(1.0, 2.0))
    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        with pytest.raises(KeyboardInterrupt):
            stage.diagnose(nothing, model, options=DiagnoseOptions())
        assert threads() == before
    assert set(used) == {1}
