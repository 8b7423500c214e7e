"""Flaws that are cut into a closed mesh, one file for each kind."""

from defects.dent import Dent
from defects.kind import Kind
from defects.pit import Pit

KINDS: dict[str, type[Kind]] = {kind.name: kind for kind in (Dent, Pit)}
"""Every kind of flaw by its name in recipes; a new kind is one more file and one more entry."""
