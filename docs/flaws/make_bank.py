"""Make docs/flaw-bank.md and its pictures: flaws out of scans, made ones and a real one.

    python -m docs.flaws.make_bank SHARED_FOLDER

The made flaws are those of tests/support/flawed_scan.py. The real recording is a height
map of SICK's AppSpace samples (Unlicense); it is read from the shared folder and not kept.
"""

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.interpolate import LinearNDInterpolator

from defects.flaw_bank import FlawBank, Relief
from defects.kinds.banked import spread
from defects.surface.surface import Surface as Skin
from docs.flaws.make_flaws import picture
from docs.real.nominal import plate as nominal_plate
from flawforge.flaw.extraction import extract
from pipeline.injection.flawplan import FlawPlan, exactly
from pipeline.injection.inject import inject
from pipeline.parts import builtin
from pipeline.seeds import streams
from sensors.recording import Recording
from tests.support.flawed_scan import MADE, SHEET, around, plate, recorded

HERE = Path(__file__).resolve().parent
SOURCE = "OCR_3D_image_42.json"
WINDOW = (slice(10, 352), slice(250, 640))  # the panel without label and base
REGION = "283:337,243:281"
PLANTED = (
    ("steel_plate", "face", {"scale": 1.0, "height_ratio": 1.0, "mirror": 0, "bend_deg": 0.0}),
    ("car_door", "outer", {"scale": 3.0, "height_ratio": 0.6, "mirror": 1, "bend_deg": 40.0}),
)

PAGE = """\
# Plant real flaws

Made by `python -m docs.flaws.make_bank SHARED_FOLDER`; do not edit.

    flawforge flaw extract a.h5 --part part.stl --sensor sensor.yaml --region 12,-4,19,3 --out bank

extracts one flaw from a recording. The mesh is the part without the flaw. The region is a box of
the part's x and y, or ranges of profiles and points. The steps:

1. The recording is registered on the part without the region's readings.
2. Each reading becomes a height over the part, along the local normal. A plane through the rim
   around the region is subtracted: form error of the part is no part of the flaw.
3. The noise's size and correlation are measured on smooth faces outside the region.
4. The heights are denoised: the posterior mean of a Gaussian process with that noise and a Matérn
   covariance, whose size and length come from the flaw (`flawforge/flaw/relief_denoising.py` has
   the equations and sources). Missing readings are filled.
5. The relief is laid on a square lattice on the part's skin, heading along the flaw's longer axis.
   It fades to zero over {fade} nodes beyond the flaw.

`bank/NAME.npz` holds the heights, the mask, the dimensions and the origin (recording, sensor,
registration, pitches, noise); `bank/NAME.png` is a picture of both.

A recipe draws from the bank:

```yaml
flaws:
  bank:
    path: bank                      # below the recipe's folder; every .npz in it
    number: 2
    scale: {{log_uniform: [0.5, 2]}}  # all lengths; height_ratio scales heights alone
    mirror: true                    # every second one
    bend_deg: {{uniform: [-20, 20]}}
```

The lattice is laid on the other part along geodesics of its skin, so that the flaw follows the
surface. The flaw is then cut as every other kind: labels are exact, and `flaws.parquet` names the
banked flaw in `source`. `dataset.json` holds the checksums of the bank's files.

## A made flaw, scanned with noise

Made flaws on a plate, scanned with the noise of a car door's skin at a pitch of 0.25 mm, with the
stage 0.2 mm off. The error is that of the relief's nodes against the noise-free scan.

| flaw | noise, µm | claimed error, µm | error, µm rms | volume removed - added, mm³ | true, mm³ |
| --- | --- | --- | --- | --- | --- |
{rows}
The tests plant such a relief on a plate, a cylinder and a bent sheet: depth and height come out
within 2 % and 5 %, the volume within 2 %.

![a made scratch](flaw-bank/scratch.png)

## A real recording

A height map of SICK's AppSpace samples (`OCR_3D`, image 42, Unlicense): a panel with raised
figures at a pitch of 0.1 mm. The nominal part is a plane. No public recording marks a flaw, so a
raised figure replaces one: its shape can be checked by eye.

{real}

![the figure one](flaw-bank/real.png)

The extraction recovers the stem, the foot and the two ridges of the foot. The noise contains the
panel's form at short wavelengths. The figures have steep flanks, so the denoised heights retain
most of the noise.

Planted again: as it was on a steel plate, and on a car door three times as large, 0.6 times as
high beside that, mirrored and bent by 40°.

![planted on other parts](flaws/bank.png)
"""


