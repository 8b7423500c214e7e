"""An endless stream of a recipe's scans, by number, without a disk, from any process."""

import shutil
import tempfile
from collections.abc import Iterator
from multiprocessing.util import Finalize
from pathlib import Path

from pipeline.batch.backend import Backend
from pipeline.batch.plan import PlannedPart
from pipeline.batch.run import find_wanted, no_part, prepare
from pipeline.batch.work import simulate
from pipeline.injection.specimen import Specimen, make_specimen
from pipeline.parts.part_error import PartError
from pipeline.recipe import Recipe
from pipeline.scan.labelled_scan import Scan


class ScanStream:
    """The scans of a recipe, numbered: parts in turn, then specimens, each with all its scans.

    Scans of the recipe's specimens equal those of its dataset bit by bit; the numbers continue
    beyond. Each process loads the parts at its first scan.

    Parameters
    ----------
    recipe
        What to simulate.
    """

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        self._ready: tuple[Recipe, list[PlannedPart]] | None = None
        self._folder = Path()
        self._kept: tuple[int, Specimen] | None = None

    def __getstate__(self) -> dict[str, object]:
        return {"recipe": self.recipe, "_ready": None, "_folder": Path(), "_kept": None}

    @property
    def scans_each(self) -> int:
        """Scans of each specimen."""
        return self.recipe.file.scans

    def names(self, number: int) -> tuple[PlannedPart, int, int]:
        """Return part, number of the specimen and number of its scan."""
        _, parts = self._prepared()
        block, scan = divmod(number, self.scans_each)
        specimen, part = divmod(block, len(parts))
        return parts[part], specimen, scan

    def scan(self, number: int) -> Scan:
        """Simulate one scan.

        Raises
        ------
        PartError
            Where its specimen can't be made, or no path sees enough of it.
        """
        recipe, _ = self._prepared()
        part, number_of, scan = self.names(number)
        block = number // self.scans_each
        if self._kept is None or self._kept[0] != block:
            self._kept = block, make_specimen(recipe, part, number_of, self._folder)
        return simulate(recipe, part, self._kept[1], (number_of, scan))[0]

    def scans(self, start: int = 0, share: int = 0, shares: int = 1) -> Iterator[tuple[int, Scan]]:
        """Simulate without end, with its number, every scan from `start` that is in this share.

        A specimen belongs to one share; scans that fail are skipped.
        """
        block = start // self.scans_each
        block += (share - block) % shares
        while True:
            for number in range(block * self.scans_each, (block + 1) * self.scans_each):
                if number >= start:
                    try:
                        yield number, self.scan(number)
                    except PartError:
                        continue
            block += shares

    def _prepared(self) -> tuple[Recipe, list[PlannedPart]]:
        if self._ready is None:
            recipe = self.recipe.ready()
            self._folder = Path(tempfile.mkdtemp(prefix="flawforge-"))
            # a loader's workers end without running what atexit holds, but not without this
            Finalize(self, shutil.rmtree, (self._folder, True), exitpriority=0)
            wanted, failed = find_wanted(recipe)
            parts, _, more = prepare(recipe, wanted, self._folder / "parts", Backend())
            if not parts:
                raise no_part(recipe, wanted, [*failed, *more])
            self._ready = recipe, parts
        return self._ready
