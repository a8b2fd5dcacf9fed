"""The first steps of a new user: files to start from, and a look at the set-up before anything is run."""

import re
import sys

import numpy as np
import pytest
from scipy import sparse
from scipy.io import mmwrite

from frf_ipz.cli import main as command
from frf_ipz.errors import InputError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.model_file import read_model
from frf_ipz.ingest import recording_files
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.formats.registry import open_recording
from frf_ipz.pipeline.check.setup import describe_setup
from frf_ipz.pipeline.config import read_pipeline
from frf_ipz.pipeline.init.starting_files import write_starting_files
from frf_ipz.pipeline.inputs import read_inputs
from small_campaign import write_campaign


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path)
    return tmp_path


def test_init_writes_files_that_can_be_read_as_they_are(campaign):
    for name in ("test.toml", "pipeline.toml"):
        (campaign / name).unlink()
    written = write_starting_files(campaign).written
    assert {path.name: is_new for path, is_new in written.items()} == {
        "test.toml": True,
        "model.toml": False,
        "pipeline.toml": True,
    }
    test = read_test(campaign / "test.toml")
    assert test.input_channel.column == "force"
    assert [channel.column for channel in test.output_channels] == ["acc"]
    assert len(test.files) == 3
    assert read_pipeline(campaign / "pipeline.toml").model_path == campaign / "model.toml"


def test_init_leaves_what_is_there(campaign):
    before = (campaign / "test.toml").read_text()
    assert not any(write_starting_files(campaign).written.values())
    assert (campaign / "test.toml").read_text() == before


def test_check_reads_each_recording_once(campaign, monkeypatch):
    opened = []

    def counting(path, *arguments):
        opened.append(path.name)
        return open_recording(path, *arguments)

    monkeypatch.setattr(recording_files, "open_recording", counting)
    describe_setup(read_inputs(campaign))
    assert sorted(opened) == ["blow_1.csv", "blow_2.csv", "blow_3.csv"]


def test_init_groups_blows_by_the_name_of_their_files(campaign):
    for name in ("test.toml", "model.toml"):  # without a model every node is possible
        (campaign / name).unlink()
    for number, name in enumerate(["p18_01", "p18_02", "p180_01"]):
        (campaign / "hits" / f"blow_{number + 1}.csv").rename(campaign / "hits" / f"{name}.csv")
    write_starting_files(campaign)
    test = read_test(campaign / "test.toml")
    assert {str(setup.input_dof): len(setup.files) for setup in test.setups} == {"180:+z": 1, "18:+z": 2}


def test_init_of_frfs_writes_a_test_of_their_kind(tmp_path):
    (tmp_path / "frf.csv").write_text(
        "frequency_hz,output_dof,input_dof,real,imag\n1,1:+z,2:+z,0.1,0\n2,1:+z,2:+z,1,0\n"
    )
    write_starting_files(tmp_path)
    assert read_test(tmp_path / "test.toml").kind == "frf"


def test_init_takes_magnitudes_for_no_recording(tmp_path):
    (tmp_path / "mag.csv").write_text("Frequency [Hz];Magnitude [m/N]\n" + "".join(f"{n};0.5\n" for n in range(99)))
    with pytest.raises(InputError, match=r"mag\.csv: its header names frequencies and magnitudes, without a phase"):
        write_starting_files(tmp_path)


def test_init_of_an_empty_folder_says_so(tmp_path):
    with pytest.raises(InputError, match="no recordings and no FRFs in a format that is read"):
        write_starting_files(tmp_path)


def test_init_refuses_columns_that_differ(campaign):
    (campaign / "hits" / "blow_2.csv").write_text("time,a\n0,1\n1,2\n")
    with pytest.raises(InputError, match=r"blow_2\.csv.*columns"):
        write_starting_files(campaign)


