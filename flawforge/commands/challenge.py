"""`flawforge challenge`: sealed cases of an independent instrument, and what a diagnosis pays."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's steps and options to a parser."""
    parser.epilog = (
        "example:\n"
        "  flawforge challenge make --out out/proof --jobs 2\n"
        "  flawforge challenge run out/proof --jobs 2\n"
        "  flawforge challenge measure out/proof\n"
        "  flawforge challenge judge out/proof --write docs/proof.md\n"
        "  flawforge challenge payoff --out out/payoff --write docs/payoff.md"
    )
    steps = parser.add_subparsers(dest="step", metavar="STEP", required=True)
    make = steps.add_parser("make", help="draw, render and seal a set of cases")
    make.add_argument("--out", type=Path, required=True, help="folder of the set")
    make.add_argument(
        "--seed", type=int, help="master seed (default: the operating system's entropy)"
    )
    make.add_argument(
        "--cases", type=int, metavar="N", help="how many, in the same proportions (default 160)"
    )
    make.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    make.add_argument(
        "--population", metavar="NAME",
        help="calibration, validation or test, which is judged in aggregate only (default: "
        "validation for the first family, test for the second)",
    )  # fmt: skip
    make.add_argument(
        "--family", default="first", metavar="NAME", help="of instruments: first or second"
    )
    make.add_argument(
        "--meshes", type=Path, metavar="DIR",
        help="closed CAD meshes (STL, PLY, OBJ) among the second family's parts",
    )  # fmt: skip
    calibrate = steps.add_parser(
        "calibrate", help="make the opened population that may set a diagnosis's scales"
    )
    calibrate.add_argument(
        "--out", type=Path, required=True, help="folder; a run that was stopped goes on there"
    )
    calibrate.add_argument(
        "--nulls", type=int, default=30, help="sets of the good instrument (default 30)"
    )
    calibrate.add_argument(
        "--each", type=int, default=1, metavar="N",
        help="sets with one effect, of each effect (default 1; 0: the good instrument alone)",
    )  # fmt: skip
    calibrate.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    run_step = steps.add_parser(
        "run", help="diagnose each case in a process and folder without its key"
    )
    run_step.add_argument("set", type=Path, help="folder of the set")
    run_step.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    run_step.add_argument(
        "--timeout", type=float, default=600.0, help="seconds for a case (default 600)"
    )
    run_step.add_argument(
        "--shuffled", type=int, default=0, metavar="N",
        help="instead, diagnose the first N cases with shuffled covariates: a baseline",
    )  # fmt: skip
    run_step.add_argument(
        "--measured", metavar="WAY",
        help="instead, diagnose the cases with a further scan of `measure`: ranked or random",
    )  # fmt: skip
    further = steps.add_parser(
        "measure",
        help="make the scan that each answer proposes first, and a random one, for cases that one "
        "recording can't decide",
    )
    further.add_argument("set", type=Path, help="folder of an answered set")
    simple = steps.add_parser(
        "baseline", help="answer a set by a gradient-boosted classifier on figures of residuals"
    )
    simple.add_argument("set", type=Path, help="folder of the set")
    simple.add_argument(
        "--train", type=Path, required=True, metavar="DIR", help="population made by `calibrate`"
    )
    regions = steps.add_parser(
        "regions", help="draw the true regions of an answered set again, and from other draws"
    )
    regions.add_argument("set", type=Path, help="folder of the set")
    regions.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    judge = steps.add_parser("judge", help="open the keys, check the seals, score the answers")
    judge.add_argument(
        "set", type=Path, nargs="+", help="folder of the set; for a page, one of each family"
    )
    judge.add_argument(
        "--partial", action="store_true",
        help="score the cases answered so far, where the run was stopped by the clock",
    )  # fmt: skip
    judge.add_argument(
        "--aggregate", action="store_true", help="print and keep no case, only the scoreboard"
    )
    judge.add_argument(
        "--record", type=Path, metavar="FILE.md", help="enter a test set's run there"
    )
    judge.add_argument("--reason", default="", help="with --record: why the test was run")
    judge.add_argument("--write", type=Path, metavar="FILE.md", help="write the page with pictures")
    payoff = steps.add_parser(
        "payoff", help="train a flaw segmenter on plain and diagnosed simulation, test it sealed"
    )
    payoff.add_argument(
        "--out", type=Path, required=True, help="folder; a run that was stopped goes on there"
    )
    payoff.add_argument(
        "--seed", type=int, help="master seed (default: the operating system's entropy)"
    )
    payoff.add_argument("--small", action="store_true", help="few specimens: a try, no result")
    payoff.add_argument(
        "--world", action="append", metavar="NAME", help="which, several times (default: all)"
    )
    payoff.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    payoff.add_argument("--write", type=Path, metavar="FILE.md", help="write the page")


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
                         jobs=arguments.jobs)  # fmt: skip
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
    from challenge.proof.record_of_tests import commit, enter
    from challenge.proof.scoreboard import figures, table
    from challenge.sets.populations import needs_aggregate

    tests = [folder for folder in arguments.set if needs_aggregate(population_of(folder))]
    if tests and arguments.write is not None and arguments.record is None:
        raise ValueError(f"--write: {tests[0]} is a test set: --record and --reason enter its run")
    version, judged = commit(Path(__file__).parents[1]), []
    for folder in arguments.set:
        whole = arguments.aggregate or (folder in tests and arguments.write is not None)
        scored = judge(folder, partial=arguments.partial, aggregate=whole)
        judged.append(Judged.of(scored, folder))
        board = table({judged[-1].label: figures(scored)})
        for line in board:
            print(line)
        if arguments.record is not None and (folder in tests or len(arguments.set) == 1):
            enter(arguments.record, reason=arguments.reason, commit=version, lines=board)
    if arguments.write is not None:
        write_page(judged, arguments.write, commit=version)
    return 0


def _payoff(arguments: argparse.Namespace) -> int:
    from challenge.payoff.page import conclusion, headline, write_page
    from challenge.payoff.payoff import payoff

    found = payoff(
        arguments.out, seed=arguments.seed, jobs=arguments.jobs, small=arguments.small,
        worlds=arguments.world,
    )  # fmt: skip
    for line in (*headline(found), conclusion(found)):
        print(line)
    if arguments.write is not None:
        write_page(found, arguments.out, arguments.write)
    return 0
