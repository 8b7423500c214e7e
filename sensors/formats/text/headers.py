"""Words before the numbers of a table: lateral sizes, pitches and units that it states."""

import re
from dataclasses import dataclass

from sensors.formats.height_map import scale_mm
from sensors.formats.units import LENGTHS_MM, length_in

_PAIR = re.compile(r"^[#%\s\"]*([^:=,;\t]+?)\s*[:=,;\t]\s*(.+?)\s*[\",;\t]*$")
_NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?")
# Gwyddion writes its header in the user's language.
_WIDTH = ("width", "breite", "largeur", "ancho", "larghezza", "šířka", "ширина")
_HEIGHT = ("height", "höhe", "hauteur", "alto", "altezza", "výška", "высота")
_UNITS = re.compile(
    r"(?i)^(?:(?:value|z|height|data|heights?|depth)[\s_-]*)?(?:units?|einheit(?:en)?)$"
    r"|^(?:werte?[\s-]?einheiten|unités de valeurs?|jednotky hodnot|единицы значений)$"
)
_PITCH = r"(?:pitch|resolution|spacing|step|interval|increment|sampling|pixel[\s_-]*size|scale)"
_AXES = {
    "x": re.compile(rf"(?i)^(?:x[\s_-]*{_PITCH}|{_PITCH}[\s_-]*x|d[\s_-]?x|delta[\s_-]?x)\b"),
    "y": re.compile(rf"(?i)^(?:y[\s_-]*{_PITCH}|{_PITCH}[\s_-]*y|d[\s_-]?y|delta[\s_-]?y)\b"),
}

_BOTH = re.compile(r"(?i)^(?:pixel[\s_-]*(?:size|pitch)|pixel[\s_-]*spacing|lateral[\s_-]*pitch)$")
_FACTOR = re.compile(r"(?i)^(?:height|z|data)[\s_-]*(?:conversion)?[\s_-]*(?:factor|scale)\b")


@dataclass(frozen=True, kw_only=True, slots=True)
class Header:
    """What a header states; None where it doesn't.

    Attributes
    ----------
    width_mm, height_mm
        Lateral size of the whole field, along x and along y.
    pitch_x_mm, pitch_y_mm
        Distance of the columns and of the rows.
    unit
        Unit of the heights.
    factor_mm
        mm in one of the table's numbers ("height conversion factor (-> m)").
    column_units
        Units of the columns, where a line holds nothing but units.
    """

    width_mm: float | None = None
    height_mm: float | None = None
    pitch_x_mm: float | None = None
    pitch_y_mm: float | None = None
    unit: str | None = None
    factor_mm: float | None = None
    column_units: tuple[str, ...] = ()


def read_header(lines: list[str]) -> Header:
    """Read the lines before a table's numbers."""
    found: dict[str, float] = {}
    unit: str | None = None
    columns: tuple[str, ...] = ()
    for line in lines:
        tokens = re.findall(r"[^\s,;|\[\]()\"]+", line.strip("#% \r\n"))
        if tokens and all(token.lower() in LENGTHS_MM for token in tokens):
            columns = tuple(token.lower() for token in tokens)
            continue
        pair = _PAIR.match(line.strip())
        if pair is None:
            continue
        key, value = pair.group(1).strip(" #%\""), pair.group(2).strip(" \"")
        if _UNITS.match(key) and value.lower().strip("[]() ") in LENGTHS_MM:
            unit = value.lower().strip("[]() ")
            continue
        length = _length_mm(key, value)
        if _FACTOR.match(key) and length is not None:
            found["factor_mm"] = length
            continue
        if length is None:
            continue
        if key.lower() in _WIDTH:
            found["width_mm"] = length
        elif key.lower() in _HEIGHT:
            found["height_mm"] = length
        if _BOTH.match(key):
            found["pitch_x_mm"] = found["pitch_y_mm"] = length
        for axis, pattern in _AXES.items():
            if pattern.match(key):
                found[f"pitch_{axis}_mm"] = length
    return Header(unit=unit, column_units=columns, **found)


def _length_mm(key: str, value: str) -> float | None:
    """Return a length above zero in mm; its unit stands behind the number or in the key."""
    number = _NUMBER.match(value)
    if number is None:
        return None
    rest = value[number.end() :].strip(" []()")
    arrow = re.search(r"->\s*([A-Za-zµμ]+)\s*\)", key)
    named = arrow.group(1) if arrow is not None else length_in(key)
    unit = rest.lower() if rest.lower() in LENGTHS_MM else named
    if unit is None and rest:
        return None
    length = float(number.group(0).replace(",", ".")) * scale_mm(unit)
    return length if length > 0 and (unit is not None or not rest) else None
