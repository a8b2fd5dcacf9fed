"""Whatever is asked of the page: a request that makes no sense gets a status 4xx and one line, and changes nothing."""

import json
import random
import re

import pytest
from starlette.testclient import TestClient

from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.show.app import build_app
from frf_ipz.show.campaign import RunPaths
from frf_ipz.show.workbench import Workbench

PORT, TOKEN = 8765, "drawn-at-random"
HOME = f"/{TOKEN}/"
N_CHANGES, N_QUERIES = 200, 200

ODD = [
    None, True, -1, 0, 10**400, 1e308, -1e308, 1e-320, "", " ", "\0", "\ud800", "\u202e", "x" * 5000, "18:+z", "0:",
    ":", "18:+z" * 50, "999999999999999999999:+z", "NaN", "1e999", "../../x", "<script>", "%00", "9" * 5000, "٣", [],
    {}, [[]], [None], {"a": {}}, ["18:+z"] * 200, [1e308, -1e308], {"hz": 1}, "'", '"', '"""', "\n[fit]\nband_hz = 3",
    "]]", "#", "\\", "\r\n",
]  # fmt: skip
WISHES = [
    {"kind": "pin", "hz": 250.0, "why": "seen"},
    {"kind": "reject", "hz": 101.8, "why": "a cable"},
    {"kind": "exclude", "low_hz": 40.0, "high_hz": 60.0, "on": True},
    {"kind": "band", "low_hz": 20.0, "high_hz": 400.0, "on": True},
    {"kind": "record", "name": "hits/p69_02.csv", "use": "drop"},
    {"kind": "sensor", "dof": "89:+z", "on": True},
    {"kind": "point", "dof": "33:+z", "on": True},
    {"kind": "retain", "dofs": ["18:z", "33:z"], "on": True},
]
QUERIES = {
    "shape": {"mode": "1", "hz": "60", "input": "89:+z"},
    "zoom": {"low": "100", "high": "104", "frfs": "0,1"},
    "state": {},
    "choices": {},
    "": {},
}
BODIES = [
    b"", b"{", b"null", b"[]", b"3", b'"x"', b"\xff\xfe", b'{"kind": "pin", "hz": NaN}',
    b'{"kind": "pin", "hz": Infinity}', b'{"kind": "pin", "hz": 1e999}', b"[" * 15_000, b'{"a":' * 3_000,
    b'{"kind": "\\ud800"}', b'{"kind": "pin", "hz": ' + b"9" * 5_000 + b"}", b'{"kind": ["pin"]}', b'{"kind": {}}',
    b'{"kind": "pin", "kind": "reject"}', b"\xef\xbb\xbf{}", b'{"kind": "pin", "hz": 250} x', b"nan",
]  # fmt: skip
FILES = [
    "x" * 3000, "x/" * 2000, "%ff%fe", "%00", "%2e%2e/pipeline.toml", "stages", "", "a//b", "~", "%0a", "run.json/x",
    "%5c",
]  # fmt: skip
PATHS = [
    "x" * 3000, "%ff%fe", "%00", "shape/", "1/", "0/", "-1/", "9" * 5000, "run", "change/", "..", "%2e%2e/", "\\",
    "a//b", "*", "~", "%", "%zz",
]  # fmt: skip
VERBS = ["HEAD", "OPTIONS", "PUT", "DELETE", "PATCH", "TRACE", "CONNECT", "PROPFIND", "XYZZY", "get"]


@pytest.fixture
def bench(demo):
    return Workbench(RunPaths(folder=demo / "out", pipeline=demo / "pipeline.toml"), lambda *_, **__: None, read_inputs)


@pytest.fixture
def client(bench):
    app = build_app([bench], port=PORT, token=TOKEN)
    return TestClient(app, base_url=f"http://127.0.0.1:{PORT}", raise_server_exceptions=False, follow_redirects=False)


def said(answer):
    """What the user reads of it."""
    kind = answer.headers.get("content-type", "")
    return answer.json()["error"] if kind.startswith("application/json") else answer.text


def is_refused(answer):
    return 400 <= answer.status_code < 500 and len(said(answer).strip().splitlines()) == 1


def post(client, content, address="change"):
    return client.post(HOME + address, content=content, headers={"content-type": "application/json"})


def mutate(table, chance):
    changed = dict(table)
    for _ in range(chance.randint(1, 3)):
        key = chance.choice([*changed, "on", "why", "extra", ""])
        action = chance.random()
        if action < 0.2:
            changed.pop(key, None)
        elif action < 0.9:
            changed[key] = chance.choice(ODD)
        else:
            changed = {**changed, chance.choice(["", "__class__", "kind ", "\0"]): chance.choice(ODD)}
    return changed


def test_bodies_that_are_no_change_are_refused(client, bench):
    text = bench.text()
    for body in BODIES:
        answer = post(client, body)
        assert is_refused(answer), (body[:60], answer.status_code, answer.text[:200])
    assert bench.text() == text


def test_changes_that_are_garbled_are_refused_or_leave_a_pipeline_that_can_be_read(client, bench):
    chance = random.Random(40)
    first = bench.text()
    n_refused = 0
    for _ in range(N_CHANGES):
        before = bench.text()
        wish = mutate(chance.choice(WISHES), chance)
        answer = post(client, json.dumps(wish).encode())
        if answer.status_code != 200:
            assert is_refused(answer), (wish, answer.status_code, answer.text)
            assert bench.text() == before, wish
            n_refused += 1
            continue
        assert client.get(HOME + "choices").status_code == 200, wish
        bench.choices()
        bench.pipeline.write_text(first, encoding="utf-8")
    assert n_refused > N_CHANGES // 2


def test_queries_that_are_garbled_are_refused_or_answered(client):
    chance = random.Random(41)
    texts = [value for value in ODD if isinstance(value, str) and "\ud800" not in value]
    for _ in range(N_QUERIES):
        address = chance.choice(["shape", "zoom", "zoom", "shape", "state", "choices"])
        query = dict(QUERIES[address])
        for key in chance.sample([*query, "extra", "mode"], k=min(2, len(query) + 1)):
            query[key] = chance.choice([*texts, "inf", "nan", "-0", "1e308", "0,0,0", ",", "1_0", " 1 "])
        answer = client.get(HOME + address, params=query)
        assert answer.status_code == 200 or is_refused(answer), (address, query, answer.status_code, answer.text)


def test_paths_and_verbs_that_are_not_there_are_refused(client):
    for path in PATHS:
        answer = client.get(HOME + path)
        assert answer.status_code in {307} or is_refused(answer), (path, answer.status_code)
    files = re.search(r'href="([^"]+)report.html"', client.get(HOME).text)[1]
    for path in FILES:
        answer = client.get(f"{HOME}{files}{path}")
        assert is_refused(answer), (path[:60], answer.status_code)
    for verb in VERBS:
        for path in ("", "change", "state", "run", "undo", "page.css", "nowhere"):
            answer = client.request(verb, HOME + path)
            assert (
                answer.status_code == 200
                if verb == "HEAD" and path in {"", "state"}
                else answer.status_code in {404, 405, 200}
            ), (verb, path, answer)


@pytest.mark.parametrize("length", ["-1", "1e3", "x", "", "99999999999999999999", "٣", "20001"])
def test_lengths_that_are_none_are_refused(client, length):
    answer = client.post(
        HOME + "change",
        content=b"{}",
        headers={"content-length": length.encode("utf-8"), "content-type": "application/json"},
    )
    assert is_refused(answer)
