"""What a user gets wrong in a campaign that runs to its end is said first: the cause, and the line to correct.

Three sensors and three struck points on the continuous cantilever of `small_campaign`; the model is 5 % too soft, which
is no mistake.
"""

import sys

import numpy as np
import pandas as pd
import pytest

import frf_ipz
from frf_ipz.cli import main as command
from small_campaign import MODEL, RATE, accelerance, write_campaign

SENSORS, STRUCK = {"tip": 21, "middle": 13, "root": 8}, (10, 15, 18)
SAMPLES, START, WIDTH = 2048, 0.02, 1.2e-3
NOISE = 5e-4  # of the peak of each channel
CHANNEL = """
[[channel]]
column = "{column}"
role = "output"
quantity = "acceleration"
unit = "m/s^2"
dof = "{node}:+z"
"""
HEAD = """
[test]
name = "three sensors"
kind = "hammer"
[[channel]]
column = "force"
role = "input"
quantity = "force"
unit = "N"
"""
HITS = "".join(f'[[hit]]\ndof = "{node}:+z"\nfiles = ["hits/at_{node}_*.csv"]\n' for node in STRUCK)
TEST = HEAD + "".join(CHANNEL.format(column=column, node=node) for column, node in SENSORS.items()) + HITS


def impact(node, level, rng):
    """Force and accelerations of one impact, transformed on a damped line."""
    time = np.arange(SAMPLES) / RATE
    near = abs(time - START) < WIDTH
    force = np.where(near, np.cos(np.pi * (time - START) / WIDTH / 2) ** 4, 0.0) * level
    decay = 12.0 / time[-1]
    window = np.exp(-decay * time)
    s = decay + 2j * np.pi * np.fft.rfftfreq(SAMPLES, 1 / RATE)
    spectrum = np.fft.rfft(force * window)
    channels = {"force": force}
    for column, sensor in SENSORS.items():
        frf = accelerance(s, (sensor - 1) / 20, (node - 1) / 20)
        channels[column] = np.fft.irfft(frf * spectrum, SAMPLES) / window
    noisy = {name: values + NOISE * abs(values).max() * rng.normal(size=SAMPLES) for name, values in channels.items()}
    return pd.DataFrame({"time": time, **noisy})


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The campaign as it should have been written down."""
    folder = tmp_path_factory.mktemp("sound")
    write_campaign(folder, records=0)
    rng = np.random.default_rng(3)
    (folder / "hits").mkdir()
    for node in STRUCK:
        for number, level in enumerate((50.0, 60.0)):
            impact(node, level, rng).to_csv(folder / "hits" / f"at_{node}_{number}.csv", index=False)
    (folder / "test.toml").write_text(TEST)
    return folder


@pytest.fixture
def campaign(sound, tmp_path):
    """A copy that may be spoilt."""
    for path in sound.rglob("*"):
        target = tmp_path / path.relative_to(sound)
        target.mkdir() if path.is_dir() else target.write_bytes(path.read_bytes())
    return tmp_path


def edit(name, old, new):
    def spoil(folder):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return spoil


def rewrite(change):
    def spoil(folder):
        for path in (folder / "hits").glob("*.csv"):
            change(pd.read_csv(path)).to_csv(path, index=False)

    return spoil


def exchanged(first, second):
    def spoil(folder):
        text = (folder / "test.toml").read_text()
        text = text.replace(f'"{first}:+z"', "@").replace(f'"{second}:+z"', f'"{first}:+z"')
        (folder / "test.toml").write_text(text.replace("@", f'"{second}:+z"'))

    return spoil


YOUNG = next(line for line in MODEL.splitlines() if line.startswith("youngs_modulus_Pa"))
MODULUS = float(YOUNG.split("=")[1])
OUTPUTS = list(SENSORS)
MISTAKES = {
    "a modulus three times too high": (
        edit("model.toml", YOUNG, f"youngs_modulus_Pa = {3 * MODULUS}"),
        "Young's modulus",
        "model.toml, [beam] youngs_modulus_Pa",
    ),
    "a modulus in GPa": (
        edit("model.toml", YOUNG, f"youngs_modulus_Pa = {1e-9 * MODULUS}"),
        "Young's modulus seems to be written in GPa",
        "model.toml, [beam] youngs_modulus_Pa",
    ),
    "a modulus off by ten": (
        edit("model.toml", YOUNG, f"youngs_modulus_Pa = {0.1 * MODULUS}"),
        "Young's modulus",
        "model.toml, [beam] youngs_modulus_Pa",
    ),
    "a thickness in mm": (
        edit("model.toml", "thickness_m = 0.005", "thickness_m = 5.0"),
        "the thickness seems to be written in mm",
        "model.toml, [beam] thickness_m",
    ),
    "accelerations in g": (
        rewrite(lambda table: table.assign(**{name: table[name] / 9.80665 for name in OUTPUTS})),
        "every response is in g, and is read as m/s^2",
        "test.toml, [[channel]] unit",
    ),
    "two struck points exchanged": (
        exchanged(10, 18),
        "the excited points",
        "test.toml, dof of",
    ),
    "columns of force and acceleration exchanged": (
        rewrite(lambda table: table.assign(force=table["tip"], tip=table["force"])),
        "the columns 'force' and 'tip' are exchanged",
        "test.toml, [[channel]] column = 'force' and column = 'tip'",
    ),
    "a sensor reversed": (
        rewrite(lambda table: table.assign(middle=-table["middle"])),
        "the sensor of 'middle' measures the other way round",
        "test.toml, [[channel]] column = 'middle': dof",
    ),
}

# Left to the slow suite: other numbers of the model than one in the quick one, and columns, which tests of causes have.
ALIKE = {
    "a modulus in GPa",
    "a modulus off by ten",
    "a thickness in mm",
    "columns of force and acceleration exchanged",
}


def run(folder, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "run", str(folder / "pipeline.toml"), "--out", str(folder / "out")])
    with pytest.raises(SystemExit) as stop:
        command.main()
    captured = capsys.readouterr()
    return stop.value.code or 0, " ".join((captured.out + captured.err).split())


@pytest.mark.parametrize(
    "case",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in ALIKE), id=name.replace(" ", "-")) for name in MISTAKES],
)
def test_a_mistake_is_named_first_with_its_line(case, campaign, monkeypatch, capsys):
    spoil, says, place = MISTAKES[case]
    spoil(campaign)
    status, said = run(campaign, monkeypatch, capsys)
    assert says in said
    assert place in said
    if status == 0:
        assessment = frf_ipz.open_results(campaign / "out").assessment
        assert assessment.verdict is not frf_ipz.Verdict.USABLE
        assert assessment.likely_cause.place in said
    else:  # numbers do not suffice for such a model: the message says why
        assert status == 2
        assert said.startswith("frf-ipz: ")
        assert "most likely" in said


def test_nothing_is_named_where_nothing_is_wrong(campaign, monkeypatch, capsys):
    status, said = run(campaign, monkeypatch, capsys)
    assert not status, said
    assessment = frf_ipz.open_results(campaign / "out").assessment
    assert assessment.likely_cause is None
    assert assessment.verdict is not frf_ipz.Verdict.NOT_USABLE
