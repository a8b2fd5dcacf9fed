"""A run of somebody who names everything so that it would be markup, a template or a script, were it not escaped."""

from dataclasses import replace

import pandas as pd

from synthetic_run import synthetic_folder, synthetic_law

HOSTILE = (
    """<script>window.hacked = 1</script>"'{{7*7}}</script><img src=x onerror="window.hacked = 1">&amp;"""
    r"%{x}{y}_$\frac^$"
)


def hostile(text=""):
    return f"{text}{HOSTILE}"


def hostile_folder():
    """Results of every stage with hostile names wherever a user, a file or an effect of a user's gives one."""
    folder = synthetic_folder(diagnosed=True)
    results = folder.results
    results["ingest"] = _ingest(results["ingest"])
    results["fit"] = _fit(results["fit"])
    results["pair"] = replace(
        results["pair"],
        rows=tuple(replace(row, reason=hostile(row.reason)) for row in results["pair"].rows),
        warnings=(HOSTILE,),
    )
    parts = results["update"].parts
    results["update"] = replace(
        results["update"],
        parts=parts.assign(name=[hostile(name) for name in parts["name"]]),
        warnings=(HOSTILE,),
        unmet=(HOSTILE,),
    )
    results["predict"] = replace(results["predict"], warnings=(HOSTILE,))
    results["export"] = replace(
        results["export"], input_names=tuple(hostile(name) for name in results["export"].input_names)
    )
    results["reduce"] = replace(results["reduce"], choices=(HOSTILE,))
    results["diagnose"] = _diagnosis(results["diagnose"])
    modes = results["levels"].modes
    results["levels"] = replace(
        results["levels"], modes=modes.assign(record=[hostile(name) for name in modes["record"]])
    )
    folder.manifest = {
        "frf_ipz": HOSTILE,
        "python": HOSTILE,
        "packages": {HOSTILE: HOSTILE},
        "when": HOSTILE,
        "pipeline": HOSTILE,
        "name": HOSTILE,
        "test": dict.fromkeys(("operator", "date", "equipment", "customer", "serial_number"), HOSTILE),
        "configuration": {"fit": {HOSTILE: HOSTILE}},
        "inputs": {HOSTILE: HOSTILE},
        "stages": {**folder.manifest["stages"], HOSTILE: {"key": HOSTILE, "seconds": 1.0}},
    }
    folder.stale = (HOSTILE,)
    return folder


def _ingest(estimate):
    records = estimate.records
    return replace(
        estimate,
        records=records.assign(
            record=[hostile(name) for name in records["record"]], marks=[hostile(text) for text in records["marks"]]
        ),
        traces=tuple(
            replace(trace, name=hostile(trace.name), channel=hostile(trace.channel), unit=hostile(trace.unit))
            for trace in estimate.traces
        ),
        warnings=(HOSTILE,),
        choices=(HOSTILE,),
    )


def _fit(fit):
    decisions = pd.DataFrame(
        {"frequency_hz": [10.0], "damping_ratio": [0.01], "action": ["pinned"], "reason": [HOSTILE]}
    )
    reasons = tuple(hostile(reason) for reason in fit.zeros.reason)
    return replace(fit, decisions=decisions, zeros=replace(fit.zeros, reason=reasons), warnings=(HOSTILE,))


def _diagnosis(diagnosis):
    findings = tuple(
        replace(
            finding,
            effect=hostile(finding.effect),
            statement=hostile(finding.statement),
            location=replace(finding.location, channels=(HOSTILE,), groups=(HOSTILE,)),
            parameters={**finding.parameters, HOSTILE: HOSTILE},
        )
        for finding in diagnosis.findings
    )
    law = replace(synthetic_law(), record=HOSTILE, channel=HOSTILE, response=HOSTILE, unit=HOSTILE)
    return replace(
        diagnosis,
        findings=findings,
        alternatives=findings,
        mismatch_where=HOSTILE,
        mismatch=diagnosis.mismatch.assign(frf=[hostile(name) for name in diagnosis.mismatch["frf"]]),
        data_checks=tuple(
            replace(check, name=hostile(check.name), statement=hostile(check.statement))
            for check in diagnosis.data_checks
        ),
        held_out_kind=HOSTILE,
        detectability={HOSTILE: {HOSTILE: 1.0}},
        statement=HOSTILE,
        warnings=(HOSTILE,),
        law_in_time=law,
    )