def made_rows() -> str:
    """Return the table's rows; draw the scratch."""
    from flawforge.flaw.picture import draw

    lines = []
    for kind, sizes in MADE.items():
        part = plate()
        flawed, scan, recording = recorded(part, kind, **sizes)
        found = extract(recording, part, SHEET, around(flawed), kind)
        relief = found.relief
        points = scan.laser.points_part_mm(scan.depth_ideal_mm, scan.poses_true).reshape(-1, 3)
        skin = Skin.of(part.vertices_mm, part.faces)
        nodes = spread(skin, found.site, relief.height_mm.shape, (relief.pitch_mm,) * 2).skin_mm
        height = points[:, 2] - part.vertices_mm[:, 2].max()
        true = LinearNDInterpolator(points[:, :2], height)(nodes[:, :2])
        error = (relief.height_mm - true.reshape(relief.height_mm.shape))[relief.footprint]
        size, flaw = relief.dimensions(), flawed.flaws[0]
        net = size["removed_mm3"] - size["added_mm3"]
        lines.append(
            f"| {kind} | {1e3 * found.noise.sd_mm:.1f} | {1e3 * found.denoised.sd_mm:.1f} | "
            f"{1e3 * np.sqrt(np.mean(error**2)):.1f} | {net:.3f} | "
            f"{flaw.removed_mm3 - flaw.added_mm3:.3f} |\n"
        )
        if kind == "scratch":
            draw(found, HERE.parent / "flaw-bank" / "scratch.png")
    return "".join(lines)


def real(shared: Path, folder: Path) -> tuple[Relief, str]:
    """Return the figure's relief and what the command prints about it; keep its picture."""
    run = [sys.executable, "-W", "ignore", "-m", "flawforge.cli"]
    subprocess.run(
        [*run, "import", str(shared / "real" / "sick" / SOURCE), "--as", str(folder / "panel.h5"),
         "--sensor-out", str(folder / "sensor.yaml")], check=True, capture_output=True,
    )  # fmt: skip
    whole = Recording.load(folder / "panel.h5")
    rows, columns = WINDOW
    assert whole.x_mm is not None
    panel = replace(
        whole, depth_mm=whole.depth_mm[WINDOW], intensity=None, poses=whole.poses[rows],
        time_s=whole.time_s[rows] - whole.time_s[rows][0], x_mm=whole.x_mm[columns],
    )  # fmt: skip
    panel.save(folder / "panel.h5")
    nominal_plate(panel).export(folder / "panel.stl")
    done = subprocess.run(
        [*run, "flaw", "extract", "panel.h5", "--part", "panel.stl", "--sensor", "sensor.yaml",
         "--region", REGION, "--out", "bank", "--name", "one"],
        cwd=folder, check=True, capture_output=True, text=True,
    )  # fmt: skip
    (HERE.parent / "flaw-bank" / "real.png").write_bytes((folder / "bank" / "one.png").read_bytes())
    return Relief.load(folder / "bank" / "one.npz"), done.stdout.splitlines()[0]


def plant(relief: Relief) -> None:
    """Write docs/flaws/bank.png: the relief on other parts."""
    figure = Figure(figsize=(9.2, 3.4), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    for k, (name, region, sizes) in enumerate(PLANTED):
        part = builtin.build(name)
        plan = exactly("bank", 1, FlawBank(reliefs=(relief,)), which=0.0, **sizes)
        for seed in range(5, 60):
            flawed = inject(
                part, FlawPlan(kinds=(plan,), where=(region,)), rng_of=streams(seed, "bank")
            )
            if flawed.flaws and flawed.flaws[0].normal[2] > 0.3:
                break
        axes = figure.add_subplot(1, 2, k + 1)
        axes.imshow(picture(flawed))
        high = float(flawed.cutters[0].height_mm.max())
        axes.set_title(f"{name}: {high:.2g} mm high", fontsize=11)
        axes.set_axis_off()
    figure.tight_layout()
    figure.savefig(HERE / "bank.png")


def main() -> None:
    """Write the page and its pictures."""
    from flawforge.flaw.extraction import FADE_NODES

    (HERE.parent / "flaw-bank").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        relief, said = real(Path(sys.argv[1]), Path(folder))
    plant(relief)
    page = PAGE.format(fade=FADE_NODES, rows=made_rows(), real="    " + said)
    (HERE.parent / "flaw-bank.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
