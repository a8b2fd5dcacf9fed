"""The page holds what the run holds, and nothing else."""

import base64
import gzip
import hashlib
import html
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import plotly.graph_objects as go
import pytest

from frf_ipz.dofs import Dof
from frf_ipz.report.html import REPORT, SCRIPTS
from frf_ipz.report.page import SECTIONS, page_margins, write_report
from frf_ipz.report.sections import prediction
from frf_ipz.runs.results import Results
from frf_ipz.updating.updated_model import nothing_to_do
from synthetic_run import Folder, many_frfs, synthetic_folder

MODEL_STAGES = ("reduce", "pair", "update", "predict", "export", "model", "reference")
MOST_BYTES = 10_000_000


class Reader(HTMLParser):
    """Collects anchors, links, sources and text."""

    def __init__(self):
        super().__init__()
        self.ids, self.links, self.sources, self.alts, self.options = [], [], [], [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes, tag=tag)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [values["href"]] if "href" in values else []
        self.sources += [values[key] for key in ("src", "srcset") if key in values]
        self.options += [values["value"]] if tag == "option" and "data-alt" in values else []
        self.alts += [values["data-alt"]] if "data-alt" in values else []
        is_picture = values.get("aria-roledescription") == "picture"
        self.alts += [values["aria-label"]] if is_picture else []


def page_of(folder, tmp_path):
    path = tmp_path / "report.html"
    write_report(Results(folder), path)
    return path.read_text(encoding="utf-8")


def read(text):
    reader = Reader()
    reader.feed(text)
    return reader


def array_of(data, node):
    """Numbers of the page: of single precision, or counts of 16 bits on an even spacing."""
    packed = data["arrays"][node["$"]]
    if isinstance(packed, str):
        return np.frombuffer(base64.b64decode(packed), "<f4")
    counts = np.frombuffer(base64.b64decode(packed["bytes"]), "<u2")
    values = packed["low"] + packed["step"] * np.where(counts == 65535, np.nan, counts)
    return np.exp(values) if packed.get("log") else values


def data_of(text):
    return json.loads(re.search(r'id="page-data">(.*?)</script>', text, re.S)[1])


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return page_of(synthetic_folder(diagnosed=True), tmp_path_factory.mktemp("page"))


def test_every_section_is_there_in_the_order_of_the_chain(page):
    anchors = re.findall(r'<section id="([^"]+)"', page)
    assert anchors == [
        "overview",
        "comparison",
        "shapes",
        "recordings",
        "frfs",
        "stabilization",
        "poles",
        "fit",
        "pairing",
        "updating",
        "prediction",
        "diagnosis",
        "state-space",
        "provenance",
    ]
    assert len(SECTIONS) == len(anchors)


def test_notes_on_frfs_that_were_estimated_elsewhere_stand_with_them(tmp_path):
    """The command says that they do; without records they stood nowhere."""
    folder = synthetic_folder()
    estimate = folder.results["ingest"]
    notes = tuple(f"note {number} on FRFs" for number in range(5))
    folder.results["ingest"] = replace(estimate, records=estimate.records[:0], warnings=notes)
    text = page_of(folder, tmp_path)
    assert '<section id="recordings"' not in text
    (section,) = re.findall(r'<section id="frfs".*?</section>', text, re.DOTALL)
    assert all(note in section for note in notes)
    assert re.search(r"and \d+ more notes .*: .*under FRFs", Results(folder).summary())


def test_nothing_is_fetched_from_elsewhere(page):
    reader = read(page)
    assert reader.sources == []
    assert all(link.startswith("#") for link in reader.links)


def test_only_the_scripts_of_the_page_may_run(page):
    policy = re.search(r'<meta http-equiv="content-security-policy" content="([^"]+)">', page)[1]
    policy = html.unescape(policy)
    (packed,) = re.findall(r'id="library">(.*?)</script>', page)
    scripts = [
        *re.findall(r"<script>(.*?)</script>", page, re.DOTALL),
        gzip.decompress(base64.b64decode(packed)).decode(),
    ]
    digests = {base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts}
    assert set(re.findall(r"'sha256-([^']+)'", policy)) == digests
    assert len(digests) == 3
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy.replace("style-src 'unsafe-inline'", "")
    assert {"base-uri 'none'", "form-action 'none'"} <= set(policy.split("; "))
    assert page.index("http-equiv") < min(page.index("<style"), page.index("<script"), page.index("<title"))


def test_the_library_that_draws_is_the_one_that_is_noted():
    assets = files(REPORT) / "assets"
    note = (assets / "README.md").read_text(encoding="utf-8")
    noted = re.search(r"`(plotly\S+)` \| `\S+` \| (\S+) \| MIT, `(\S+)` \| `(\w+)`", note)
    library = (assets / noted[1]).read_bytes()
    assert noted[1] in SCRIPTS
    assert hashlib.sha256(library).hexdigest() == noted[4]
    assert f"v{noted[2]}\n".encode() in library[:200]
    assert (assets / noted[3]).read_text(encoding="utf-8").startswith("MIT License")
    assert not re.search(rb"new Worker|new Function|\beval\(", library)


