"""What forty simulated machines would have said of themselves, for whatever shows a fleet."""

import numpy as np

from frf_ipz.diagnosis.result import Estimate, Finding
from frf_ipz.fleet.machine_record import MachineRecord, Roots

HZ = np.array([16.3, 102.0, 286.0, 561.0])
SHAPES = np.linalg.qr(np.random.default_rng(0).normal(size=(5, 4)))[0] + 0j
FRFS = ("3:+z / 1:+z", "2:-z / 1:+z")
HOSTILE = '</script><script>document.title = "hacked"</script>'


def roots(rng, hz, *, frf, shapes, dofs=()):
    count = len(hz)
    return Roots(
        frf=frf,
        frequency_hz=hz,
        damping_ratio=0.01 * np.exp(0.05 * rng.normal(size=count)),
        frequency_std_hz=1e-4 * hz,
        damping_ratio_std=np.full(count, 1e-4),
        counterpart=np.arange(count) % len(HZ),
        shapes=shapes,
        dofs=dofs,
    )


def finding(effect, node, kg):
    size = Estimate(value=kg, std=0.002, low=kg - 0.004, high=kg + 0.004)
    location = {"nodes": [node]}
    return Finding(effect=effect, location=location, parameters={"mass_kg": size}, log_evidence_gain=25.0)


def simulated_machine(rng, number):
    factor = (1 + 0.002 * rng.normal()) * (1.05 if number == 7 else 1.0) * (1 - 1e-4 * number)
    hz = factor * HZ * (1 + 5e-4 * rng.normal(size=4))
    findings = [finding("added_mass", 5, 0.1 + 0.003 * rng.normal())]
    findings += [finding("grounded_mass", 9, 0.3)] if number == 11 else []
    return MachineRecord(
        machine=f"m{number:02d}",
        status="done",
        cpu_s=1.0,
        poles=roots(rng, hz, frf=("",) * 4, shapes=SHAPES, dofs=tuple(f"{node}:z" for node in range(5))),
        zeros=roots(
            rng, np.tile(0.7 * hz, 2), frf=tuple(np.repeat(FRFS, 4).tolist()), shapes=np.zeros((0, 8), complex)
        ),
        parameters={f"stiffness of element {k}": (1.1 + 0.01 * rng.normal(), 0.004) for k in range(1, 11)}
        | {f"damping of mode {k}": (1.0 + 0.05 * rng.normal(), float("nan")) for k in range(1, 5)}
        | {"mass of sensor 3:z": (0.001 * rng.normal(), float("nan"))},
        verdict="explained",
        assessment="with care" if number % 3 else "usable",
        is_searched=True,
        findings=tuple(findings),
        poi_error_db=0.5,
        particulars={"serial_number": f"S-{number}", "date": f"2026-{1 + number // 28:02d}-{1 + number % 28:02d}"},
    )


def simulated_records(count=40, *, seed=0):
    """Machines of which one is off, one has a fault of its own, and one has failed; all share a fault of the model."""
    rng = np.random.default_rng(seed)
    records = [simulated_machine(rng, number) for number in range(1, count)]
    failed = MachineRecord(
        machine=f"m{count}", status="failed", message=f"x.csv: {HOSTILE}", particulars={"serial_number": HOSTILE}
    )
    return [*records, failed]
