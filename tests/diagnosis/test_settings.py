"""Numbers stand in one place, with their meaning; most rooms know no effect by name."""

import ast
import json
import re
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

import diagnosis
from diagnosis.settings import SETTINGS
from quantity import quantities
from sensors.effects import CATALOGUE

ROOT = Path(diagnosis.__file__).parent
NAMELESS = sorted({init.parent.name for init in ROOT.glob("*/__init__.py")}
                  - {"claims", "physics", "predict"})  # fmt: skip
"""Rooms that name no effect; CONTRIBUTING.md says what the others name."""
ROOMS = sorted({init.parent.name for init in ROOT.glob("*/__init__.py")})
FORM = {
    "order of columns of a placement": [
        "claims/mounting:UNIT", "components/component:TRAVEL", "localise/maps:RIGID",
    ],
    "names of units": ["register/part_unit:UNITS"],
    "geometry or definition: no choice": [
        "claims/filtered_noise:OCTAVES", "claims/filtered_noise:USED", "claims/lay:SHARES_BEFORE",
        "claims/noise_spectrum:WAVELENGTHS",
        "claims/noise_spectrum:WIDTHS",
        "data/brightness:SIDE", "model/log_density:ROOT_2PI", "physics/column_offsets:COMB",
        "physics/curvature:TURN", "validate/heldout:ENDS",
    ],
    "neighbours of a whitened reading, by reach and cost": ["noise/whitening:NEIGHBOURS"],
    "rounding": [
        "claims/mounting:TINY", "components/law_forms:ROUNDED", "evidence/gram:ROUNDED",
        "evidence/posterior:ROUNDING",
    ],
    "a bound that keeps a division finite": [
        "claims/filtered_noise:LEAKING",
        "evidence/glm:LEAST_SHARE", "register/pose_derivative:EDGE_ON",
    ],
    "a cell's floor of a sum": ["evidence/glm:SPARSE", "model/log_density:STRAY"],
    "when an iteration ends": [
        "data/albedo:ROUNDS", "data/albedo:TURNS", "discrepancy/learning:TURNS",
        "evidence/glm:LEAST_STEP", "evidence/glm:SETTLED", "evidence/glm:STEPS",
        "physics/column_offsets:SEARCHED", "physics/linear_fit:ROUNDS",
        "physics/uncertainty:ROUNDS", "physics/uncertainty:WORTH",
        "register/registration:FIRST_ROUNDS", "register/registration:LEAST_ROUNDS",
        "register/registration:MOVE_LIMIT", "register/registration:ROUNDS",
        "register/registration:SETTLED",
    ],
    "where a search begins, and its steps": [
        "claims/drawn_filters:MEANS", "claims/drawn_filters:MEDIANS", "discrepancy/learning:ALIKE",
        "discrepancy/learning:ANEW", "discrepancy/learning:APART", "discrepancy/learning:NONE",
        "discrepancy/learning:SPREADS", "discrepancy/learning:SPREADS_OF_RATES",
        "physics/curvature:FARTHER", "physics/curvature:FIRST_STEP", "physics/curvature:SHARES",
        "physics/effect_fit:FINER", "physics/effect_fit:MAX_GRID", "physics/effect_fit:PEAKS",
        "physics/effect_fit:RADII_MM", "physics/effect_fit:SMALL", "physics/effect_fit:STRONGER",
        "register/registration:FIRST_SD", "register/registration:NARROWER",
        "register/silhouettes:REACHES",
    ],
    "time or memory: how much is looked at, or kept": [
        "claims/drawn_filters:DRAWN_POINTS", "claims/drawn_filters:DRAWN_READINGS",
        "claims/noise_spectrum:GRID",
        "components/law_forms:EVERY", "components/row_periods:BINS",
        "data/albedo:MOST_CELLS", "data/albedo:MOST_READINGS",
        "data/brightness:CHUNK", "data/inputs:CHECKED_PROFILES", "data/patch:FEWEST_ROWS",
        "data/patch:STRIPS", "data/patch:STRIP_ROWS", "data/patch:WHOLE", "evidence/gram:AT_ONCE",
        "localise/maps:CHUNK", "localise/maps:LEVELLED_BY", "noise/noise_model:LAG_PART",
        "noise/noise_model:MAX_LAG", "physics/linear_fit:PLACED_BY", "predict/prediction:KEPT_LAWS",
        "predict/prediction:KEPT_TRIALS", "register/sample:READINGS",
    ],
    "windows of a sum": [
        "data/albedo:BLUR", "data/albedo:CELLS", "data/albedo:FINE", "data/albedo:STRAIGHT",
        "data/albedo:WINDOW", "data/brightness:BIN_DEG", "data/brightness:NARROW",
        "data/brightness:WIDE", "data/brightness:WINDOWS", "evidence/gram:NEAR",
        "evidence/noise_and_loss_channels:BLOCK", "evidence/noise_and_loss_channels:SURROUNDINGS",
        "localise/regions:NEIGHBOURS",
    ],
    "constants of a published estimator": [
        "noise/noise_model:M_BEND", "noise/noise_model:M_SETTLED", "noise/noise_model:M_SHARE",
        "noise/noise_model:M_STEPS", "noise/noise_model:M_VALUES",
        "report/covariate_picture:HALF_NORMAL_MEDIAN",
        "report/covariate_picture:HALF_NORMAL_MEDIAN_ERROR",
    ],
    "the report's form": [
        "localise/regions:MOST_REGIONS", "physics/uncertainty:LEVEL",
        "report/canvas:FEWEST", "report/covariate_picture:FEWEST", "report/page:REGIONS_SHOWN",
        "report/scan_pictures:DRAWN",
    ],
}  # fmt: skip
"""Why a number may stand outside of the settings, and which do."""
EXEMPT = {tuple(entry.split(":")) for entries in FORM.values() for entry in entries}