def test_links_lead_somewhere_and_names_are_unique(page):
    reader = read(page)
    assert {link[1:] for link in reader.links} <= set(reader.ids)
    assert len(set(reader.ids)) == len(reader.ids)


def test_every_picture_has_a_place_and_words(page):
    reader, data = read(page), data_of(page)
    assert set(data["pictures"]) <= {*reader.ids, *reader.options}
    assert len(set(reader.alts)) == len(data["pictures"])  # of several to choose from the first is on the page twice
    assert all(len(alt) > 20 for alt in reader.alts)


def test_names_of_the_user_cannot_become_markup(page):
    assert "synthetic <beam>" not in page
    assert "synthetic &lt;beam&gt;" in page


def test_plotly_knows_all_that_the_pictures_ask_for(page):
    data = data_of(page)

    def plain(node):
        if isinstance(node, list):
            return [plain(item) for item in node]
        if isinstance(node, dict):
            if "$" in node:
                return array_of(data, node)
            return {key: plain(item) for key, item in node.items()}
        return "#123456" if isinstance(node, str) and node.startswith("@") else node

    for picture in data["pictures"].values():
        figure = go.Figure(data=plain(picture["data"]), layout=plain(picture["layout"]))
        for trace in figure.data:
            assert trace.type == "heatmap" or len(trace.y) == len(trace.x)


def test_the_library_takes_a_third_of_its_size(page):
    (packed,) = re.findall(r'id="library">(.*?)</script>', page)
    library = (files(REPORT) / "assets" / "plotly-cartesian.min.js").read_bytes()
    assert gzip.decompress(base64.b64decode(packed)) == library
    assert len(packed) < 0.5 * len(library)


def test_who_measured_what_for_whom_stands_on_the_page_where_the_test_states_it(tmp_path):
    folder = synthetic_folder()
    assert "particulars" not in page_of(folder, tmp_path).split("</style>")[1]
    folder.manifest["test"] = {"name": "beam", "kind": "hammer", "operator": "A. Meier", "date": "2026-11-27"}
    text = page_of(folder, tmp_path)
    assert re.findall(r"<dt>([^<]+)</dt><dd>([^<]+)</dd></div>", text)[:2] == [
        ("Operator", "A. Meier"),
        ("Measured on", "2026-11-27"),
    ]


@pytest.mark.parametrize("root", ["/home/me/secret", "C:\\Users\\me\\secret", "D:/secret"])
def test_no_folder_above_the_campaign_stands_on_the_page(tmp_path, root):
    folder = synthetic_folder()
    folder.manifest |= {
        "pipeline": f"{root}/beam/pipelines/beam.toml",
        "inputs": {f"{root}/beam/pipelines/../data/test.toml": "0" * 64, "/mnt/elsewhere/model.toml": "1" * 64},
        "configuration": {"pipeline": {"test": f"{root}/beam/data/test.toml"}, "diagnose": {"extra_effects": [root]}},
    }
    text = html.unescape(page_of(folder, tmp_path))
    assert "secret" not in text.replace('"secret"', "")
    assert "elsewhere" not in text
    assert text.count("../data/test.toml") == 2
    assert ">model.toml<" in text


@pytest.mark.parametrize("name", ["beam", 'a"; } body { display: none } "', "a\\", "a\n</style><script>", "𝜔 ω"])
def test_the_margins_of_printed_pages_hold_any_name_as_text(name):
    rules = page_margins(Results(Folder(results={}, manifest={"name": name, "when": "2026-11-27T10:00"}, stale=())))
    (text,) = re.findall(r'@top-left { content: "((?:\\[0-9a-f]{6})*)"; }', rules)
    said = "".join(chr(int(code, 16)) for code in text.split("\\")[1:])
    assert said == name.replace("\n", " ")
    assert re.sub(r'"[^"]*"', "", rules).count("}") == 5
    assert '"page " counter(page) " of " counter(pages)' in rules


def test_a_run_that_ends_with_the_fit_says_what_was_found(tmp_path):
    text = page_of(synthetic_folder(without=MODEL_STAGES), tmp_path)
    assert "5 modes found between" in text
    assert '<section id="updating"' not in text
    assert '<section id="fit"' in text


def test_a_run_without_points_of_interest_states_the_measured_ones(tmp_path):
    text = page_of(synthetic_folder(without=("predict", "reference")), tmp_path)
    assert "Error at the measured points" in text
    assert '<section id="prediction"' not in text


def test_a_run_without_a_diagnosis_has_no_such_section(tmp_path):
    text = page_of(synthetic_folder(), tmp_path)
    assert '<section id="diagnosis"' not in text
    assert "no diagnosis was run" in text


def test_recordings_alone_make_a_page(tmp_path):
    text = page_of(synthetic_folder(without=("fit", *MODEL_STAGES)), tmp_path)
    assert "nothing fitted yet" in text


def test_an_empty_run_makes_a_page(tmp_path):
    text = page_of(Folder(results={}, manifest={}, stale=()), tmp_path)
    assert "holds no results yet" in text


