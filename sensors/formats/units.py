"""Units of length and time as instruments' files spell them."""

import re

UNITS_MM = {"m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "µm": 1e-3, "nm": 1e-6, "in": 25.4}
"""Units that a user may name, in mm."""

LENGTHS_MM = {
    **UNITS_MM,
    "μm": 1e-3, "micron": 1e-3, "microns": 1e-3, "micrometer": 1e-3, "micrometers": 1e-3,
    "micrometre": 1e-3, "micrometres": 1e-3, "mikrometer": 1e-3, "millimeter": 1.0,
    "millimeters": 1.0, "millimetre": 1.0, "millimetres": 1.0, "centimeter": 10.0,
    "centimeters": 10.0, "meter": 1e3, "meters": 1e3, "metre": 1e3, "metres": 1e3,
    "nanometer": 1e-6, "nanometers": 1e-6, "nanometre": 1e-6, "inch": 25.4, "inches": 25.4,
    '"': 25.4, "å": 1e-7, "angstrom": 1e-7, "a": 1e-7, "pm": 1e-9, "mil": 0.0254, "thou": 0.0254,
}  # fmt: skip
"""Units that a header may name."""

TIMES_S = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

_WORD = r"[A-Za-zµμÅå\"]+"
_ENDING = re.compile(rf"(?:[_\s\[({{/,]|^)({_WORD})[\])}}]*\s*$")
_BRACKET = re.compile(rf"[\[(]\s*({_WORD})\s*[\])]")
_IN = re.compile(rf"\bin\s+({_WORD})\b")
_SINGLE = {"m", "a", "s", "in"}
"""Words that are units only where a bracket, a slash, an underscore or "in" marks them so."""


def length_in(name: str) -> str | None:
    """Return the unit of length that a column's name or a header's value ends in, or None.

    Understood are `z_um`, `x (mm)`, `X_(microns)`, `y in µm`, `Lateral um`, `Width [nm]`, `1.2 µm`.
    """
    word = _marked(name)
    return word if word is not None and word in LENGTHS_MM else None


def time_in(name: str) -> float | None:
    """Return seconds in the unit of time that a column's name ends in (`timestamp_us`), or None."""
    word = _marked(name)
    return None if word is None else TIMES_S.get(word)


def _marked(name: str) -> str | None:
    text = name.strip()
    for pattern in (_BRACKET, _IN):
        found = pattern.findall(text)
        if found:
            return str(found[-1]).lower()
    ending = _ENDING.search(text)
    if ending is None:
        return None
    word = ending.group(1).lower()
    before = text[: ending.start(1)]
    bare = not before or before[-1].isspace()
    # "Distance m" and "12 m" end in a unit; a lone "a" or a column called "s" doesn't.
    if word in _SINGLE and bare and not before.strip():
        return None
    return word
