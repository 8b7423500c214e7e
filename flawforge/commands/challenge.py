"""`flawforge challenge`: sealed cases of an independent instrument, and what a diagnosis pays."""

import argparse
from pathlib import Path

EPILOG = """\
Order of the steps: make (or calibrate), run, measure, run --measured, judge. A step that was
stopped continues where it stopped. `flawforge challenge STEP --help` describes each.

example:
  flawforge challenge make --out out/proof --jobs 2
  flawforge challenge run out/proof --jobs 2
  flawforge challenge measure out/proof
  flawforge challenge judge out/proof --write docs/proof.md
  flawforge challenge payoff --out out/payoff --write docs/payoff.md
"""
STEPS = {
    "make": (
        "draw, render and seal a set of cases",
        "Draws cases, renders their recordings with an instrument of its own, and writes\n"
        "DIR/cases/ (what a diagnosis gets), DIR/keys/ (what is hidden) and\n"
        "DIR/commitments.json (SHA-256 of each key with a nonce, and of each file).",
    ),
    "calibrate": (
        "make the open population that may set the scales of a diagnosis",
        "Makes sets of recordings whose causes are open: nulls, and sets with one effect. Only\n"
        "they may set numbers of the diagnosis. DIR/population.json lists them.",
    ),
    "run": (
        "diagnose each case in a process and a folder without its key",
        "Runs `flawforge diagnose` on each case of SET. The process sees a copy of the case's\n"
        "files and no key. Answers are in SET/answers/. Exit code 1 where a diagnosis failed or\n"
        "took too long; the case counts as answered wrong.",
    ),
    "measure": (
        "make the scan that each answer proposes first, and a random scan",
        "Adds a scan to each case that one recording cannot decide: the first of the answer's\n"
        "proposals (ranked), and for comparison a random one (random). Both are written below\n"
        "SET/measured/; `run --measured` diagnoses them. Exit code 1 where an answer proposes\n"
        "no scan.",
    ),
    "baseline": (
        "answer a set by a gradient-boosted classifier on figures of residuals",
        "Trains a classifier on the population of `calibrate` and answers each case of SET.",
    ),
    "regions": (
        "draw the true regions of an answered set again",
        "Renders each case of SET again from its key: the region where it departs, and regions\n"
        "from other draws of the speckle. Their overlap is the largest that an answer can reach.",
    ),
    "judge": (
        "open the keys, check the seals, score the answers",
        "Checks each key and file against commitments.json, scores the answers and prints the\n"
        "scoreboard. A test set is judged in aggregate only; its run is entered with --record\n"
        "and --reason.",
    ),
    "payoff": (
        "train a flaw segmenter on nominal and on diagnosed simulation, test both on sealed scans",
        "Compares a flaw segmenter trained on the nominal simulation with one trained on the\n"
        "simulation that a diagnosis corrected, in several worlds, on sealed scans.",
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's steps and options to a parser."""
    parser.epilog = EPILOG
    steps = parser.add_subparsers(dest="step", metavar="STEP", required=True)
    at = {
        name: steps.add_parser(
            name, help=words, description=f"{words[0].upper()}{words[1:]}.\n\n{more}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        for name, (words, more) in STEPS.items()
    }  # fmt: skip
    for name in ("make", "calibrate", "payoff"):
        at[name].add_argument("--out", type=Path, required=True, metavar="DIR", help="folder")
    for name in ("run", "measure", "baseline", "regions"):
        at[name].add_argument("set", type=Path, metavar="SET", help="folder of a set")
    for name in ("make", "calibrate", "run", "regions", "payoff"):
        at[name].add_argument("--jobs", type=int, default=1, metavar="N",
                              help="processes (default 1)")  # fmt: skip
    for name in ("make", "payoff"):
        at[name].add_argument("--seed", type=int, metavar="N",
                              help="master seed (default: from the operating system)")  # fmt: skip
    _add_sets(at["make"], at["calibrate"])
    _add_answers(at["run"], at["baseline"])
    _add_judge(at["judge"])
    payoff = at["payoff"]
    payoff.add_argument("--small", action="store_true", help="few specimens: a try, no result")
    for name, words in (
        ("training", "specimens to train on in each world (default 16)"),
        ("test", "sealed specimens of each world (default 10)"),
        ("seeds", "segmenters trained on each set, each on half of its specimens (default 4)"),
    ):
        payoff.add_argument(f"--{name}", type=int, metavar="N", help=words)
    payoff.add_argument(
        "--family", default="first", metavar="NAME",
        help="family of instruments: first or second (default first)",
    )  # fmt: skip
    payoff.add_argument(
        "--world", action="append", metavar="NAME", help="a world; may be repeated (default: all)"
    )
    payoff.add_argument("--write", type=Path, metavar="FILE.md", help="page to write")


def _add_sets(make: argparse.ArgumentParser, calibrate: argparse.ArgumentParser) -> None:
    make.add_argument(
        "--cases", type=int, metavar="N", help="number of cases, all kinds in proportion "
        "(default 160)",
    )  # fmt: skip
    make.add_argument(
        "--family", default="first", metavar="NAME",
        help="family of instruments: first or second, or makes: other makes of the first's "
        "(default first)",
    )  # fmt: skip
    make.add_argument(
        "--population", metavar="NAME",
        help="calibration, validation or test (default: validation for the first family, test "
        "for the second)",
    )  # fmt: skip
    make.add_argument(
        "--meshes", type=Path, metavar="DIR",
        help="closed CAD meshes (STL, PLY, OBJ) among the second family's parts",
    )  # fmt: skip
    calibrate.add_argument(
        "--nulls", type=int, default=30, metavar="N", help="sets without an effect (default 30)"
    )
    calibrate.add_argument(
        "--each", type=int, default=1, metavar="N",
        help="sets with each effect alone (default 1; 0: nulls only)",
    )  # fmt: skip
    calibrate.add_argument(
        "--makes", action="store_true",
        help="of instruments of other makes: other lines, lenses, finders, nominal files",
    )  # fmt: skip


def _add_answers(run_step: argparse.ArgumentParser, simple: argparse.ArgumentParser) -> None:
    run_step.add_argument(
        "--timeout", type=float, default=600.0, metavar="S", help="seconds per case (default 600)"
    )
    run_step.add_argument(
        "--shuffled", type=int, default=0, metavar="N",
        help="instead, diagnose the first N cases with shuffled covariates: a baseline",
    )  # fmt: skip
    run_step.add_argument(
        "--measured", metavar="WAY",
        help="instead, diagnose the cases with a further scan of `measure`: ranked or random",
    )  # fmt: skip
    simple.add_argument(
        "--train", type=Path, required=True, metavar="DIR", help="population of `calibrate`"
    )


def _add_judge(judge: argparse.ArgumentParser) -> None:
    judge.add_argument(
        "set", type=Path, nargs="+", metavar="SET",
        help="folder of a set; for a page, one of each family",
    )  # fmt: skip
    judge.add_argument(
        "--partial", action="store_true", help="score only the cases that have an answer"
    )
    judge.add_argument(
        "--aggregate", action="store_true", help="print and keep only the scoreboard, no case"
    )
    judge.add_argument(
        "--record", type=Path, metavar="FILE.md", help="record that a test set's run is entered in"
    )
    judge.add_argument(
        "--reason", default="", metavar="TEXT", help="with --record: why the test was run"
    )
    judge.add_argument("--write", type=Path, metavar="FILE.md", help="page to write, with pictures")


def run(arguments: argparse.Namespace) -> int:
    """Run one step; return the exit code."""
    from files.errors import RecipeError

    try:
        return _step(arguments)
    except (ValueError, FileNotFoundError) as error:
        raise RecipeError(str(error)) from error


def _step(arguments: argparse.Namespace) -> int:
    if arguments.step == "make":
        from challenge.sets.make import make

        return make(
            arguments.out, seed=arguments.seed, cases=arguments.cases, jobs=arguments.jobs,
            population=arguments.population, family=arguments.family, meshes=arguments.meshes,
        )  # fmt: skip
    if arguments.step == "calibrate":
        from challenge.sets.calibration_population import calibrate

        return calibrate(arguments.out, nulls=arguments.nulls, each=arguments.each,
                         jobs=arguments.jobs, makes=arguments.makes)  # fmt: skip
    if arguments.step == "run":
        from challenge.runs.run import run as diagnose_all

        return diagnose_all(
            arguments.set,
            jobs=arguments.jobs,
            timeout_s=arguments.timeout,
            shuffled=arguments.shuffled,
            measured=arguments.measured,
        )
    if arguments.step == "baseline":
        from challenge.baseline.boosted import baseline

        return baseline(arguments.set, arguments.train)
    if arguments.step == "measure":
        from challenge.runs.measure import measure

        return measure(arguments.set)
    if arguments.step == "regions":
        from challenge.judging.regions import draw_again

        return draw_again(arguments.set, jobs=arguments.jobs)
    if arguments.step == "payoff":
        return _payoff(arguments)
    return _judge(arguments)


def _judge(arguments: argparse.Namespace) -> int:
    from challenge.judging.judge import judge, population_of
    from challenge.proof.page import Judged, write_page
    from challenge.proof.record_of_tests import enter
    from challenge.proof.scoreboard import curve, figures, table
    from challenge.runs.run import diagnosed_at
    from challenge.sets.populations import needs_aggregate

    tests = [folder for folder in arguments.set if needs_aggregate(population_of(folder))]
    if tests and arguments.write is not None and arguments.record is None:
        raise ValueError(f"--write: {tests[0]} is a test set: --record and --reason enter its run")
    judged, versions = [], {folder: diagnosed_at(folder) for folder in arguments.set}
    for folder in arguments.set:
        whole = arguments.aggregate or (folder in tests and arguments.write is not None)
        scored = judge(folder, partial=arguments.partial, aggregate=whole)
        judged.append(Judged.of(scored, folder))
        board = [*table({judged[-1].label: figures(scored)}), "", *curve(scored)]
        for line in board:
            print(line)
        if arguments.record is not None and (folder in tests or len(arguments.set) == 1):
            version = versions[folder]
            enter(arguments.record, reason=arguments.reason, commit=version, lines=board)
    if arguments.write is not None:
        write_page(judged, arguments.write, commit=", ".join(dict.fromkeys(versions.values())))
    return 0


def _payoff(arguments: argparse.Namespace) -> int:
    from challenge.payoff.page import conclusions, headline, write_page
    from challenge.payoff.payoff import payoff
    from challenge.payoff.trial import Effort

    sizes = ("training", "test", "seeds")
    found = payoff(
        arguments.out, seed=arguments.seed, jobs=arguments.jobs, small=arguments.small,
        worlds=arguments.world, family=arguments.family,
        effort=Effort(**{k: v for k in sizes if (v := getattr(arguments, k)) is not None}),
    )  # fmt: skip
    for line in (*headline(found), *conclusions(found)):
        print(line)
    if arguments.write is not None:
        write_page(found, arguments.out, arguments.write)
    return 0