def test_check_draws_the_set_up_and_writes_nothing(campaign, monkeypatch, capsys):
    before = sorted(campaign.rglob("*"))
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "check", str(campaign / "pipeline.toml")])
    with pytest.raises(SystemExit) as stop:
        command.main()
    assert not stop.value.code
    drawing = capsys.readouterr().out
    assert "21:+z" in drawing
    assert drawing.splitlines()[2].startswith("#")
    assert {"S", "F", "*"} <= set(drawing.splitlines()[2])
    assert sorted(campaign.rglob("*")) == before


def only_recordings(folder, change):
    for name in ("test.toml", "pipeline.toml"):
        (folder / name).unlink()
    for path in (folder / "hits").glob("*.csv"):
        path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")


def add_columns(text):
    head, *rows = text.splitlines()
    return "\n".join([f",{head},acc", *(f"{n},{row},{row.split(',')[-1]}" for n, row in enumerate(rows))]) + "\n"


@pytest.mark.parametrize(
    ("change", "columns"),
    [
        (lambda text: "Test,Beam\nTime of test,12:30:05\n\n" + text, ["force", "acc"]),
        (lambda text: "written by a logger\n\n" + text, ["force", "acc"]),
        (lambda text: "sep=;\n" + text.replace(",", ";"), ["force", "acc"]),
        (lambda text: text.replace("\n", ",\n"), ["force", "acc"]),
        (add_columns, ["force", "4", "5"]),
        (lambda text: add_columns(text).replace("acc,acc", "Time,acc"), ["force", "acc"]),
    ],
    ids=["preamble", "free text", "sep", "delimiter at the end", "index and a name twice", "a second time"],
)
def test_check_accepts_what_init_writes(campaign, change, columns):
    only_recordings(campaign, change)
    (campaign / "model.toml").unlink()
    write_starting_files(campaign)
    test = read_test(campaign / "test.toml")
    assert [channel.column for channel in test.channels] == columns
    assert [str(channel.dof) for channel in test.output_channels] == [f"{n}:+z" for n in range(1, len(columns))]
    assert "  read      3 x " in describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_check_opens_every_recording(campaign):
    assert "  read      3 x " in describe_setup(read_inputs(campaign / "pipeline.toml"))
    path = campaign / "hits" / "blow_2.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("acc", "acceleration"), encoding="utf-8")
    with pytest.raises(InputError, match=r"blow_2\.csv, line 1: has no column 'acc'"):
        describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_init_invents_no_rate(campaign):
    only_recordings(campaign, lambda text: "\n".join(line.partition(",")[2] for line in text.splitlines()) + "\n")
    (campaign / "model.toml").unlink()
    write_starting_files(campaign)
    assert "\n# sample_rate_hz = " in (campaign / "test.toml").read_text(encoding="utf-8")
    with pytest.raises(InputError, match=r"write sample_rate_hz = \.\.\. under \[test\]"):
        describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_check_reads_large_recordings_to_the_first_block(campaign, monkeypatch):
    monkeypatch.setattr("frf_ipz.pipeline.check.measurement.WHOLE_BYTES", 0)
    assert "  read      3 x more than " in describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_check_counts_the_recordings_that_it_cannot_read(campaign):
    for name in ("blow_1.csv", "blow_2.csv"):
        (campaign / "hits" / name).write_text("time,force,acc\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"blow_1\.csv.*2 of 3 recordings cannot be read"):
        describe_setup(read_inputs(campaign / "pipeline.toml"))


FITS = "Everything fits together. Nothing was run."


def look(campaign):
    return describe_setup(read_inputs(campaign / "pipeline.toml"))


def open_points(text):
    return [line.removeprefix("  - ") for line in text.splitlines() if line.startswith("  - ")]


def rewrite(path, *changes):
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def edit_recordings(campaign, change):
    for path in (campaign / "hits").glob("*.csv"):
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        np.savetxt(path, change(table), delimiter=",", header="time,force,acc", comments="", fmt="%.8g")


def test_check_states_what_was_measured_and_what_the_model_is(campaign):
    text = look(campaign)
    assert text.endswith(FITS)
    assert "  read      3 x 4096 samples at 4096 Hz, 1 s" in text
    header, row = text[text.index("  excited") :].splitlines()[:2]
    cells = dict(zip(re.split(r"  +", header.strip()), re.split(r"  +", row.strip()), strict=False))
    assert (cells["excited"], cells["used"]) == ("15:+z", "3 of 3")
    # a pulse of cos^4 that is 2.4 ms wide at its foot is 0.87 ms wide at half of its height
    assert float(cells["pulse, ms"].split(" to ")[0]) == pytest.approx(0.87, rel=0.1)
    assert [float(value) for value in cells["peak force, N"].split(" to ")] == pytest.approx([40, 60], rel=0.02)
    assert 600 < float(cells["force up to, Hz"]) < 2048
    assert float(re.search(r"  mass      (.*) kg", text)[1]) == pytest.approx(2700 * 0.5 * 0.025 * 0.005, rel=1e-3)
    assert "  size      0.5 m along x" in text
    peaks, model = (re.search(rf"  {name} +(.*) Hz", text)[1].split() for name in ("peaks", "  model"))
    ratios = np.array(peaks, float) / np.array(model, float)
    assert ratios == pytest.approx(np.sqrt(1 / 0.95), rel=2e-3)  # the model's modulus is 0.95 of the true one


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("modulus in GPa", ("youngs_modulus_Pa = 65550000000.0", "youngs_modulus_Pa = 65.55"), "GPa.*3.16.*e.04"),
        ("density in g/cm^3", ("density_kg_m3 = 2700.0", "density_kg_m3 = 2.7"), "g/cm.3.*0.0316"),
        ("thickness in mm", ("thickness_m = 0.005", "thickness_m = 5.0"), "(thickness|dimensions).*0.001"),
        ("steel", ("youngs_modulus_Pa = 65550000000.0", "youngs_modulus_Pa = 195e9"), "modulus.*2.8. times too high"),
        (
            "held at the other end",
            ('left = "clamped"\nright = "free"', 'left = "free"\nright = "clamped"'),
            "held at the wrong end",
        ),
    ],
    ids=lambda one: one.replace(" ", "_") if isinstance(one, str) else "",
)
def test_check_names_what_is_wrong_with_the_model(campaign, name, change, says):
    del name
    rewrite(campaign / "model.toml", change)
    if "right =" in change[0]:  # the tip is held then, and no sensor can sit there
        rewrite(campaign / "test.toml", ('dof = "21:+z"', 'dof = "20:+z"'))
    text = look(campaign)
    assert FITS not in text
    assert re.search(says, open_points(text)[0])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda table: table * [1, 1, 1 / 9.80665], "g, and is read as m/s.2"),
        (lambda table: table[:, [0, 2, 1]], "columns 'force' and 'acc' are exchanged"),
        (lambda table: table * [1, 1, -1], "measures the other way round"),
        (lambda table: table * [1000, 1, 1], "ms"),
    ],
    ids=["g", "columns", "sign", "ms"],
)
def test_check_names_what_is_wrong_with_the_recordings(campaign, change, says):
    edit_recordings(campaign, change)
    text = look(campaign)
    assert FITS not in text
    assert re.search(says, open_points(text)[0])


