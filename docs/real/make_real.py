"""Diagnose real recordings of public sensors against simple nominal shapes; make the pictures.

    python docs/real/make_real.py SHARED_FOLDER [panel solids strip]

The recordings are SICK AppSpace samples; their parts' CAD isn't public, so that the nominal shape
is inferred from the recording itself, see nominal.py.
"""

import base64
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import trimesh
from nominal import nominal, plate

from sensors.recording import Recording

HERE = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class Case:
    """One recording.

    Attributes
    ----------
    source : file in the shared folder
    shape : builds the nominal shape
    window : profiles and points that are looked at; all without one
    """

    source: str
    shape: Callable[[Recording], trimesh.Trimesh]
    window: tuple[slice, slice] = (slice(None), slice(None))

    def cut(self, recording: Recording) -> Recording:
        """Return the part of a recording within the window."""
        rows, columns = self.window
        assert recording.x_mm is not None
        assert recording.intensity is not None
        return replace(
            recording,
            depth_mm=recording.depth_mm[rows, columns],
            intensity=recording.intensity[rows, columns],
            poses=recording.poses[rows],
            time_s=recording.time_s[rows] - recording.time_s[rows][0],
            x_mm=recording.x_mm[columns],
        )


CASES = {
    # the panel alone, without the label, the figures and what it lies on
    "panel": Case(
        source="OCR_3D_image_42.json", shape=plate, window=(slice(10, 285), slice(250, 640))
    ),
    # where nothing but the plate lies below: most of the dark table returns no light
    "solids": Case(
        source="BlobFeatureTypes3D_image.json",
        shape=lambda r: nominal(r, (199.5, 201.5), table=True),
        window=(slice(420, 745), slice(45, 715)),
    ),
    "strip": Case(
        source="StripGroove_image_9.json", shape=lambda r: nominal(r, (62.0, 63.0), table=False)
    ),
}


def main() -> None:
    """Import, build the nominal shape, diagnose, keep the pictures."""
    shared = Path(sys.argv[1]) / "real" / "sick"
    for name, case in CASES.items():
        if len(sys.argv) > 2 and name not in sys.argv[2:]:
            continue
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            run = [sys.executable, "-m", "flawforge.cli"]
            subprocess.run(
                [*run, "import", str(shared / case.source), "--as", str(out / f"{name}.h5"),
                 "--sensor-out", str(out / "sensor.yaml")], check=True,
            )  # fmt: skip
            recording = case.cut(Recording.load(out / f"{name}.h5"))
            recording.save(out / f"{name}.h5")
            case.shape(recording).export(out / "nominal.stl")
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
