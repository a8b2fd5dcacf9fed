"""Make blind cases from the command line.

``python pipelines/simulator/make_case.py --seed 7 --effect added_mass --out cases/case_7`` writes what a user hands in
to ``cases/case_7`` and the answers to ``cases/truth/case_7.json``, or to the folder that ``--truth`` names.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

if not __package__:  # run as a file
    sys.path[0] = str(Path(__file__).parents[1])

from simulator.cases.case import make_case
from simulator.cases.specimens import KINDS
from simulator.effects.catalogue import CONTRACT, OUTSIDE


def main(arguments: list[str] | None = None) -> None:
    """Read the arguments and write one case."""
    unknown = ", ".join(f"unknown:{kind}" for kind in OUTSIDE)
    parser = argparse.ArgumentParser(
        description="Make a blind case of a vibration test: recordings, a model, and sealed answers.",
        epilog=f"Effects: null, {', '.join(CONTRACT)}, unknown, {unknown}, pair, pair:A+B.",
    )
    parser.add_argument("--seed", type=int, required=True, help="the same seed gives the same case")
    parser.add_argument("--effect", default="null", help="what is concealed (default: nothing)")
    parser.add_argument("--structure", choices=KINDS, help="kind of specimen (default: drawn)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the case")
    parser.add_argument("--truth", type=Path, help="folder of the answers (default: truth, beside the case)")
    options = parser.parse_args(arguments)
    case = make_case(options.seed, options.effect, structure=options.structure)
    truth = (options.truth or options.out.parent / "truth") / f"{options.out.name}.json"
    case.write(options.out, truth)
    print(f"{options.out}: {case.world.specimen.name}, {len(case.drives)} recordings; answers in {truth}")


if __name__ == "__main__":
    main()
