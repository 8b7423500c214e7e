"""Ray casting side by side with the peers: ratios in one run, on one core.

`python benchmarks/casting.py` prints two tables: rays per second of the sweep and of its peers on
parts of several fineness, and the sweep's time against the number of triangles at a fixed number
of points. Times are processor seconds, so that other work on the machine disturbs them little.
Peers that aren't installed are named as skipped.
"""

import argparse
import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sensors.casting.laser import Laser
from sensors.casting.scene import Scene

Floats = NDArray[np.float64]

PROFILES, POINTS = 2000, 4096
FACETS_UM = (80.0, 20.0, 6.0)
HALF_FAN_RAD = np.deg2rad(63.5 / 2)
HEIGHT_MM = 400.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """One caster on one mesh.

    Attributes
    ----------
    mesh, triangles
        The mesh.
    caster
        Who cast.
    rays
        How many rays were timed.
    rays_per_s
        Rays by processor seconds, median over the rounds; 0 where skipped.
    ratio
        To embreex on the same mesh in the same run; 0 where skipped.
    note
        Why a peer was skipped, or what must be known to read its figure.
    """

    mesh: str
    triangles: int
    caster: str
    rays: int
    rays_per_s: float
    ratio: float
    note: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class GrowthRow:
    """The sweep's time for the full number of points on one mesh of a series."""

    triangles: int
    seconds: float
    per_doubling: float


def fan(points: int = POINTS) -> Laser:
    """Rays of the AT-C5-4090CS30-495 preset's fan, evenly spaced in angle."""
    angle = np.linspace(-HALF_FAN_RAD, HALF_FAN_RAD, points)
    return Laser(x_mm=np.zeros(points), slope_x=np.tan(angle))


