"""What the server answers, and whom it refuses."""

import base64
import hashlib
import re
from gzip import decompress as gunzip

import pytest
from starlette.testclient import TestClient

from frf_ipz.errors import InputError
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.runs.generations import current_folder
from frf_ipz.show.app import build_app
from frf_ipz.show.campaign import RunPaths
from frf_ipz.show.workbench import Workbench

PORT, TOKEN = 8765, "drawn-at-random"
HOME = f"/{TOKEN}/"
PIN = {"kind": "pin", "hz": 250.0}
SOON_S = 60.0
DRAWN = {"picture/poles.svg", "picture/poles.png"}  # every picture of a run is drawn by the tests of the command line


@pytest.fixture
def runs():
    return []


@pytest.fixture
def bench(demo, runs):
    return Workbench(
        RunPaths(folder=demo / "out", pipeline=demo / "pipeline.toml"),
        lambda path, _, **__: runs.append(path),
        read_inputs,
    )


@pytest.fixture
def client(bench):
    app = build_app([bench], port=PORT, token=TOKEN)
    return TestClient(app, base_url=f"http://127.0.0.1:{PORT}", raise_server_exceptions=True)


def test_the_page_holds_the_report_and_the_forms_and_asks_nothing_of_the_network(client):
    page = client.get(HOME)
    assert page.status_code == 200
    for part in ('id="stabilisation"', 'id="structure"', 'id="pole-form"', 'id="point-form"', 'id="record-choices"'):
        assert part in page.text
    addresses = re.findall(r'(?:src|href)="([^"#]+)"', page.text)
    assert not [address for address in addresses if re.match(r"\w+:|//|/", address) and address != "data:,"]
    pictures = {address for address in addresses if address.startswith("picture/")}
    assert pictures > DRAWN
    for address in set(addresses) - (pictures - DRAWN) - {"data:,"}:
        assert client.get(HOME + address).status_code == 200, address


def test_a_change_is_written_answered_and_run(client, bench, runs):
    answer = client.post(HOME + "change", json=PIN)
    assert answer.status_code == 200
    assert "a mode pinned at 250 Hz" in answer.json()["choices"]
    bench.wait(SOON_S)
    assert runs == [bench.pipeline]
    assert bench.choices().fit.pin_hz == (250.0,)
    state = client.get(HOME + "state").json()
    assert (state["running"], state["error"], state["stamp"]) == (False, "", bench.stamp)


def test_running_again_changes_nothing(client, bench, runs):
    text = bench.text()
    assert client.post(HOME + "run", json={}).status_code == 200
    bench.wait(SOON_S)
    assert (runs, bench.text()) == ([bench.pipeline], text)


def test_what_is_undone_and_made_again_is_answered_and_run(client, bench, runs):
    text = bench.text()
    assert '"undo" title="Take the last change back (Ctrl-Z)" disabled' in client.get(HOME).text
    refused = client.post(HOME + "undo", json={})
    assert (refused.status_code, refused.json()["error"][:24]) == (400, "there is nothing to undo")
    changed = client.post(HOME + "change", json=PIN).json()["choices"]
    assert '(Ctrl-Z)">Undo' in changed
    assert '(Ctrl-Y)" disabled' in changed
    undone = client.post(HOME + "undo", json={}).json()["choices"]
    assert bench.text() == text
    assert '(Ctrl-Y)">Redo' in undone
    assert "a mode pinned at 250 Hz" in client.post(HOME + "redo", json={}).json()["choices"]
    bench.wait(SOON_S)
    assert runs


def test_a_search_for_causes_is_offered_where_there_is_a_model(client, bench, runs):
    assert 'data-command="diagnose"' in client.get(HOME).text
    assert client.post(HOME + "diagnose", json={}).status_code == 200
    bench.wait(SOON_S)
    assert runs == [bench.pipeline]
    assert client.post(HOME + "cancel", json={}).status_code == 200
    lines = bench.text().splitlines(keepends=True)
    bench.pipeline.write_text("".join(line for line in lines if not line.startswith("model =")), encoding="utf-8")
    assert 'data-command="diagnose"' not in client.get(HOME).text
    assert client.post(HOME + "diagnose", json={}).status_code == 400


def test_a_wrong_change_is_answered_with_a_sentence(client, bench):
    text = bench.text()
    answer = client.post(HOME + "change", json={"kind": "reject", "hz": 101.8})
    assert (answer.status_code, bench.text()) == (400, text)
    assert answer.json()["error"].startswith("say why")


