"""One unit of work: make one shard, alone, from the recipe and the plan."""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from files.place import put, reached
from files.plain_data import plain
from files.whole_file import write_whole
from pipeline.batch.backend import keep_memory, one_thread
from pipeline.batch.plan import PlannedPart, PlannedScans, PlannedShard
from pipeline.dataset.object_store import HIDDEN
from pipeline.dataset.shards import ShardWriter, file_sha256
from pipeline.injection.flawed_part import Flaw
from pipeline.injection.specimen import Specimen, make_specimen, skin_of, stored_part
from pipeline.motion.trajectory import Trajectory
from pipeline.parts.part_error import PartError
from pipeline.recipe import Recipe
from pipeline.scan.detectability import Evidence
from pipeline.scan.labelled_scan import Conditions, Scan, take_scan
from pipeline.scan.labels import Tally
from pipeline.seeds import seed_of, streams


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Workplace:
    """Data that all workers of a dataset share.

    Parameters
    ----------
    recipe, out, attributes
        What is made, the folder it is made in, and what each shard states.
    store
        Where shards go, each as it is whole; None: they stay in the folder.
    """

    recipe: Recipe
    out: Path
    attributes: dict[str, Any]
    store: Path | None = None

    @property
    def hidden(self) -> Path:
        """Folder of the journals and the kept parts."""
        return self.out / HIDDEN

    def journal(self, shard: str) -> Path:
        """Path of a shard's journal, which states that the shard is whole, and its content."""
        return self.hidden / f"{shard}.json"

    def sha256(self, shard: str) -> str | None:
        """SHA-256 of a whole shard's bytes; None where there is none."""
        path = (self.store or self.out) / shard
        try:
            with reached(path, but=FileNotFoundError):
                return file_sha256(path)
        except OSError:
            return None

    def deliver(self, shard: str) -> None:
        """Upload a shard and then its journal, where the dataset goes into a store."""
        if self.store is None:
            return
        put(self.out / shard, self.store / shard)
        put(self.journal(shard), self.store / HIDDEN / f"{shard}.json")
        (self.out / shard).unlink()


def read_journal(place: Workplace, shard: str) -> dict[str, Any]:
    """Return the journal of a shard.

    Raises
    ------
    ValueError
        Where the journal isn't as it was written.
    """
    text, _, digest = place.journal(shard).read_text(encoding="utf-8").rstrip("\n").rpartition("\n")
    if hashlib.sha256(text.encode()).hexdigest() != digest:
        raise ValueError(f"the journal of {shard} is damaged")
    journal: dict[str, Any] = json.loads(text)
    return journal


def is_whole(place: Workplace, shard: str) -> bool:
    """Whether a shard's file exists with the checksum of its journal."""
    try:
        written: str = read_journal(place, shard)["sha256"]
    except (OSError, ValueError, KeyError):
        return False
    return place.sha256(shard) == written