def numbers_of(file: Path) -> set[str]:
    """Names that a file gives to numbers; how much a cache keeps is left out."""
    found = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        if "ViewCache" in ast.unparse(node.value):
            continue
        values = [c.value for c in ast.walk(node.value) if isinstance(c, ast.Constant)]
        if any(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {t.id for x in targets for t in ast.walk(x) if isinstance(t, ast.Name)}
    return found


@pytest.mark.parametrize("room", ROOMS)
def test_a_number_outside_the_settings_has_a_reason(room: str) -> None:
    there = {
        (f"{room}/{file.stem}", name)
        for file in (ROOT / room).glob("*.py") for name in numbers_of(file)
    }  # fmt: skip
    exempt = {entry for entry in EXEMPT if entry[0].startswith(f"{room}/")}
    assert there - exempt == set(), "belongs to settings.py"
    assert exempt - there == set(), "is there no more"


ARITHMETIC = {0, 0.5, 1, 2, 3, 4, 1000}
"""Numbers that a comparison may have without a name: signs, middles, small counts, mm to µm."""


def nameless_thresholds(file: Path) -> list[str]:
    """Comparisons with a number that has no name; those of indices and of rounding are left out."""
    found = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Compare):
            continue
        places = {id(n) for s in ast.walk(node) if isinstance(s, ast.Subscript)
                  for n in ast.walk(s.slice)}  # fmt: skip
        numbers = {
            n.value for n in ast.walk(node)
            if isinstance(n, ast.Constant) and isinstance(n.value, int | float)
            and id(n) not in places and n.value > 1e-6
        }  # fmt: skip
        found += [ast.unparse(node)] if numbers - ARITHMETIC else []
    return found


COMPARING = sorted(f for f in ROOT.rglob("*.py") if f.parent.name != "report")
"""The report's own comparisons are about its form."""


@pytest.mark.parametrize("file", COMPARING, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_nothing_is_compared_with_a_nameless_number(file: Path) -> None:
    assert nameless_thresholds(file) == []


@pytest.mark.parametrize("file", sorted(ROOT.glob("*.py")), ids=lambda p: p.stem)
def test_stages_have_no_numbers(file: Path) -> None:
    assert numbers_of(file) == set()


FILES = sorted(file for room in NAMELESS for file in (ROOT / room).glob("*.py"))


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.name)
def test_a_room_knows_no_effect_by_name(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    for name, kind in CATALOGUE.items():
        assert not re.search(rf"['\"]{name}['\"]|\b{kind.__name__}\b", text), name


ROOMS_OF_SETTINGS = {
    f.name: record for f in fields(SETTINGS) if is_dataclass(record := getattr(SETTINGS, f.name))
}  # fmt: skip
RECORDS = {"": SETTINGS, **ROOMS_OF_SETTINGS}
"""The numbers of the evidence, and those of each room."""


def test_numbers_stand_under_the_room_that_they_are_of() -> None:
    assert set(ROOMS_OF_SETTINGS) <= set(ROOMS)


@pytest.mark.parametrize("room", RECORDS)
def test_every_setting_says_what_it_is_and_where_it_comes_from(room: str) -> None:
    known = {q.name: q for q in quantities(type(RECORDS[room]))}
    assert set(known) == {f.name for f in fields(RECORDS[room])} - set(ROOMS_OF_SETTINGS)
    for name, q in known.items():
        assert q.meaning, name
        assert q.source, name
        q.check(getattr(RECORDS[room], name))


@pytest.mark.parametrize("room", RECORDS)
def test_every_setting_is_used(room: str) -> None:
    """By its whole name, or in a method beside it."""
    own = ROOT / "settings.py"
    others = "".join(f.read_text(encoding="utf-8") for f in ROOT.rglob("*.py") if f != own)
    for q in quantities(type(RECORDS[room])):
        name = ".".join(filter(None, ("SETTINGS", room, q.name)))
        beside = re.search(rf"self\.{q.name}\b", own.read_text(encoding="utf-8"))
        assert beside or re.search(rf"\b{re.escape(name)}\b", others), name


def test_settings_are_written_whole_and_with_their_sources() -> None:
    written = json.loads(json.dumps(SETTINGS.as_json()))
    sources = written.pop("provenance")
    assert set(written) == {f.name for f in fields(SETTINGS)}
    for room, record in RECORDS.items():
        values, known = (w[room] if room else w for w in (written, sources))
        assert set(values) == set(known) == {f.name for f in fields(record)}
        for q in quantities(type(record)):
            assert known[q.name] == {"meaning": q.meaning, "unit": q.unit, "source": q.source}
