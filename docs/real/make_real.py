"""Diagnose real recordings of public sensors against simple nominal shapes; make the pictures.

    python docs/real/make_real.py SHARED_FOLDER [panel blobs strip]

The recordings are SICK AppSpace samples; their parts' CAD isn't public, so that the nominal shape
is inferred: a plane through most of the readings, as a thin box below them.
"""

import base64
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh

from sensors.recording import Recording

HERE = Path(__file__).parent
CASES = {
    "panel": "OCR_3D_image_42.json",
    "blobs": "BlobFeatureTypes3D_image.json",
    "strip": "StripGroove_image_9.json",
}


def plane_box(recording: Recording) -> trimesh.Trimesh:
    """Box whose top is the plane of most of the readings."""
    local_x = recording.x_mm
    assert local_x is not None
    x = np.broadcast_to(local_x, recording.depth_mm.shape)
    y = np.broadcast_to(recording.poses[:, 1, 3][:, None], recording.depth_mm.shape)
    z = recording.poses[:, 2, 3][:, None] - recording.depth_mm
    known = np.isfinite(z)
    weight = np.ones(known.sum())
    design = np.stack([x[known], y[known], np.ones(known.sum())], axis=1)
    values = z[known]
    level = np.histogram(values, bins=200)
    start = level[1][np.argmax(level[0])]
    weight = (np.abs(values - start) < 0.05 * np.ptp(values)) * 1.0
    for _ in range(10):
        solved = np.linalg.lstsq(design * weight[:, None], values * weight, rcond=None)[0]
        away = np.abs(values - design @ solved)
        scale = 1.4826 * np.median(away[weight > 0])
        weight = (away < 4 * max(scale, 1e-3)) * 1.0
    ends = np.array([[cx, cy] for cx in (x.min(), x.max()) for cy in (y.min(), y.max())])
    reach = 1.0
    ends += np.sign(ends - ends.mean(axis=0)) * reach
    top = np.column_stack([ends, ends @ solved[:2] + solved[2]])
    bottom = top - [0, 0, 20]
    return trimesh.convex.convex_hull(np.concatenate([top, bottom]))


def main() -> None:
    """Import, build the nominal shape, diagnose, keep the pictures."""
    shared = Path(sys.argv[1]) / "real" / "sick"
    for name, source in CASES.items():
        if len(sys.argv) > 2 and name not in sys.argv[2:]:
            continue
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            run = [sys.executable, "-m", "flawforge.cli"]
            subprocess.run(
                [*run, "import", str(shared / source), "--as", str(out / f"{name}.h5"),
                 "--sensor-out", str(out / "sensor.yaml")], check=True,
            )  # fmt: skip
            plane_box(Recording.load(out / f"{name}.h5")).export(out / "nominal.stl")
            subprocess.run(
                [*run, "diagnose", str(out / f"{name}.h5"), "--part", str(out / "nominal.stl"),
                 "--sensor", str(out / "sensor.yaml"), "--out", str(out / "diagnosis")], check=True,
            )  # fmt: skip
            content = (out / "diagnosis" / "diagnosis.json").read_text()
            (HERE / f"{name}.json").write_text(content)
            for former in HERE.glob(f"{name}-*.png"):
                former.unlink()
            page = (out / "diagnosis" / "report.html").read_text()
            for k, data in enumerate(re.findall(r"base64,([A-Za-z0-9+/=]+)", page)):
                (HERE / f"{name}-{k + 1}.png").write_bytes(base64.b64decode(data))
            summary = json.loads(content)
            print(name, summary["verdict"], [e["statement"] for e in summary["effects"]])


if __name__ == "__main__":
    main()
