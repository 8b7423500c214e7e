"""Height maps in Excel sheets, and the profile that a Mitutoyo SurfTest writes into its report.

The report's sheet DATA holds positions in column E and heights in F; its own figures and settings
stand in A and B and tell the units (`Ra 3.308 µm`, `CUT 2.5mm`).
"""

import re
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

from files.budget import check_archive
from files.errors import RecipeError
from sensors.formats.height_map import HeightMap
from sensors.formats.text.cells import Rows
from sensors.formats.text.tables import from_rows

MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
RELATION = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"


def read_xlsx(path: Path, unit: str | None) -> HeightMap:
    """Read the first sheet as a table, or the profile of a Mitutoyo report."""
    try:
        with zipfile.ZipFile(path) as archive:
            check_archive(archive, path)
            sheets = _sheets(archive)
            name = "DATA" if "DATA" in sheets else next(iter(sheets))
            rows = _cells(archive, sheets[name])
    except (
        zipfile.BadZipFile, zlib.error, ElementTree.ParseError, KeyError, IndexError,
        StopIteration, ValueError, OSError,
    ) as error:  # fmt: skip
        raise RecipeError(f"isn't an Excel sheet, or damaged ({error})", where=path) from None
    if name == "DATA" and rows and re.match(r"R\w+\s", rows[0][0] if rows[0] else ""):
        return _mitutoyo(rows, unit, path)
    return from_rows(rows, unit, path)


def _mitutoyo(rows: Rows, unit: str | None, path: Path) -> HeightMap:
    heights = re.search(r"[\d.]\s*([munµ]?m)\b", rows[0][0])
    cutoff = re.search(r"CUT\s*[\d.]+\s*([munµ]?m)\b", rows[0][1] if len(rows[0]) > 1 else "")
    if heights is None:
        raise RecipeError("isn't a Mitutoyo report: no Ra in its first row", where=path)
    profile = [row[4:6] for row in rows if len(row) >= 6 and row[4] and row[5]]
    along = "mm" if cutoff is None else cutoff.group(1)  # Mitutoyo's own where none is stated
    names = [f"x_{along}", f"z_{heights.group(1)}"]
    return from_rows([names, *profile], unit, path)


def _sheets(archive: zipfile.ZipFile) -> dict[str, str]:
    """Return the sheets' members of the archive by their names, in order."""
    links = {
        link.attrib["Id"]: link.attrib["Target"]
        for link in ElementTree.fromstring(archive.read("xl/_rels/workbook.xml.rels"))
    }
    book = ElementTree.fromstring(archive.read("xl/workbook.xml"))
    found = {}
    for sheet in book.iter(f"{MAIN}sheet"):
        target = links[sheet.attrib[RELATION]]
        found[sheet.attrib["name"]] = target.lstrip("/") if target[0] == "/" else f"xl/{target}"
    return found


def _cells(archive: zipfile.ZipFile, member: str) -> Rows:
    shared: list[str] = []
    if "xl/sharedStrings.xml" in archive.namelist():
        root = ElementTree.fromstring(archive.read("xl/sharedStrings.xml"))
        shared = ["".join(t.text or "" for t in si.iter(f"{MAIN}t")) for si in root]
    rows: Rows = []
    for row in ElementTree.fromstring(archive.read(member)).iter(f"{MAIN}row"):
        cells: list[str] = []
        for cell in row.iter(f"{MAIN}c"):
            place = _column(cell.attrib["r"]) if "r" in cell.attrib else len(cells)
            cells += [""] * (place + 1 - len(cells))
            cells[place] = _text(cell, shared)
        rows.append(cells if any(cells) else [])
    return rows


def _text(cell: ElementTree.Element, shared: list[str]) -> str:
    kind = cell.attrib.get("t", "n")
    if kind == "inlineStr":
        return "".join(t.text or "" for t in cell.iter(f"{MAIN}t")).strip()
    value = (cell.findtext(f"{MAIN}v") or "").strip()
    return shared[int(value)].strip() if kind == "s" and value else value


def _column(reference: str) -> int:
    number = 0
    for letter in reference.rstrip("0123456789"):
        number = 26 * number + ord(letter) - 64
    return number - 1