def path_over(scene: Scene, profiles: int = PROFILES) -> Floats:
    """Poses of a straight scan along y over the part, from above, slightly askew."""
    low, high = scene.vertices_mm.min(axis=0), scene.vertices_mm.max(axis=0)
    yaw, roll = 0.05, 0.03
    about_z = np.array(
        [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
    )
    about_y = np.array(
        [[np.cos(roll), 0, np.sin(roll)], [0, 1, 0], [-np.sin(roll), 0, np.cos(roll)]]
    )
    turned = about_z @ about_y @ np.diag([1.0, -1.0, -1.0])
    poses = np.tile(np.eye(4), (profiles, 1, 1))
    poses[:, :3, :3] = turned
    along = np.linspace(-0.49, 0.49, profiles)[:, None] * (high - low)[1]
    poses[:, :3, 3] = (low + high) / 2 + along * turned[:, 1] - HEIGHT_MM * turned[:, 2]
    return poses


def rays_in_part(laser: Laser, poses: Floats) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Origins and unit directions (n·m, 3) of all rays, as the single-precision peers want them."""
    m = len(laser.x_mm)
    origins = np.repeat(poses[:, :3, 3], m, axis=0)
    way = laser.slope_x[None, :, None] * poses[:, None, :3, 0] + poses[:, None, :3, 2]
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    return origins.astype(np.float32), way.reshape(-1, 3).astype(np.float32)


def rows(
    meshes: Iterable[tuple[str, Scene]] | None = None,
    *,
    profiles: int = PROFILES,
    points: int = POINTS,
    share: int = 20,
    rounds: int = 3,
) -> list[Row]:
    """Time every caster on every mesh.

    Parameters
    ----------
    meshes
        Names and scenes; the car door at three finenesses where left out.
    profiles, points
        Size of the scan.
    share
        Slow casters get every `share`-th profile only.
    rounds
        How often each is timed; the median counts.
    """
    out = []
    for name, scene in built_in_meshes() if meshes is None else meshes:
        poses, laser = path_over(scene, profiles), fan(points)
        some = poses[::share]
        origins, way = rays_in_part(laser, some)
        measured: dict[str, tuple[int, float, str]] = {}
        for caster, prepare in _CASTERS.items():
            try:
                run, rays, note = prepare(scene, laser, poses, some, origins, way)
            except ImportError as missing:
                measured[caster] = (0, 0.0, f"skipped: {missing}".splitlines()[0])
                continue
            run()
            seconds = statistics.median(_timed(run) for _ in range(rounds))
            measured[caster] = (rays, rays / seconds, note)
        base = measured["embreex"][1]
        out += [
            Row(
                mesh=name, triangles=len(scene.faces), caster=caster,
                rays=rays, rays_per_s=rate, ratio=rate / base, note=note,
            )
            for caster, (rays, rate, note) in measured.items()
        ]  # fmt: skip
    return out


def growth_rows(
    *,
    profiles: int = PROFILES,
    points: int = POINTS,
    doublings: int = 6,
    rounds: int = 5,
) -> list[GrowthRow]:
    """Time the sweep on one wavy sheet of 20,000 triangles and its refinements."""
    out: list[GrowthRow] = []
    for k in range(doublings + 1):
        scene = wavy_sheet(round(20_000 * 2**k))
        poses, laser = path_over(scene, profiles), fan(points)
        cast = partial(scene.cast, laser, poses)
        cast()
        seconds = statistics.median(_timed(cast) for _ in range(rounds))
        growth = seconds / out[-1].seconds if out else float("nan")
        out.append(GrowthRow(triangles=len(scene.faces), seconds=seconds, per_doubling=growth))
    return out


def built_in_meshes(facets_um: Iterable[float] = FACETS_UM) -> Iterator[tuple[str, Scene]]:
    """Yield the car door at several finenesses."""
    from pipeline.parts.builtin import build

    for facet_um in facets_um:
        part = build("car_door", facet_um=facet_um)
        yield f"car door, {facet_um:g} µm", Scene(part.vertices_mm, part.faces)


def mesh_file(path: Path) -> tuple[str, Scene]:
    """Read a real mesh, brought to 500 mm so that the fan covers it."""
    from pipeline.parts.part import load_part

    part = load_part(path)
    vertices = part.vertices_mm - part.vertices_mm.mean(axis=0)
    return path.name, Scene(vertices * (500 / np.ptp(vertices, axis=0).max()), part.faces)


def wavy_sheet(triangles: int) -> Scene:
    """Build a closed sheet of 520 × 460 × 2 mm with waves, of about so many triangles."""
    side = max(2, round((triangles / 4) ** 0.5) + 1)
    x, y = np.meshgrid(np.linspace(-260, 260, side), np.linspace(-230, 230, side))
    z = 12 * np.cos(x / 90) * np.cos(y / 110) + 1.5 * np.sin(x / 7) * np.sin(y / 9)
    top = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    number = np.arange(side * side).reshape(side, side)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, d = number[1:, 1:].ravel(), number[1:, :-1].ravel()
    upper = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    rim = np.concatenate([number[0], number[1:, -1], number[-1, -2::-1], number[-2:0:-1, 0]])
    after, below = np.roll(rim, -1), side * side
    walls = np.concatenate(
        [
            np.column_stack([after, rim, rim + below]),
            np.column_stack([after, rim + below, after + below]),
        ]
    )
    return Scene(
        np.concatenate([top, top - [0, 0, 2]]),
        np.concatenate([upper, upper[:, ::-1] + below, walls]),
    )


def _timed(run: Callable[[], object]) -> float:
    begin = time.process_time()
    run()
    return time.process_time() - begin


Prepared = tuple[Callable[[], object], int, str]


def _sweep(
    scene: Scene, laser: Laser, poses: Floats, some: Floats, origins: object, way: object
) -> Prepared:
    return lambda: scene.cast(laser, poses), len(poses) * len(laser.x_mm), "double precision"


def _refined(
    scene: Scene, laser: Laser, poses: Floats, some: Floats, origins: object, way: object
) -> Prepared:
    note = "double precision, same result as the sweep"
    return lambda: scene.cast_by_tree(laser, some), len(some) * len(laser.x_mm), note


def _embreex(
    scene: Scene, laser: Laser, poses: Floats, some: Floats,
    origins: NDArray[np.float32], way: NDArray[np.float32],
) -> Prepared:  # fmt: skip
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    tree = EmbreeScene()
    TriangleMesh(tree, scene.vertices_mm.astype(np.float32), scene.faces)
    return lambda: tree.run(origins, way, query="DISTANCE"), len(origins), "rays made beforehand"


def _trimesh(
    scene: Scene, laser: Laser, poses: Floats, some: Floats,
    origins: NDArray[np.float32], way: NDArray[np.float32],
) -> Prepared:  # fmt: skip
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    caster = RayMeshIntersector(
        trimesh.Trimesh(scene.vertices_mm, scene.faces, process=False)
    )
    return (
        lambda: caster.intersects_location(origins, way, multiple_hits=False),
        len(origins),
        "through embreex; points computed in double precision",
    )


def _open3d(
    scene: Scene, laser: Laser, poses: Floats, some: Floats,
    origins: NDArray[np.float32], way: NDArray[np.float32],
) -> Prepared:  # fmt: skip
    import open3d as o3d

    tree = o3d.t.geometry.RaycastingScene(nthreads=1)
    tree.add_triangles(
        o3d.core.Tensor(scene.vertices_mm.astype(np.float32)),
        o3d.core.Tensor(scene.faces.astype(np.uint32)),
    )
    rays = o3d.core.Tensor(np.concatenate([origins, way], axis=1))
    return lambda: tree.cast_rays(rays, nthreads=1), len(origins), "rays made beforehand"


def _vtk(
    scene: Scene, laser: Laser, poses: Floats, some: Floats,
    origins: NDArray[np.float32], way: NDArray[np.float32],
) -> Prepared:  # fmt: skip
    import vtkmodules.vtkCommonCore as core
    import vtkmodules.vtkCommonDataModel as model
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    points, cells, mesh = core.vtkPoints(), model.vtkCellArray(), model.vtkPolyData()
    points.SetData(numpy_to_vtk(scene.vertices_mm, deep=True))
    cells.SetData(3, numpy_to_vtkIdTypeArray(scene.faces.astype(np.int64).ravel(), deep=True))
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    locator = model.vtkStaticCellLocator()
    locator.SetDataSet(mesh)
    locator.BuildLocator()
    few = slice(None, None, max(1, len(origins) // 20_000))
    starts = origins[few].astype(np.float64)
    ends = starts + 2 * HEIGHT_MM * way[few].astype(np.float64)
    t, code, cell = core.reference(0.0), core.reference(0), core.reference(0)
    place, local = [0.0] * 3, [0.0] * 3

    def run() -> None:
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            locator.IntersectWithLine(start, end, 1e-6, t, place, local, code, cell)

    return run, len(starts), "one call from Python per ray"


_CASTERS = {
    "sweep": _sweep,
    "Embree, refined": _refined,
    "embreex": _embreex,
    "trimesh": _trimesh,
    "Open3D": _open3d,
    "VTK": _vtk,
}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--profiles", type=int, default=PROFILES)
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument("--facets-um", type=float, nargs="*", default=FACETS_UM)
    parser.add_argument("--mesh", type=Path, nargs="*", default=[], help="real meshes beside it")
    parser.add_argument("--growth", action="store_true", help="also time against triangles")
    arguments = parser.parse_args()

    def meshes() -> Iterator[tuple[str, Scene]]:
        yield from built_in_meshes(arguments.facets_um)
        yield from map(mesh_file, arguments.mesh)

    print(f"{'mesh':28} {'triangles':>9}  {'caster':16} {'Mrays/s':>8} {'ratio':>7}  note")
    for mesh in meshes():
        for row in rows([mesh], profiles=arguments.profiles, points=arguments.points):
            speed = f"{row.rays_per_s / 1e6:8.2f} {row.ratio:7.2f}" if row.rays else " " * 16
            print(f"{row.mesh:28} {row.triangles:9}  {row.caster:16} {speed}  {row.note}")
    if arguments.growth:
        print(f"\n{'triangles':>9} {'seconds':>8} {'growth':>7}")
        for step in growth_rows(profiles=arguments.profiles, points=arguments.points):
            print(f"{step.triangles:9} {step.seconds:8.4f} {step.per_doubling:7.2f}")


if __name__ == "__main__":
    main()
