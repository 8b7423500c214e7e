"""Every kind of flaw, one file for each."""

from defects.kind import Kind
from defects.kinds.banked import Banked
from defects.kinds.bump import Bump
from defects.kinds.corrosion import Corrosion
from defects.kinds.crack import Crack
from defects.kinds.dent import Dent
from defects.kinds.edge_burr import EdgeBurr
from defects.kinds.edge_chip import EdgeChip
from defects.kinds.missing_feature import MissingFeature
from defects.kinds.pit import Pit
from defects.kinds.porosity import Porosity
from defects.kinds.scratch import Scratch
from defects.kinds.spatter import Spatter
from defects.kinds.wear import Wear
from defects.kinds.weld_toe import LackOfFusion, Undercut

KINDS: dict[str, type[Kind]] = {
    kind.name: kind
    for kind in (
        Dent, Crack, Pit, Scratch, Bump, EdgeChip, EdgeBurr, Corrosion, Undercut, LackOfFusion,
        Porosity, Spatter, Wear, MissingFeature, Banked,
    )
}  # fmt: skip
"""Every kind of flaw by its name in recipes; a new kind is one more file and one more line."""