@pytest.mark.parametrize(
    ("file", "change", "says"),
    [
        ("test", ('dof = "21:+z"', 'dof = "4:+z"'), "test.toml: the frequencies agree"),
        ("model", ("length_m = 0.5", "length_m = 0.61"), "model.toml"),
    ],
    ids=["shapes", "length"],
)
def test_check_says_what_does_not_agree(campaign, file, change, says):
    """One sensor that is elsewhere could be many things: its unit, its place, the place of the impacts."""
    rewrite(campaign / f"{file}.toml", change)
    text = look(campaign)
    assert FITS not in text
    assert open_points(text)[0].startswith(says)


def test_check_says_that_a_point_of_interest_is_measured(campaign):
    rewrite(campaign / "pipeline.toml", ('points = ["11:+z"]', 'points = ["11:+z", "21:-z"]'))
    (point,) = open_points(look(campaign))
    assert point.startswith("the point of interest 21:-z is measured")


def test_check_says_where_the_band_goes_on_in_noise(campaign):
    """Above some 1000 Hz there is hardly any force: what a noisy sensor shows there is its noise."""
    rng = np.random.default_rng(1)
    edit_recordings(campaign, lambda table: table + [0, 0, 0.05 * np.ptp(table[:, 2])] * rng.normal(size=table.shape))
    rewrite(campaign / "pipeline.toml", ("[10.0, 600.0]", "[10.0, 2000.0]"))
    points = open_points(look(campaign))
    says = r"\[fit\] band_hz ends at 2000 Hz, and the force at 15:\+z reaches up to \d+ Hz only"
    assert any(re.match(says, point) for point in points)