def make_shard(place: Workplace, shard: PlannedShard) -> tuple[str, int]:
    """Make a shard and its journal (rows of the manifest, failures); return name and scans."""
    recipe = place.recipe
    scans: list[dict[str, Any]] = []
    flaws: list[dict[str, Any]] = []
    failed: list[dict[str, Any]] = []
    dropped: list[dict[str, Any]] = []
    redrawn = 0
    with ShardWriter(
        place.out / shard.name,
        datasheet=recipe.datasheet,
        shape=(shard.scans, recipe.file.profiles, recipe.points),
        attributes=place.attributes,
        with_points=recipe.file.points_on_disk,
        with_intensity=recipe.file.intensity is not None,
        compression=recipe.file.compression,
    ) as writer:
        for work in shard.work:
            try:
                specimen = _specimen(place, work)
            except PartError as error:
                failed.append(
                    {"part": work.part.name, "specimen": work.specimen_id, "why": str(error)}
                )
                continue
            if work.first == 0:
                redrawn += specimen.flawed.redrawn
                dropped += [
                    {"specimen": work.specimen_id, "why": why} for why in specimen.flawed.dropped
                ]
            for number in range(work.first, work.last):
                scan_id = f"{work.specimen_id}-{number:04d}"
                try:
                    scan, seen, facts = _scan(recipe, work, specimen, number)
                except PartError as error:
                    failed.append({"part": work.part.name, "scan": scan_id, "why": str(error)})
                    continue
                row = {
                    "scan_id": scan_id,
                    "part": work.part.name,
                    "specimen": work.specimen_id,
                    "split": work.splits[number - work.first],
                    "split_by": work.split_by,
                    "shard": shard.name,
                    "row": len(scans),
                    "checksum": writer.add(scan_id, scan),
                    **facts,
                }
                found = _flaw_rows(row, scan, seen, specimen, recipe.file.detectable_at)
                row["flaws_detectable"] = sum(flaw["detectable"] for flaw in found)
                scans.append(row)
                flaws.extend(found)
    journal = {
        "shard": shard.name,
        "sha256": file_sha256(place.out / shard.name),
        "scans": plain(scans),
        "flaws": plain(flaws),
        "failed": failed,
        "redrawn": redrawn,
        "dropped": dropped,
    }
    text = json.dumps(journal)
    digest = hashlib.sha256(text.encode()).hexdigest()
    write_whole(place.journal(shard.name), f"{text}\n{digest}\n")
    place.deliver(shard.name)
    return shard.name, len(scans)


def load_shared(place: Workplace, shards: Sequence[PlannedShard]) -> None:
    """Load and build what the processes that will be forked need, so that none does it again.

    These are the parts with trees and skins, as many as a process keeps, and, where the first
    shards are of one specimen, that specimen and the loops of its scans.
    """
    one_thread()
    keep_memory()
    parts = {work.part.stored: None for shard in shards for work in shard.work}
    for stored in list(parts)[: stored_part.cache_parameters()["maxsize"]]:
        _, scene = stored_part(place.hidden / stored)
        _ = scene.tree
        skin_of(place.hidden / stored)
    first = shards[0].work[0]
    if len({shard.work[0].specimen_id for shard in shards[:2]}) == 1 and not first.whole:
        with suppress(PartError):  # which its shards report
            specimen = _specimen(place, first)
            simulate(place.recipe, first.part, specimen, (first.specimen, first.first))


# A specimen with more scans than a shard holds comes back for the next shard: keep the last one.
_SPECIMENS: dict[tuple[str, str, int], Specimen] = {}


def _specimen(place: Workplace, work: PlannedScans) -> Specimen:
    key = (str(place.out), work.part.name, work.specimen)
    specimen = _SPECIMENS.get(key)
    if specimen is None:
        _SPECIMENS.clear()
        specimen = make_specimen(
            place.recipe, work.part, work.specimen, place.hidden, shared=not work.whole
        )
        _SPECIMENS[key] = specimen
    return specimen


def simulate(
    recipe: Recipe, part: PlannedPart, specimen: Specimen, names: tuple[int, int]
) -> tuple[Scan, Trajectory, int]:
    """Simulate a scan by its names, the specimen's number and its own.

    Returns
    -------
    Scan, Trajectory, int
        The scan, its path, and the number of paths drawn.
    """
    file = recipe.file
    rng_of = streams(file.seed, part.name, names[0], "scan", names[1])
    path, drawn = specimen.aimer.path(rng_of, names[1])
    surface_name = surface_of(recipe, part)
    conditions = Conditions(
        sensor=recipe.sensor,
        laser=specimen.laser,
        surface=recipe.surfaces[surface_name] if surface_name is not None else None,
        reflectance=recipe.reflectance,
        brightness=file.intensity,
        visible_at=file.visible_at,
    )
    scan = take_scan(specimen.flawed, specimen.scenes, path, conditions, rng_of)
    return scan, path, drawn


