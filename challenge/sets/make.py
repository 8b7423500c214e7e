"""`challenge make`: draw, render and seal a set of cases; continues where it was stopped."""

import hashlib
import io
import json
import shutil
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from challenge.cases.case import Secret, stage, write
from challenge.cases.imitation import IMITATES, TOLD, told_apart
from challenge.cases.nulls import check_null
from challenge.cases.seeds import child
from challenge.cases.truth import Facts, facts
from challenge.judging.score import ORACLE_SEES, moves_readings
from challenge.second import case as second
from challenge.second import imitation as second_imitation
from challenge.second.meshes import files as mesh_files
from challenge.second.nulls import LEAST_BLOCKS
from challenge.second.nulls import check_null as check_second_null
from challenge.second.truth import facts as second_facts
from challenge.sets.draw import FULL, counts_of, draw, entropy, second_shapes
from challenge.sets.populations import TEST, VALIDATION, needs_aggregate
from challenge.sets.processes import in_processes
from challenge.sets.sealed import MESHES, PROTOCOL, seal, write_whole

_TRIES = 20
"""Draws of a case in a row that may be invalid before a set is given up."""
MOST_DOUBLED = 3
"""How often a fault that nobody can see is made twice as large at most."""


def make(
    out: Path, *, seed: int | None, cases: int | None = None, jobs: int,
    population: str | None = None, family: str = "first", meshes: Path | None = None,
) -> int:  # fmt: skip
    """Make a sealed set in a folder.

    Parameters
    ----------
    out
        Gets ``cases/`` for the diagnosis, ``keys/`` for the judge, ``commitments.json``.
    seed
        Master seed; by default the operating system's entropy.
    cases
        How many, in the proportions of a full set; by default a full set.
    population
        Whose rule the set falls under, see `populations`; by default validation for the first
        family, test for the second.
    family
        ``first`` or ``second``, the family of instruments; or ``makes``, other makes of the first.
    meshes
        Folder of CAD meshes, a third of the second family's parts; the set keeps copies.

    Returns
    -------
    int
        Exit code.
    """
    if population is None:
        population = TEST.name if family == "second" else VALIDATION.name
    needs_aggregate(population)
    if meshes is not None and family != "second":
        raise ValueError(f"--meshes: needs --family second, got {family!r}")
    (out / "cases").mkdir(parents=True, exist_ok=True)
    (out / "keys").mkdir(exist_ok=True)
    master_file = out / "keys" / "master.json"
    if master_file.exists():
        plan = json.loads(master_file.read_text())
        if seed is not None and plan["seed"] != seed:
            raise ValueError(f"{out} holds a set of another seed; choose another folder")
    else:
        counts = FULL if cases is None else counts_of(cases)
        plan = {"seed": entropy() if seed is None else seed, "counts": counts, "family": family,
                "meshes": _kept(meshes, out)}  # fmt: skip
        write_whole(master_file, json.dumps(plan).encode())
    drawn = draw(
        plan["seed"], plan["counts"], plan.get("family", family), plan.get("meshes", ())
    )
    names = [f"case-{k + 1:03d}" for k in range(len(drawn))]
    todo = [(n, c) for n, c in zip(names, drawn, strict=True) if not _done(out, n)]
    print(f"{len(drawn)} cases, {len(todo)} to make", flush=True)
    if jobs == 1:
        for k, (name, secret) in enumerate(todo):
            _make_one(str(out), name, secret)
            print(f"{name} sealed ({k + 1} of {len(todo)})", flush=True)
    elif todo:
        calls = [(str(out), name, secret) for name, secret in todo]
        for k, (_, name, _) in enumerate(in_processes(_make_one, calls, jobs)):
            print(f"{name} sealed ({k + 1} of {len(todo)})", flush=True)
    listed = {}
    for name in names:
        kept = json.loads((out / "keys" / f"{name}.seal.json").read_text())
        listed[name] = {"commitment": kept["commitment"], "files": _digests(out / "cases" / name)}
    public = {"protocol": PROTOCOL, "population": population, "cases": listed}
    write_whole(out / "commitments.json", json.dumps(public, indent=1).encode())
    print(f"commitments: {out / 'commitments.json'}", file=sys.stderr)
    return 0


def _kept(meshes: Path | None, out: Path) -> list[str]:
    """Copy the usable meshes of a folder into the set; return their names."""
    if meshes is None:
        return []
    (out / MESHES).mkdir(exist_ok=True)
    found = mesh_files(meshes)
    for file in found:
        shutil.copyfile(file, out / MESHES / file.name)
    return [file.name for file in found]


def _done(out: Path, name: str) -> bool:
    sealed = out / "keys" / f"{name}.seal.json"
    if not sealed.exists():
        return False
    kept: dict[str, Any] = json.loads(sealed.read_text())
    return bool(kept["files"] == _digests(out / "cases" / name))