def test_check_lists_lines_that_nobody_has_looked_at(campaign):
    only_recordings(campaign, lambda text: text)
    (campaign / "model.toml").unlink()
    write_starting_files(campaign)
    path = campaign / "test.toml"
    lines = path.read_text(encoding="utf-8").splitlines()
    marked = [number for number, line in enumerate(lines, start=1) if line.endswith("CHECK")]
    text = look(campaign)
    assert FITS not in text
    assert [int(number) for number in re.findall(rf"{re.escape(str(path))}:(\d+): ", text)] == marked
    assert len(marked) > 2
    path.write_text("\n".join(line.removesuffix("CHECK") for line in lines), encoding="utf-8")
    assert look(campaign).endswith(FITS)


def test_untouched_lines_are_no_error(campaign, monkeypatch, capsys):
    rewrite(campaign / "test.toml", ('dof = "15:+z"', 'dof = "15:+z"   # where these impacts hit   CHECK'))
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "check", str(campaign)])
    with pytest.raises(SystemExit) as stop:
        command.main()
    assert not stop.value.code
    assert 'test.toml:17: dof = "15:+z"  (where these impacts hit)' in capsys.readouterr().out


def test_check_names_a_point_whose_impacts_are_mostly_left_out(campaign):
    def hit_twice(table):
        shifted = np.roll(table[:, 1], 250)
        return np.column_stack([table[:, 0], table[:, 1] + 0.6 * shifted, table[:, 2]])

    edit_recordings(campaign, hit_twice)
    points = open_points(look(campaign))
    assert any(re.match(r"2 of the 3 records at 15:\+z are left out: 3 x double hit", point) for point in points)


MATRICES = ("M", "K", "K_root", "M_root")


def write_matrices(folder):
    """Matrices of the campaign's beam, as another FE program exports them, with a part that is named."""
    model = read_inputs(folder / "pipeline.toml").fe_model
    rows = "".join(
        f"{dof.node},{dof.direction},{0.025 * (dof.node - 1)},0,0\n"
        for dof in model.dofs
        if dof.direction in {"z", "ry"}
    )
    (folder / "dofs.csv").write_text(f"node,direction,x_m,y_m,z_m\n{rows}", encoding="utf-8")
    part = sparse.diags([1.0] + [0.0] * (len(model.dofs) - 1))
    for name, matrix in zip(MATRICES, (model.mass, model.stiffness, part, 1e-6 * part), strict=True):
        mmwrite(folder / f"{name}.mtx", sparse.coo_array(matrix), symmetry="general", precision=17)


