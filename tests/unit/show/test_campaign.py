"""What a folder holds: a run, a campaign with its pipelines, several runs."""

import json
import re

import pytest
from starlette.testclient import TestClient

from frf_ipz.errors import InputError
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.run import run_pipeline
from frf_ipz.runs.folder import open_run
from frf_ipz.runs.generations import GENERATIONS, HIDDEN, POINTER
from frf_ipz.show.app import build_app
from frf_ipz.show.campaign import find_runs
from frf_ipz.show.workbench import Workbench
from synthetic_campaign import hammer_campaign

PORT, TOKEN = 8765, "drawn-at-random"
HOME = f"/{TOKEN}/"
SOON_S = 120.0  # a whole run takes seconds


def client_of(folder, run=None):
    benches = [Workbench(place, run, read_inputs) for place in find_runs(folder)]
    app = build_app(benches, port=PORT, token=TOKEN)
    return TestClient(app, base_url=f"http://127.0.0.1:{PORT}", raise_server_exceptions=True), benches


def write_pipeline(folder, name="pipeline", test="test.toml"):
    path = folder / f"{name}.toml"
    path.write_text(f'[pipeline]\nname = "the <{name}>"\ntest = "{test}"\n', encoding="utf-8")
    return path


def pretend_run(folder, pipeline):
    folder.mkdir(parents=True)
    manifest = {"pipeline": str(pipeline), "name": folder.name, "when": "2026-01-01T10:00:00+00:00", "stages": {}}
    (folder / "run.json").write_text(json.dumps(manifest), encoding="utf-8")


@pytest.fixture
def campaign(tmp_path):
    hammer_campaign(tmp_path)
    write_pipeline(tmp_path)
    return tmp_path.resolve()


def test_a_run_is_itself_and_nothing_inside_it_is_looked_at(tmp_path):
    pretend_run(tmp_path / "out", "/elsewhere/pipeline.toml")
    pretend_run(tmp_path / "out" / "stages" / "old", "/elsewhere/pipeline.toml")
    (place,) = find_runs(tmp_path / "out")
    assert (place.folder, str(place.pipeline)) == (tmp_path.resolve() / "out", "/elsewhere/pipeline.toml")


def test_a_run_is_what_the_program_reads_whatever_lies_where_users_look(campaign):
    out = campaign / "results" / "a"
    with open_run(out) as folder:
        folder.manifest["pipeline"] = str(campaign / "pipeline.toml")
    (out / "run.json").unlink()
    assert [place.folder for place in find_runs(campaign)] == [out]
    (out / "run.json").write_text("{}", encoding="utf-8")
    (out / HIDDEN / POINTER).write_text("0\n", encoding="utf-8")  # as while the first results take their place
    (out / HIDDEN / GENERATIONS / "0").mkdir()
    assert [place.folder for place in find_runs(campaign)] == [campaign / "results" / "pipeline"]


def test_a_pipeline_without_a_run_has_its_results_beside_it(campaign):
    (place,) = find_runs(campaign)
    assert (place.pipeline, place.folder) == (campaign / "pipeline.toml", campaign / "results" / "pipeline")


def test_a_pipeline_is_known_by_its_section_and_its_runs_by_their_manifest(campaign):
    second = write_pipeline(campaign, "other")
    pretend_run(campaign / "results" / "a", second)
    pretend_run(campaign / "results" / "b", second)
    pretend_run(campaign / ".hidden" / "c", second)
    places = find_runs(campaign)
    assert [(place.pipeline.name, place.folder.name) for place in places] == [
        ("other.toml", "a"),
        ("other.toml", "b"),
        ("pipeline.toml", "pipeline"),
    ]


def test_a_folder_of_campaigns_lists_them_all(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_pipeline(tmp_path / name)
    assert [place.pipeline.parent.name for place in find_runs(tmp_path)] == ["one", "two"]


def test_a_folder_with_neither_is_refused(tmp_path):
    hammer_campaign(tmp_path)
    with pytest.raises(InputError, match="frf-ipz init"):
        find_runs(tmp_path)


def test_the_first_run_can_be_started_from_the_page(campaign):
    client, (bench,) = client_of(campaign, run_pipeline)
    page = client.get(HOME).text
    for part in ("Nothing has been run yet", "1:+z and 2:+z", ">Run</button>", 'data-stamp=""', 'id="structure"'):
        assert part in page
    assert "report.html" not in page
    assert client.post(HOME + "run", json={}).status_code == 200
    bench.wait(SOON_S)
    assert bench.status.error == ""
    page = client.get(HOME).text
    for part in ('id="stabilisation"', ">Run again</button>", '/report.html">'):
        assert part in page
    report = re.search(r'href="([^"]+/report.html)"', page)[1]
    assert client.get(HOME + report).status_code == 200
    assert find_runs(campaign)[0].folder == campaign / "results" / "pipeline"


def test_a_pipeline_that_is_wrong_is_said_and_shown(campaign):
    write_pipeline(campaign, test="no.toml")
    client, _ = client_of(campaign)
    answer = client.get(HOME)
    assert answer.status_code == 200
    assert "cannot be run as it stands" in answer.text
    assert "no.toml" in answer.text


def test_several_runs_are_listed_to_choose_from(campaign):
    pretend_run(campaign / "results" / "old", write_pipeline(campaign, "other"))
    (campaign / "results" / "old" / "diagnosis.json").write_text('{"verdict": "consistent"}', encoding="utf-8")
    client, benches = client_of(campaign)
    page = client.get(HOME).text
    for part in (
        'href="1/"',
        'href="2/"',
        "not yet",
        "2026-01-01 10:00 UTC",
        "the &lt;pipeline&gt;",
        "Nothing significant",
    ):
        assert part in page
    assert "<pipeline>" not in page
    for number, bench in enumerate(benches, start=1):
        chosen = client.get(f"{HOME}{number}/")
        assert chosen.status_code == 200
        assert str(bench.folder) in chosen.text
        assert 'href="../"' in chosen.text
        assert client.get(f"{HOME}{number}/state").json()["stamp"] == bench.stamp
    assert client.get(f"{HOME}3/").status_code == 404
    assert client.get(f"{HOME}1/run/../../../pipeline.toml").status_code in {403, 404}


@pytest.mark.parametrize(
    ("assessment", "said"),
    [
        ({"verdict": "not usable"}, "<td>not usable; no diagnosis was run</td>"),
        ({"verdict": "<b>"}, "<td>&lt;b&gt;; no diagnosis was run</td>"),
        ("usable", "<td>no diagnosis was run</td>"),
    ],
    ids=str,
)
def test_the_list_says_whether_a_result_can_be_used(campaign, assessment, said):
    folder = campaign / "results" / "old"
    pretend_run(folder, write_pipeline(campaign, "other"))
    manifest = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    (folder / "run.json").write_text(json.dumps({**manifest, "assessment": assessment}), encoding="utf-8")
    client, _ = client_of(campaign)
    assert said in client.get(HOME).text
