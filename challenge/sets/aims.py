"""Aims of the sealed proof by family, frozen into a set's commitments when it is made."""

ALARMS = "alarms on nulls"
TOP_1 = "top-1, medium and strong, one effect"
PRECISION = "precision, medium and strong"
UNKNOWN = "unknowns flagged"
IOU = "overlap (IoU) of regions"
SHARE = "share of the oracle's gain, each case at most 1"
ERROR = "expected calibration error of probabilities"
NEXT = "undecidable, after the scan ranked first: right name first"
COVERAGE = "95 % intervals that hold the true parameter"
CONCEALED = "concealed from the paper's checks, of these detected"
_COMMON = {
    TOP_1: ">= 0.8", PRECISION: ">= 0.9", IOU: ">= 0.5", SHARE: ">= 0.7", ERROR: "<= 0.07",
    NEXT: ">= 0.9", COVERAGE: "0.92 to 0.98", CONCEALED: "at least half concealed",
}  # fmt: skip
_UNLIKE = {ALARMS: "at most 2 of 60", **_COMMON, UNKNOWN: ">= 0.85"}
AIMS: dict[str, dict[str, str]] = {
    "first": {ALARMS: "at most 1 of 60", **_COMMON, UNKNOWN: ">= 0.8"},
    "makes": _UNLIKE, "second": _UNLIKE,
}  # fmt: skip
"""Family -> figure of the scoreboard -> aim."""