def test_init_fills_in_a_model_of_matrices(campaign):
    write_matrices(campaign)
    nominal = read_inputs(campaign / "pipeline.toml").fe_model
    for name in ("test", "model", "pipeline"):
        (campaign / f"{name}.toml").unlink()
    files = write_starting_files(campaign)
    assert all(files.written.values())
    assert files.taken_for == ("K.mtx, M.mtx: matrices of the FE model", "dofs.csv: rows of the matrices")
    inputs = read_inputs(campaign / "pipeline.toml")
    assert inputs.fe_model.kind == "matrices"
    assert [part.name for part in inputs.fe_model.parts] == ["root"]
    modes = [solve_modes(model, n_modes=3).natural_frequency_hz for model in (nominal, inputs.fe_model)]
    np.testing.assert_allclose(modes[1], modes[0], rtol=1e-9)
    assert "Lines that 'init' had to guess" in describe_setup(inputs)


def test_places_that_init_guesses_are_free_in_the_model(campaign):
    """Node 1 is clamped: no sensor can sit there, and check would refuse it."""
    for name in ("test", "pipeline"):
        (campaign / f"{name}.toml").unlink()
    write_starting_files(campaign)
    assert [str(dof) for dof in read_inputs(campaign / "pipeline.toml").test.output_dofs] == ["2:+z"]


def test_init_writes_a_skeleton_of_a_model_that_no_pipeline_names_yet(campaign):
    for name in ("test", "model", "pipeline"):
        (campaign / f"{name}.toml").unlink()
    assert write_starting_files(campaign).written[campaign / "model.toml"]
    lines = (campaign / "model.toml").read_text(encoding="utf-8").splitlines()
    assert all(line.startswith("#") for line in lines if line)
    assert read_inputs(campaign / "pipeline.toml").fe_model is None


@pytest.mark.parametrize("kind", ["beam", "lumped"])
def test_the_skeleton_without_its_comments_is_a_model(campaign, kind):
    (campaign / "model.toml").unlink()
    write_starting_files(campaign)
    path = campaign / "model.toml"
    lines = [line.removeprefix("# ") for line in path.read_text(encoding="utf-8").splitlines()]
    kept, is_wanted = [], False
    for line in lines:
        header = re.fullmatch(r"\[+(\w+)[\w.]*\]+", line)
        is_wanted = header[1] in {"model", "damping", kind} if header else is_wanted
        kept += [line] if is_wanted and (header or re.match(r"\w+ = ", line)) else []
    path.write_text("\n".join(kept).replace('kind = "beam"', f'kind = "{kind}"'), encoding="utf-8")
    assert read_model(path).kind == kind


def test_init_leaves_out_a_reference_that_does_not_say_what_it_connects(campaign):
    lines = np.arange(1.0, 200.0)
    np.savez(campaign / "truth.npz", f=lines, H=np.exp(1j * lines))
    for name in ("test", "pipeline"):
        (campaign / f"{name}.toml").unlink()
    write_starting_files(campaign)
    path = campaign / "pipeline.toml"
    text = path.read_text()
    assert re.search(r"# reference = .truth\.npz. +# no reference as it is: holds FRFs in 'H', 1 outputs x 1", text)
    assert read_inputs(path).reference is None
    path.write_text(text.replace("# reference", "reference"))
    with pytest.raises(
        InputError, match=r"pipeline\.toml, key 'predict\.reference': truth\.npz holds .* or leave it out"
    ):
        read_inputs(path)


def test_init_takes_frfs_beside_recordings_for_a_reference(campaign):
    (campaign / "kept.csv").write_text(
        "frequency_hz,output_dof,input_dof,real,imag\n1,11:+z,15:+z,0.1,0.01\n2,11:+z,15:+z,1,0.1\n", encoding="utf-8"
    )
    for name in ("test", "pipeline"):
        (campaign / f"{name}.toml").unlink()
    assert write_starting_files(campaign).taken_for == ("kept.csv: FRFs kept aside, no recording",)
    inputs = read_inputs(campaign / "pipeline.toml")
    assert inputs.reference.labels[0].output_dof == inputs.points[0]
    assert len(inputs.test.files) == 3


