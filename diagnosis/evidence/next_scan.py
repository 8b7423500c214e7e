"""What to measure next: which further scan would tell causes apart that these recordings can't.

A scan is imagined: the part turned, shifted, tilted, nearer or farther, slower. In the equations of
all recordings and that scan together, cause a with its most probable coefficients β predicts what
cause b has to imitate. The nats by which it fails are

    D = ½ (β' G_aa β - β' G_ab (G_bb + s⁻² I)⁻¹ G_ba β)

and what the scan adds to D is the expected change of the log odds between a and b.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from diagnosis.data.recorded import Recorded
from diagnosis.evidence.gram import Gram, grams_of, turned
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.seen import Seen
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.register.placement import Placement
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Scan:
    """A scan to take, as a change of a recording that there is.

    Attributes
    ----------
    like : name of the recording that it repeats but for what follows
    turn_deg : of the part about the sensor's axis
    shift_mm : of the part along the laser line
    tilt_deg : of the part about the laser line
    range_mm : farther from the sensor
    slower : factor on the time between profiles
    """

    what: str
    like: str
    turn_deg: float = 0.0
    shift_mm: float = 0.0
    tilt_deg: float = 0.0
    range_mm: float = 0.0
    slower: float = 1.0

    def moved(self, poses: Floats, centre_mm: Floats) -> Floats:
        """Return the commanded poses (n, 4, 4) of this scan, part frame."""
        middle = poses[len(poses) // 2, :3, :3]
        turn = Rotation.from_rotvec(np.radians(self.turn_deg) * middle[:, 2])
        tilt = Rotation.from_rotvec(np.radians(self.tilt_deg) * middle[:, 0])
        matrix = (turn * tilt).as_matrix()
        out = poses.copy()
        out[:, :3, :3] = matrix @ poses[:, :3, :3]
        way = self.shift_mm * middle[:, 0] - self.range_mm * middle[:, 2]
        out[:, :3, 3] = (poses[:, :3, 3] - centre_mm) @ matrix.T + centre_mm + matrix @ way
        return out


@dataclass(frozen=True, kw_only=True, slots=True)
class NextScan:
    """A scan with what it is expected to decide."""

    scan: Scan
    between: tuple[str, str]
    expected_log_odds: float

    def as_json(self) -> dict[str, object]:
        """Return the entry of diagnosis.json."""
        return {
            **asdict(self.scan), "between": list(self.between),
            "expected_log_odds": self.expected_log_odds,
        }  # fmt: skip


def scans_like(name: str, width_mm: float, range_mm: float) -> list[Scan]:
    """List scans that a process engineer can take by moving the part or the sensor."""
    step, deep = 0.2 * width_mm, 0.15 * range_mm
    return [
        Scan(what="turn the part by 90° about the sensor's axis", like=name, turn_deg=90.0),
        Scan(what="turn the part by 180° about the sensor's axis", like=name, turn_deg=180.0),
        Scan(what=f"shift the part by {step:.3g} mm along the laser line", like=name,
             shift_mm=step),
        Scan(what="tilt the part by 8° about the laser line", like=name, tilt_deg=8.0),
        Scan(what=f"move the sensor {deep:.3g} mm away", like=name, range_mm=deep),
        Scan(what=f"move the sensor {deep:.3g} mm nearer", like=name, range_mm=-deep),
        Scan(what="scan four times as slowly", like=name, slower=4.0),
    ]  # fmt: skip


def next_scans(
    members: Sequence[Member],
    found: Seen,
    recorded: Recorded,
    placed: Mapping[str, Placement],
    noise: NoiseModel,
) -> tuple[NextScan, ...]:
    """Rank scans by the log odds that they are expected to add, most first.

    For each pair of a cause and the likeliest alternative to it.
    """
    pairs = [(m, rival) for m in members for rival in [_rival(m)] if rival]
    if not pairs:
        return ()
    by_name = {c.name: c for c in found.candidates}
    names = {n for m, rival in pairs for n in (m.candidate.component.name, rival)}
    recording = recorded.recordings[0]
    placement = placed[recording.name]
    sheet = recorded.datasheet
    out = []
    for scan in scans_like(recording.name, sheet.x_fov_mm, sheet.z_range_mm):
        gram = _imagined(scan, names, found, recorded, placement, noise)
        if gram is None:
            continue
        for member, rival in pairs:
            if rival not in by_name:
                continue
            odds = _added(member, by_name[rival].at, found, gram)
            if odds > 0:
                one, other = member.candidate, by_name[rival]
                out.append(NextScan(
                    scan=scan, between=(one.effect or one.name, other.effect or other.name),
                    expected_log_odds=odds,
                ))  # fmt: skip
    return tuple(sorted(out, key=lambda s: -s.expected_log_odds))


def _rival(member: Member) -> str:
    """Return the likeliest candidate in a member's place; "" where none is offered."""
    others = {
        n: p for n, p in member.shares.items()
        if n and n != member.candidate.name and not n.startswith(member.candidate.effect or "\0")
    }  # fmt: skip
    best = max(others, key=lambda n: others[n], default="")
    return best if best and others[best] > SETTINGS.offered else ""


