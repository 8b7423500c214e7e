"""Make, diagnose and judge cases of other formulas.

    python -m benchmarks.other_formulas make --seed 0 --out out/cases [--first 40]
    python -m benchmarks.other_formulas run --seed 100 --out out/diagnose-bench [--first 80]
    python -m benchmarks.other_formulas judge --out out/diagnose-bench --write PAGE.md

`run` keeps its answers by commit and seed, `judge` shows all of them, cases of calibration only.
`make` writes opened cases and needs a calibration seed (0 to 99).
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.other_formulas.cases import PLANS, Case, save_truth, stage, write
from benchmarks.other_formulas.judge import figures, load
from benchmarks.other_formulas.page import cases_of, population_of, write_page
from benchmarks.other_formulas.run import run
from challenge.commit import commit


def make(out: Path, cases: Sequence[Case]) -> None:
    """Write cases with their truth into folders."""
    for case in cases:
        folder = out / case.name
        if (folder / "truth.json").exists():
            continue
        try:
            staged = stage(case)
        except ValueError as error:
            print(f"{case.name}: left out: {error}", flush=True)
            continue
        save_truth(write(staged, folder), folder / "truth.json")


def main() -> None:
    """Run one step."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("step", choices=("make", "run", "judge"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, help="so many cases only: all kinds in proportion")
    parser.add_argument(
        "--plan", choices=PLANS, default="mixed",
        help="laws: the catalogue's own, for intervals; habits: baselines have them, too",
    )  # fmt: skip
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after these")
    parser.add_argument("--write", type=Path, metavar="FILE.md")
    args = parser.parse_args()
    try:
        population = population_of(args.seed)
    except ValueError as error:
        parser.error(f"--seed: {error}")
    if args.step == "make":
        if population != "calibration":
            parser.error(f"--seed {args.seed}: only calibration cases may be opened (0 to 99)")
        make(args.out, PLANS[args.plan](args.seed)[: args.first])
    elif args.step == "run":
        run(args.out / commit() / f"seed-{args.seed}", args.seed, args.first, args.minutes,
            args.plan)
    else:
        for folder in sorted(args.out.glob("*/seed-*")):
            answers = load(folder)
            print(folder.relative_to(args.out))
            print("\n".join(f"  {a}: {b}; aim {c}" for a, b, c in figures(answers)))
            if population_of(int(folder.name.split("-")[1])) == "calibration":
                print("\n".join(f"  {line}" for line in cases_of(answers)))
        if args.write is not None:
            write_page(args.out, args.write)


if __name__ == "__main__":
    main()