def surface_of(recipe: Recipe, part: PlannedPart) -> str | None:
    """Return the name of a part's surface."""
    return part.entry.surface or recipe.file.surface


def _scan(
    recipe: Recipe, work: PlannedScans, specimen: Specimen, number: int
) -> tuple[Scan, Tally, dict[str, Any]]:
    file = recipe.file
    names = (work.part.name, work.specimen, "scan", number)
    scan, path, drawn = simulate(recipe, work.part, specimen, (work.specimen, number))
    seen = scan.tally(len(specimen.flawed.flaws))
    seed = "".join(f"{word:08x}" for word in seed_of(file.seed, *names).generate_state(4))
    start = path.poses[0, :3, 3]
    facts: dict[str, Any] = {
        "seed": seed,
        "sensor": recipe.datasheet.name,
        "surface": surface_of(recipe, work.part),
        "flaws": len(specimen.flawed.flaws),
        "flaws_seen": int((seen.pixels > 0).sum()),
        "flaws_visible": int((seen.visible > 0).sum()),
        "share_valid": seen.valid / seen.points,
        "share_flaw": int(seen.pixels.sum()) / seen.points,
        "depth_mean_mm": seen.depth_mean_mm,
        "paths_drawn": drawn,
        "start_x_mm": start[0],
        "start_y_mm": start[1],
        "start_z_mm": start[2],
        **path.facts,
    }
    return scan, seen, facts


def _flaw_rows(
    row: Mapping[str, Any], scan: Scan, seen: Tally, specimen: Specimen, detectable_at: float
) -> list[dict[str, Any]]:
    """One row for each flaw of the specimen, seen in this scan or not."""
    rows = []
    for flaw in specimen.flawed.flaws:
        number = flaw.instance
        pixels, ratio = int(seen.pixels[number]), float(seen.deviation_over_noise[number])
        rows.append(
            {
                **{key: row[key] for key in ("scan_id", "part", "specimen", "split")},
                **_facts(flaw),
                "pixels": pixels,
                "pixels_visible": int(seen.visible[number]),
                "share_hidden": int(seen.hidden[number]) / pixels if pixels else None,
                "deviation_over_noise": None if math.isnan(ratio) else ratio,
                **_shown(scan.evidence[number], detectable_at),
            }
        )
    return rows


def _shown(evidence: Evidence | None, detectable_at: float) -> dict[str, Any]:
    """Say whether a flaw can be detected, and where it lies in the scan."""
    if evidence is None:
        return {"snr": 0.0, "detectable": False}
    return {
        "snr": evidence.snr,
        "response": evidence.response,
        "detectable": evidence.snr >= detectable_at,
        "deviation_max_mm": evidence.deviation_max_mm,
        "bbox_profile_first": evidence.rows[0],
        "bbox_profile_end": evidence.rows[1],
        "bbox_point_first": evidence.columns[0],
        "bbox_point_end": evidence.columns[1],
    }


def _facts(flaw: Flaw) -> dict[str, Any]:
    """Say what a flaw is and where it sits, as a row's columns; lengths mm, part frame."""
    position = dict(zip(("x", "y", "z"), flaw.position_mm.tolist(), strict=True))
    normal = dict(zip(("x", "y", "z"), flaw.normal.tolist(), strict=True))
    return {
        "instance": flaw.instance,
        "kind": flaw.kind,
        "class_id": flaw.class_id,
        "tier": flaw.tier,
        "source": flaw.source,
        "parameters": json.dumps(flaw.parameters),
        **{f"size_{name}": value for name, value in flaw.parameters.items()},
        "seed": str(flaw.seed),
        **{f"position_{axis}_mm": value for axis, value in position.items()},
        **{f"normal_{axis}": value for axis, value in normal.items()},
        "removed_mm3": flaw.removed_mm3,
        "added_mm3": flaw.added_mm3,
        "opening_mm2": flaw.opening_mm2,
        "depth_mm": flaw.depth_mm,
    }