def test_results_made_before_the_last_change_are_named(tmp_path):
    folder = synthetic_folder()
    folder.stale = ("update",)
    assert "not yet run again: update" in page_of(folder, tmp_path)


def test_a_hundred_frfs_stay_light_and_keep_their_peaks(tmp_path):
    recordings = many_frfs(100, 20_000)
    text = page_of(Folder(results={"ingest": recordings}, manifest={"stages": {"ingest": {}}}, stale=()), tmp_path)
    assert len(text.encode()) < MOST_BYTES
    data = data_of(text)
    drawn = [trace for trace in data["pictures"]["frf"]["data"] if "yaxis" not in trace and "fill" not in trace]
    curves = [trace for trace in drawn if trace.get("showlegend", True)]
    assert len(curves) == 100
    for place, trace in enumerate(curves):
        magnitude = array_of(data, trace["y"])
        exact = np.abs(recordings.frfs.values[:, place])
        np.testing.assert_allclose([magnitude.max(), magnitude.min()], [exact.max(), exact.min()], rtol=1e-6, atol=0)


def test_the_regularisation_of_an_update_is_shown(tmp_path):
    folder = synthetic_folder()
    update = folder.results["update"]
    history = update.history.assign(**{"std: a factor on the stiffness": 0.0525, "std: damping of each mode": np.nan})
    folder.results["update"] = replace(update, history=history)
    text = page_of(folder, tmp_path)
    phase = history["phase"].iloc[0]
    assert f"regularisation of the {phase}" in text
    assert "a factor on the stiffness 0.0525" in text
    assert "damping of each mode nan" not in text


def test_a_fit_without_modes_and_an_update_without_targets_make_a_page(tmp_path):
    folder = synthetic_folder()
    results = folder.results
    fit = results["fit"]
    nothing = np.zeros(0, complex)
    results["fit"] = replace(
        fit,
        n_modes=0,
        model=replace(fit.model, poles=nothing, residues=np.zeros((0, len(fit.labels)), complex)),
        zeros=replace(
            fit.zeros, values=nothing, frf=np.zeros(0, int), kind=(), identifiable=np.zeros(0, bool), reason=()
        ),
        covariance=np.zeros((0, 0)),
        residue_covariance=np.zeros((0, len(fit.labels), 2, 2)),
        modes=fit.modes[:0],
    )
    results["pair"] = replace(results["pair"], rows=())
    results["update"] = nothing_to_do(results["reduce"], "minimal-change")
    text = page_of(folder, tmp_path)
    assert "the model is left as it was" in text
    assert '<section id="updating"' in text


def test_records_of_a_shaker_are_drawn_from_their_start(tmp_path):
    folder = synthetic_folder(without=("fit", *MODEL_STAGES))
    recordings = folder.results["ingest"]
    records = recordings.records[["record", "used"]].assign(trigger_s=0.0)
    folder.results["ingest"] = replace(recordings, records=records)
    assert "Forces as recorded</figcaption>" in page_of(folder, tmp_path)


def test_pulses_are_aligned_where_they_set_in(tmp_path):
    folder = synthetic_folder(without=("fit", *MODEL_STAGES))
    recordings = folder.results["ingest"]
    folder.results["ingest"] = replace(recordings, records=recordings.records.assign(trigger_s=0.02))
    data = data_of(page_of(folder, tmp_path))
    time_ms = array_of(data, data["pictures"]["records"]["data"][0]["x"])
    np.testing.assert_allclose(time_ms, 1e3 * (recordings.traces[0].time_s - 0.02), rtol=1e-6, atol=1e-5)  # in float32


def test_a_run_that_names_no_points_predicts_nothing(tmp_path):
    folder = synthetic_folder()
    prediction = folder.results["predict"]
    empty = {
        name: getattr(prediction, name)[:, :0] for name in ("values", "nominal", "magnitude_low", "magnitude_high")
    }
    zeros = replace(
        prediction.zeros,
        values=np.zeros(0, complex),
        frf=np.zeros(0, int),
        kind=(),
        identifiable=np.zeros(0, bool),
        reason=(),
    )
    folder.results["predict"] = replace(prediction, labels=(), zeros=zeros, zero_std=np.zeros((0, 2)), **empty)
    text = page_of(folder, tmp_path)
    assert '<section id="prediction"' not in text
    assert "and predicts" not in text


@pytest.mark.parametrize(("count", "n_figures", "choices"), [(1, 0, []), (2, 1, []), (4, 0, [3])])
def test_predicted_frfs_beyond_the_first_two_are_there_by_choice(count, n_figures, choices):
    folder = synthetic_folder(without=("reference",))
    one = folder.results["predict"]
    labels = tuple(replace(one.labels[0], input_dof=Dof(node, "z")) for node in range(1, count + 1))
    wide = {
        name: np.repeat(getattr(one, name), count, axis=-1)
        for name in ("values", "nominal", "magnitude_low", "magnitude_high")
    }
    folder.results["predict"] = replace(one, labels=labels, **wide)
    blocks = prediction.build(Results(folder)).blocks
    assert [len(block.pictures) for block in blocks if block.kind == "choice"] == choices
    assert sum(block.kind == "figure" for block in blocks) == n_figures