def test_shapes_of_a_mode_and_at_a_frequency(client):
    mode = client.get(HOME + "shape", params={"mode": "1"}).json()
    assert [motion["name"] for motion in mode["motions"]] == ["updated", "nominal", "measured"]
    operating = client.get(HOME + "shape", params={"hz": "60", "input": "89:+z"}).json()
    assert operating["title"] == "At 60 Hz for 1 N at 89:+z"
    for wrong in ({"mode": "99"}, {"mode": "x"}, {"hz": "60", "input": "1:+z"}, {"hz": "nan", "input": "89:+z"}, {}):
        assert client.get(HOME + "shape", params=wrong).status_code == 400, wrong


def test_frfs_of_a_frequency_range_come_with_all_their_lines(client, bench):
    frfs = bench.contents().frfs
    inside = (frfs.frequency_hz >= 99.9) & (frfs.frequency_hz <= 104.1)
    answer = client.get(HOME + "zoom", params={"low": "100", "high": "104", "frfs": "1"}).json()
    magnitude = next(trace for trace in answer["traces"] if min(trace["y"]) > 0 and len(trace["y"]) >= inside.sum())
    assert set(frfs.frequency_hz[inside].round(6)) <= {round(x, 6) for x in magnitude["x"]}
    assert len(client.get(HOME + "zoom", params={"low": "0", "high": "50", "frfs": "0,1"}).json()["traces"]) == 2 * len(
        answer["traces"]
    )
    for wrong in ({"frfs": "2"}, {"frfs": "-1"}, {"frfs": ""}, {"frfs": "x"}, {"frfs": "0", "low": "nan"}, {}):
        query = {"low": "100", "high": "104", **wrong} if wrong else {}
        assert client.get(HOME + "zoom", params=query).status_code == 400, wrong
    assert client.get(HOME + "zoom", params={"low": "1e6", "high": "2e6", "frfs": "0"}).status_code == 400


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"host": f"evil.example:{PORT}"},
        {"host": "127.0.0.1"},
        {"host": "127.0.0.1:1"},
        {"host": ""},
        {"origin": "http://evil.example"},
        {"origin": f"http://evil.example:{PORT}"},
        {"origin": "null"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
    ids=str,
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_other_sites_are_refused(client, bench, runs, headers, method):
    text = bench.text()
    address = HOME + ("change" if method == "POST" else "")
    answer = client.request(method, address, headers=headers, json=PIN if method == "POST" else None)
    assert answer.status_code == 403
    assert (bench.text(), runs) == (text, [])


@pytest.mark.parametrize("host", [f"127.0.0.1:{PORT}", f"localhost:{PORT}"])
def test_the_page_itself_is_let_in(client, host):
    headers = {"host": host, "origin": f"http://{host}", "sec-fetch-site": "same-origin"}
    assert client.post(HOME + "change", json=PIN, headers=headers).status_code == 200


@pytest.mark.parametrize("address", ["/", "/change", "/state", f"/{TOKEN[:-1]}/", f"/{TOKEN}x/", "//", f"//{TOKEN}/"])
def test_nothing_is_there_without_the_token(client, bench, address):
    text = bench.text()
    assert client.get(address).status_code == 403
    assert client.post(address, json=PIN).status_code == 403
    assert bench.text() == text


def test_changes_come_as_short_json_only(client, bench):
    text = bench.text()
    plain = {"content-type": "text/plain"}
    assert client.post(HOME + "change", content='{"kind": "pin", "hz": 250}', headers=plain).status_code == 415
    assert client.post(HOME + "change", content="{", headers={"content-type": "application/json"}).status_code == 400
    assert client.post(HOME + "change", json={**PIN, "x": "y" * 30_000}).status_code == 413
    assert client.get(HOME + "change").status_code == 405
    assert bench.text() == text


def files_of(client):
    """Address of the folder's files, as the page has it."""
    return HOME + re.search(r'href="([^"]+)report.html"', client.get(HOME).text)[1]


def test_files_of_the_run_can_be_had_and_no_others(client, bench, demo):
    files = files_of(client)
    assert client.get(f"{files}poles.parquet").content == (demo / "out" / "poles.parquet").read_bytes()
    (demo / "secret.txt").write_text("secret", encoding="utf-8")
    (demo / "out2").mkdir()
    (demo / "out2" / "secret.txt").write_text("secret", encoding="utf-8")
    (bench.folder / "link.txt").symlink_to(demo / "secret.txt")
    (bench.folder / ".partial-1").mkdir()
    (bench.folder / ".partial-1" / "secret.txt").write_text("secret", encoding="utf-8")
    outside = [
        "../secret.txt",
        "..%2fsecret.txt",
        "%2e%2e/secret.txt",
        "%2e%2e%2fsecret.txt",
        "stages/..%2f..%2fsecret.txt",
        "..%2fout2/secret.txt",
        "%2fetc%2fpasswd",
        "/etc/passwd",
        str(demo / "secret.txt"),
        "link.txt",
        ".partial-1/secret.txt",
        "stages",
        "",
        "x%00y",
    ]
    for path in outside:
        answer = client.get(f"{files}{path}")
        assert (answer.status_code, "secret" in answer.text) == (404, False), path


def test_what_lies_in_the_folder_has_no_origin_and_runs_the_scripts_of_reports_only(client, bench):
    files = files_of(client)
    assert TOKEN not in files.removeprefix(HOME)
    for name in ("page.html", "picture.svg", "script.js", "page.xhtml", "page.htm", "README", "picture.png", "x.HTML"):
        (bench.folder / name).write_text("<script>1</script>", encoding="utf-8")
        headers = client.get(files + name).headers
        policy = headers["content-security-policy"]
        assert "sandbox allow-scripts allow-downloads allow-modals;" in policy
        assert "allow-same-origin" not in policy
        assert "'unsafe-inline'" not in policy.replace("style-src 'unsafe-inline'", "")
        is_shown = name.lower().endswith((".html", ".svg", ".png"))
        assert ("attachment" in headers.get("content-disposition", "")) != is_shown, name
        assert is_shown or headers["content-type"] == "application/octet-stream"
    report = (bench.folder / "report.html").read_text(encoding="utf-8")
    digests = set(re.findall(r"sha256-([\w+/=]+)", policy))
    packed = re.search(r'<script[^>]* id="library"[^>]*>(.*?)</script>', report, re.DOTALL)[1]
    scripts = [*re.findall(r"<script>(.*?)</script>", report, re.DOTALL), gunzip(base64.b64decode(packed)).decode()]
    assert digests == {base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts}


def test_requests_of_a_sandboxed_page_are_refused_even_with_the_token(client, bench):
    text = bench.text()
    for headers in ({"origin": "null"}, {"sec-fetch-site": "cross-site"}):
        assert client.post(HOME + "change", json=PIN, headers=headers).status_code == 403
    assert client.post(files_of(client) + "change", json=PIN).status_code == 405
    assert bench.text() == text


def test_code_that_a_pipeline_names_is_run_only_after_it_was_allowed(client, bench, runs):
    (bench.pipeline.parent / "own.py").write_text("raise SystemExit", encoding="utf-8")
    text = bench.text().replace("[diagnose]\n", '[diagnose]\nextra_effects = ["own.py:Own"]\n')
    bench.pipeline.write_text(text, encoding="utf-8")
    text = bench.text()
    for address, wish in (("run", {}), ("change", PIN)):
        answer = client.post(HOME + address, json=wish)
        assert answer.status_code == 400
        assert "extra_effects names code (own.py:Own)" in answer.json()["error"]
    assert (bench.text(), runs) == (text, [])
    assert client.post(HOME + "allow", json={"digest": "0"}).status_code == 400
    digest = re.search(r'data-allow="(\w+)"', client.get(HOME).text)[1]
    assert "data-allow" not in client.post(HOME + "allow", json={"digest": digest}).json()["choices"]
    assert client.post(HOME + "run", json={}).status_code == 200
    bench.wait(SOON_S)
    assert runs == [bench.pipeline]
    (bench.pipeline.parent / "own.py").write_text("import os", encoding="utf-8")
    assert client.post(HOME + "run", json={}).status_code == 400


def test_every_answer_forbids_foreign_frames_scripts_and_copies(client):
    for address in (HOME, HOME + "state", files_of(client) + "report.html", "/elsewhere"):
        headers = client.get(address).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
    assert "access-control-allow-origin" not in client.get(HOME, headers={"origin": f"http://127.0.0.1:{PORT}"}).headers


def test_a_run_without_its_pipeline_file_is_shown_without_forms(client, bench):
    bench.pipeline.unlink()
    page = client.get(HOME)
    assert "Nothing can be changed" in page.text
    assert 'id="pole-form"' not in page.text


def test_what_the_page_shows_of_the_file_is_escaped(client):
    wish = {"kind": "reject", "hz": 101.8, "why": "<img src=x onerror=alert(1)>"}
    assert client.post(HOME + "change", json=wish).status_code == 200
    page = client.get(HOME).text
    assert "<img" not in page
    assert "&lt;img src=x" in page


def test_a_damaged_result_is_said(client, bench):
    assert client.get(HOME).status_code == 200
    (current_folder(bench.folder) / "stages" / "fit.result").write_bytes(b"no result")
    (current_folder(bench.folder) / "run.json").touch()
    answer = client.get(HOME)
    assert answer.status_code == 400
    assert "is damaged" in answer.json()["error"]
    with pytest.raises(InputError):
        bench.contents()
