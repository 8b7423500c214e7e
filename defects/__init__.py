"""Flaws that are cut into a closed mesh, one file for each kind."""

from defects.banked import Banked
from defects.bump import Bump
from defects.corrosion import Corrosion
from defects.crack import Crack
from defects.dent import Dent
from defects.edge_burr import EdgeBurr
from defects.edge_chip import EdgeChip
from defects.kind import Kind
from defects.missing_feature import MissingFeature
from defects.pit import Pit
from defects.porosity import Porosity
from defects.scratch import Scratch
from defects.spatter import Spatter
from defects.toe import LackOfFusion, Undercut
from defects.wear import Wear

KINDS: dict[str, type[Kind]] = {
    kind.name: kind
    for kind in (
        Dent, Crack, Pit, Scratch, Bump, EdgeChip, EdgeBurr, Corrosion, Undercut, LackOfFusion,
        Porosity, Spatter, Wear, MissingFeature, Banked,
    )
}  # fmt: skip
"""Every kind of flaw by its name in recipes; a new kind is one more file and one more line."""