def _imagined(
    scan: Scan,
    names: set[str],
    found: Seen,
    recorded: Recorded,
    placement: Placement,
    noise: NoiseModel,
) -> Gram | None:
    """Equations of an imagined scan in the columns of the recordings; None where it misses."""
    recording = recorded.recordings[0]
    moved = replace(placement, poses=scan.moved(placement.poses, placement.centre_mm))
    patches = [
        replace(p, depth_mm=p.plain_mm)
        for p in replace(
            recorded,
            recordings=(replace(recording, time_s=scan.slower * recording.time_s),),
            held_out=recorded.held_out[:1],
        ).cut(0, moved)
    ]
    seen_share = float(np.mean([np.isfinite(p.plain_mm).mean() for p in patches]))
    if seen_share < SETTINGS.reported * np.isfinite(recording.depth_mm).mean():
        return None
    ws = Workspace.build(patches, noise)
    states = ws.states(ws.predict(Model()))
    wanted = [c for c in found.components if c.name in names or c.group in names]
    bulk, _ = grams_of(wanted, patches, states, found.ranges, noise)
    return _in_columns(turned(bulk, found.turns), found.bulk)


def _in_columns(gram: Gram, like: Gram) -> Gram:
    """Put equations of shared components into the columns of others; own ones are left out."""
    size = len(like.right)
    matrix = np.zeros((size, size))
    where = {b.component.name: b.columns for b in like.blocks if b.recording is None}
    pairs = [
        (b.columns, where[b.component.name])
        for b in gram.blocks
        if b.recording is None and b.component.name in where
    ]
    for one, here in pairs:
        for two, there in pairs:
            matrix[here, there] = gram.matrix[one, two]
    return replace(like, matrix=matrix, right=np.zeros(size), readings=gram.readings)


def _added(member: Member, rival: NDArray[np.int64], found: Seen, scan: Gram) -> float:
    """Return the nats that an imagined scan adds to the difference between two causes."""
    at = member.candidate.at
    before = found.bulk.matrix
    inner = before[np.ix_(at, at)] + np.eye(len(at)) / member.size**2
    beta = np.linalg.solve(inner, found.bulk.right[at])
    both = before + scan.matrix

    def missed(g: Floats) -> float:
        cross = g[np.ix_(rival, at)] @ beta
        solid = g[np.ix_(rival, rival)] + np.eye(len(rival)) / member.size**2
        return 0.5 * float(beta @ g[np.ix_(at, at)] @ beta - cross @ np.linalg.solve(solid, cross))

    return max(missed(both) - missed(before), 0.0)