def _digests(folder: Path) -> dict[str, str]:
    if not folder.is_dir():
        return {}
    files = sorted(p for p in folder.iterdir() if p.is_file())
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def _make_one(root: str, name: str, secret: Secret) -> None:
    """Render one case, verify it, seal it; the seal is written last."""
    if secret.family == "second":
        _make_second(Path(root), name, secret)
        return
    out = Path(root)
    folder, aside = out / "cases" / name, out / "cases" / f".{name}"
    for old in (folder, aside):
        shutil.rmtree(old, ignore_errors=True)
    known: dict[str, Any] = {}
    again = child(secret.seed, "again")
    for attempt in range(_TRIES):
        try:
            staged = stage(secret)
        except ValueError:  # the part's booleans failed, or no pose avoids looking along walls
            secret = replace(secret, seed=int(again.integers(2**62)))
            continue
        if secret.kind == "null":
            check = check_null(staged, secret)
            known = {**asdict(check), "redrawn": attempt}
            if check.holds_in(secret.family):
                break
        else:
            seen = facts(staged, secret)
            rival = secret.kind == "undecidable" and secret.switches[0] in IMITATES
            told = told_apart(staged, secret.switches[0], 1e-3 * seen.noise_um) if rival else 0.0
            known = {"told_apart_z": told, "redrawn": attempt} if rival else {}
            if told <= TOLD:
                break
        secret = replace(secret, seed=int(again.integers(2**62)))
    else:
        raise RuntimeError(f"{name}: {_TRIES} draws in a row were no valid case")
    if secret.kind != "null":
        known |= _with_maps(out, name, seen)
    known["stated"] = {"effects": staged.effects, "noise_law": asdict(staged.noise_law)}
    world = staged.on
    known["switched"] = {
        "surface": asdict(world.surface),
        "motion": asdict(world.device.motion),
        "faults": asdict(world.device.faults),
        "plan": asdict(world.device.plan),
        "sheet": asdict(world.device.sheet),
        "camera": asdict(world.device.camera),
        "finder": asdict(world.device.finder),
    }
    write(secret, staged, aside)
    aside.replace(folder)
    _seal(out, name, secret, known)


def _make_second(out: Path, name: str, secret: Secret) -> None:
    """Render and seal one case of the second family; the seal is written last."""
    folder, aside = out / "cases" / name, out / "cases" / f".{name}"
    for old in (folder, aside):
        shutil.rmtree(old, ignore_errors=True)
    again = child(secret.seed, "again")
    known: dict[str, Any] = {}
    for attempt in range(_TRIES):
        # what fails on one part again and again may fail on every draw of it
        other_part = attempt >= _TRIES // 2
        try:
            staged = second.stage(secret, out / MESHES)
        except ValueError:  # the part's booleans failed
            secret = redrawn(secret, again, other_part=other_part)
            continue
        second.write(secret, staged, aside)
        if second.all_read(aside):  # nobody hands in a recording of nothing
            if secret.kind == "null":
                check = check_second_null(secret, staged, aside)
                known = {"null": asdict(check), "redrawn": attempt}
                if check.holds:
                    break
                # a mesh without places off edges is no null on any draw
                other_part |= check.blocks < LEAST_BLOCKS
            else:
                secret, staged, seen = _seen_second(out, secret, staged, aside)
                told = _told_second(secret, staged, seen)
                known = {"told_apart_z": told, "redrawn": attempt} if told > 0 else {}
                if told <= TOLD:
                    break
        shutil.rmtree(aside)
        secret = redrawn(secret, again, other_part=other_part)
    else:
        raise RuntimeError(f"{name}: {_TRIES} draws in a row were no valid case")
    if secret.kind != "null":
        known |= _with_maps(out, name, seen)
    second.withhold(secret, aside)
    aside.replace(folder)
    _seal(out, name, secret, {**known, **second.known_of(secret, staged)})


def redrawn(secret: Secret, rng: np.random.Generator, *, other_part: bool) -> Secret:
    """Draw a case of the second family again, from the same part or from another one."""
    shape = secret.shape
    if other_part:
        shape = str(rng.choice(sorted(second_shapes(secret.switches))))
    return replace(secret, shape=shape, seed=int(rng.integers(2**62)), doubled=0)


def _seen_second(
    out: Path, secret: Secret, staged: second.Staged, aside: Path
) -> tuple[Secret, second.Staged, Facts]:
    """Look at a fault of the second family; one that nobody can see is made larger."""
    seen = second_facts(staged, secret)
    # what nobody can see can't be named; noise and dropouts have no such measure
    while hidden_from_all(secret, seen.oracle_z) and secret.doubled < MOST_DOUBLED:
        secret = replace(secret, doubled=secret.doubled + 1)
        staged = second.stage(secret, out / MESHES)
        shutil.rmtree(aside)
        second.write(secret, staged, aside)
        seen = second_facts(staged, secret)
    return secret, staged, seen


def _told_second(secret: Secret, staged: second.Staged, seen: Facts) -> float:
    """Tell how far a perfect observer tells an undecidable fault from its rival; 0 for others."""
    if secret.kind != "undecidable" or secret.switches[0] not in second_imitation.IMITATES:
        return 0.0
    return second_imitation.told_apart(
        staged, secret.switches[0], secret.recordings - 1, 1e-3 * seen.noise_um
    )


def hidden_from_all(secret: Secret, oracle_z: float) -> bool:
    """Whether a medium or strong fault that moves readings doesn't show to a perfect observer."""
    return secret.strength > 0 and moves_readings(asdict(secret)) and oracle_z < ORACLE_SEES


def _with_maps(out: Path, name: str, seen: Facts) -> dict[str, Any]:
    """Keep the maps of a case beside its key; return the figures and the maps' digest."""
    maps = io.BytesIO()
    np.savez_compressed(maps, on=seen.on_mm, off=seen.off_mm, region=seen.region, fair=seen.fair)
    write_whole(out / "keys" / f"{name}.npz", maps.getvalue())
    digest = hashlib.sha256(maps.getvalue()).hexdigest()
    return {**seen.figures(), "region_share": float(seen.region.mean()), "maps_sha256": digest}


def _seal(out: Path, name: str, secret: Secret, known: dict[str, Any]) -> None:
    """Commit to a key; the seal is written last."""
    key, nonce, commitment = seal(secret, known)
    write_whole(out / "keys" / f"{name}.key.json", key)
    kept = {"nonce": nonce, "commitment": commitment, "files": _digests(out / "cases" / name)}
    write_whole(out / "keys" / f"{name}.seal.json", json.dumps(kept).encode())
