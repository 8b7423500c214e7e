"""`flawforge pod`: probability of detection against the size of a flaw."""

import argparse
from pathlib import Path

EPILOG = """\
Fits curves after MIL-HDBK-1823A: hit/miss (logit or probit of ln size) and, for a detector with
responses, signal response. a50, a90 and a90/95 follow from the likelihood ratio. The table of
--predictions is Parquet with `scan_id`, `instance` (as in flaws.parquet) and `detected` or
`response`; a flaw without a row counts as missed. Without --predictions the command evaluates the
matched filter (`response` in flaws.parquet): an upper bound, since the filter knows place and
shape of each flaw. Writes the page, and a .json and a .png beside it.

examples:
  flawforge pod out/quickstart --out pod.html
  flawforge pod out/brackets --predictions unet.parquet --split test --size length_mm --out pod.html
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("dataset", metavar="DIR", help="folder of the dataset, or s3://bucket/prefix")
    parser.add_argument(
        "--predictions", type=Path, metavar="FILE", help="table of a detector's answers"
    )
    parser.add_argument(
        "--size", default="depth_mm", metavar="COLUMN",
        help="size of a flaw, a column of flaws.parquet (default depth_mm)",
    )  # fmt: skip
    parser.add_argument(
        "--threshold", type=float, metavar="X",
        help="response at which a flaw counts as found (default: the recipe's detectable_at)",
    )  # fmt: skip
    parser.add_argument("--split", metavar="NAME", help="only scans of this split")
    parser.add_argument(
        "--link", choices=("logit", "probit"), default="logit", help="link function (default logit)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("pod.html"), metavar="HTML", help="default: pod.html"
    )


def run(arguments: argparse.Namespace) -> int:
    """Fit, write the page, and print the estimates."""
    from files.errors import RecipeError
    from files.place import place
    from pipeline.pod.page import write_page
    from pipeline.pod.study import make_study

    if arguments.out.suffix.lower() != ".html":
        raise RecipeError(
            "not an HTML file name", where="--out", value=str(arguments.out), allowed="NAME.html"
        )
    study = make_study(
        place(arguments.dataset),
        predictions=arguments.predictions,
        size=arguments.size,
        threshold=arguments.threshold,
        split=arguments.split,
        link=arguments.link,
    )
    for group in write_page(study, arguments.out)["groups"]:
        for method, found in group["methods"].items():
            head = f"{group['kind']:12} {group['found']:5} of {group['looks']:5}  {method:16}"
            if "not_estimable" in found:
                print(f"{head} not estimable: {found['not_estimable']}")
                continue
            bound = found["a90_95"]
            print(
                f"{head} a50 {found['a50']:.3g}, a90 {found['a90']:.3g}, a90/95 "
                + ("none" if bound is None else f"{bound:.3g}")
            )
    print(arguments.out)
    return 0
