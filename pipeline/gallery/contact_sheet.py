"""A contact sheet: scans of a dataset side by side in one picture."""

from pathlib import Path
from typing import Final

from files.whole_file import whole
from pipeline.dataset.export.image import Coding
from pipeline.dataset.export.source import Source
from pipeline.gallery.thumbnail import thumbnail

MOST: Final = 120  # scans in a sheet; of more, evenly chosen ones
TILE_PX, GAP_PX, TEXT_PX = 240, 8, 30


def contact_sheet(folder: Path, picture: Path) -> tuple[Path, int]:
    """Draw a dataset's scans with their names, splits and kinds; return picture and number."""
    from PIL import Image, ImageDraw

    source = Source.read(folder)
    step = -(-len(source.manifest) // MOST)
    rows = source.manifest.iloc[::step].to_dict("records")
    coding = Coding.of(source)
    columns = max(1, min(8, round((len(rows) * 1.5) ** 0.5)))
    tiles = []
    for row in rows:
        scan = source.scan(row)
        kinds = ", ".join(dict.fromkeys(str(flaw["kind"]) for flaw in scan.flaws)) or "no flaw"
        image = thumbnail(scan, coding, source.classes, TILE_PX).together()
        tiles.append((image, f"{scan.scan_id}\n{scan.split}: {kinds}"))
    tall = max(image.height for image, _ in tiles) + TEXT_PX + GAP_PX
    wide = TILE_PX + GAP_PX
    lines = -(-len(tiles) // columns)
    sheet = Image.new("RGB", (columns * wide + GAP_PX, lines * tall + GAP_PX), "white")
    draw = ImageDraw.Draw(sheet)
    for number, (image, text) in enumerate(tiles):
        x, y = GAP_PX + number % columns * wide, GAP_PX + number // columns * tall
        for line, words in enumerate(text.split("\n")):
            while draw.textlength(words) > TILE_PX:
                words = words[:-2] + "…"
            draw.text((x, y + 13 * line), words, fill="#22252B")
        sheet.paste(image, (x, y + TEXT_PX))
    with whole(picture) as aside:
        sheet.save(aside)
    return picture, len(tiles)