def test_init_prints_the_next_step(campaign, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "init", str(campaign)])
    with pytest.raises(SystemExit):
        command.main()
    assert capsys.readouterr().out.splitlines()[-1].endswith(f"then run 'frf-ipz check {campaign}'")


def columns_of_init(campaign, head, change=lambda table: table):
    (campaign / "model.toml").unlink()
    (campaign / "test.toml").unlink()
    for path in (campaign / "hits").glob("*.csv"):
        table = change(np.loadtxt(path, delimiter=",", skiprows=1))
        np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.8g")
    write_starting_files(campaign)
    test = read_test(campaign / "test.toml")
    return [(channel.column, channel.quantity) for channel in test.channels]


@pytest.mark.parametrize(
    ("head", "found"),
    [
        ("time,F,v_tip", ["force", "velocity"]),
        ("time,F_1,acc_x", ["force", "acceleration"]),
        ("time,hammer,laser [mm/s]", ["force", "velocity"]),
        ("Zeit [s],Kraft,Beschleunigung", ["force", "acceleration"]),
        ("time [s],in [N],out [um]", ["force", "displacement"]),
        ("time,force level [m/s^2],ch2 [N]", ["force", "acceleration"]),
        ("time,Kraft,Weg", ["force", "displacement"]),
        ("time,ch1,ch2 [g]", ["force", "acceleration"]),
        ("time,ch1 [m/s^2],ch2", ["force", "acceleration"]),
    ],
)
def test_init_tells_quantities_by_units_else_by_names(campaign, head, found):
    assert [quantity for _, quantity in columns_of_init(campaign, head)] == found


def test_what_units_and_names_tell_is_not_marked(campaign):
    columns_of_init(campaign, "time [s],force [N],acc [m/s^2]")
    text = (campaign / "test.toml").read_text(encoding="utf-8")
    assert not [line for line in text.splitlines() if line.startswith(("quantity", "unit")) and line.endswith("CHECK")]
    assert "Lines that 'init' had to guess" in look_without_model(campaign)


def look_without_model(campaign):
    (campaign / "pipeline.toml").unlink()
    write_starting_files(campaign)
    return look(campaign)


def test_a_second_force_is_no_response(campaign):
    found = columns_of_init(campaign, "time,force_1,acc,force_2", lambda table: np.column_stack([table, table[:, 1]]))
    assert found == [("force_1", "force"), ("acc", "acceleration")]


def test_init_says_where_no_column_can_be_the_force(campaign):
    with pytest.raises(InputError, match=r"none of the columns is a force: 'a' in mm/s, 'b' in g"):
        columns_of_init(campaign, "time [s],a [mm/s],b [g]")


def test_a_force_by_its_name_is_one_where_all_units_are_those_of_motions(campaign):
    found = columns_of_init(campaign, "time [s],force [g],acc [m/s^2]")
    assert [quantity for _, quantity in found] == ["force", "acceleration"]
    text = (campaign / "test.toml").read_text(encoding="utf-8")
    assert re.search('unit = "N" .*the files say g   CHECK\nwrong_file_unit = "g"\n', text)
    assert "used" in look_without_model(campaign)


def test_a_voltage_needs_its_sensitivity(campaign):
    (campaign / "model.toml").unlink()
    for path in (campaign / "hits").glob("*.csv"):
        path.write_text(path.read_text(encoding="utf-8").replace("force", "force [V]"), encoding="utf-8")
    (campaign / "test.toml").unlink()
    (campaign / "pipeline.toml").unlink()
    write_starting_files(campaign)
    assert re.search(r"# sensitivity = .*needed: the files are in V   CHECK", (campaign / "test.toml").read_text())
    with pytest.raises(InputError, match="'V' is no unit of force"):
        look(campaign)
