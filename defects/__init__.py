"""Flaws that are cut into a closed mesh, one file for each kind."""

from defects.bump import Bump
from defects.crack import Crack
from defects.dent import Dent
from defects.kind import Kind
from defects.pit import Pit
from defects.scratch import Scratch

KINDS: dict[str, type[Kind]] = {
    "dent": Dent,
    "crack": Crack,
    "pit": Pit,
    "scratch": Scratch,
    "bump": Bump,
}
"""Every kind of flaw by its name in recipes; a new kind is one more file and one more line."""
