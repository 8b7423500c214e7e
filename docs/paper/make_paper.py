"""Write docs/paper.md and its pictures: the paper's tables and figures beside ours.

Run by `make paper`. Needs the development environment; without real recordings in a `shared/`
folder beside the checkout, the page says that their section is missing.
"""

import time
from pathlib import Path

import numpy as np
from figures import door_scan, figure_6, figure_7, figure_10, recording, surfaces
from recordings import REGIONS, SHARED, Outcome, compare, shuffled, table
from tables import (
    beat,
    other_readings,
    papers_tables,
    pitches,
    readings,
    summary,
    three_figures,
)

PAGE = Path(__file__).resolve().parents[1] / "paper.md"

HEAD = """\
# The paper's noise, reproduced and surpassed

Made by `make paper`; every number below was measured in that run.
Paper: Roos-Hoefgeest et al., *Simulation of Laser Profilometer Measurements in the Presence of
Speckle Using Perlin Noise*, Sensors 2023, 23(17), 7624.

The paper draws Perlin noise whose amplitude is max(Rpm, Rvm) and which has as many control points
as the surface has peaks, adds the sensor's uncertainty (equation 10) and rounds. Its simulated
scans miss the roughness of the real ones by 3.8 % on average and by 9.4 % at worst. Here the same
family of noise is *solved* so that what is measured on the simulated scan equals what was wanted.
"""

VERBATIM = """\
## Tables 2 to 4

Windows of 100 profiles × 501 points at the paper's pitch (22.5 mm over 501 points and over 100
profiles; plate 20 mm and 40 mm), ΔZ = 3.8 µm, ten seeds that no calibration uses; ± is the spread
from seed to seed. *Verbatim*: equation 9 with unit gradients, 4 octaves, persistence 0.5, all
octaves drawn and their lattices aligned. *Normalised*: each octave scaled by √2, since the largest
value of one with unit gradients is √½. Errors are relative to the real scan; the paper's are as it
prints them.
"""

WHAT_VERBATIM_SAYS = """\
Read literally, the model falls a third short in every height: Perlin noise with unit gradients
doesn't reach ±1. Normalised, Ra and Rq of door and plate come out within 1 %, which is what the
paper prints for its own simulation too, so this is how its authors must have scaled it. Rp and Rv
stay 9 to 15 % short and Rpm and Rvm about 20 %.

## Which reading of the definitions

The paper's words leave open what a peak of Rpm is, and whether the 10 % of Pc are a height or a
distance. Equation 9 (normalised) was drawn and measured under each reading, and compared with the
ratios of the figures **printed** for the paper's own simulation.
"""

WHAT_READINGS_SAY = """\
- **Rpm**: the ten highest *readings* come closest among what the words allow; local maxima give 1
  to 3 % less at 501 points and the same at 4096.
- **Pc**: every local maximum comes closest; with the 10 % read as a height Pc is 15 to 30 % below
  what is printed. Read as a distance along the profile, in points, the rule excludes nothing here;
  in mm it would exclude neighbours on the plate, whose real Pc of 0.274 a point would then be out
  of reach even of white noise.
- **The window**: in profiles of 501 points no reading gives the printed ratios Rp/Rq ≈ 3 and
  Rpm/Rp ≈ 0.9 for this noise; in profiles of 4096 points all of them nearly do. The paper's tables
  were in all likelihood taken from whole profiles of its 4096-point sensor and not from the window
  that its text describes. This matters below.
"""

CALIBRATED = """\
## The calibrated model

Same family; solved are the control points' distance, the persistence, and a monotone map of the
heights (piecewise cubic, 19 knots), so that all seven measured figures agree after equation 10 and
rounding. It is deterministic, takes 3 to 20 s a surface, and is stored in the surface's YAML.
Octaves have shifted lattices, and what the grid can't show is left out.

To have Rp/Rq ≈ 3 *and* Rpm/Rp ≈ 0.9 within 501 points, the highest and lowest 2 % of the readings
must form a shoulder with a sharp end (figure 10), and for Ra/Rq to stay at 0.79 the middle must
flatten. Of all maps that reach the figures to about 1 % the one closest to a straight line is
taken. Figures of whole profiles would need no shoulder: whoever has a scan of the real surface
should give it to `flawforge roughness` instead, as below.

Under the readings that were *not* taken, the calibrated noise differs from the tables by:
"""

WINDOW = """\
ΔZ is the datasheet's 3.8 µm, because it is what the presets' sensor rounds to. The paper holds
15 µm to be more realistic: with it Rq of the door is 6 % larger, as the second row for each
surface shows.

## At other pitches

Figures hold at a pitch. The field is defined in millimetres; at another pitch control points are
spread to the grid's limit (1.2 steps, where the octave's spectrum peaks just below Nyquist's
frequency), and octaves that add nothing new by then are left out. The height map keeps the heights'
distribution whatever is left out: Ra, Rq, Rp and Rv stay, Pc follows the pitch. 0.1209 × 0.2 mm is
the full fan of the AT-C5-4090CS30-495 preset at 0.1 m/s. Windows of 100 × 501, five seeds:
"""

THREE = """\
## Three figures alone

A surface given by Rpm, Rvm and Pc gets the straightest map that reaches these three. The other
four then follow from the family; errors against the real scan's:
"""

KS = """\
## Heights: figure 10, and what Kolmogorov and Smirnov can't see

The real scans of the paper aren't public, so its own Kolmogorov-Smirnov comparison can't be
repeated; figure 10 shows both models beside a Gaussian of the real Rq. Where there are real
recordings the comparison is made below, with the spectra beside it: KS doesn't look at the order
of the readings.

![Figure 10](paper/figure-10.png)
"""

REAL = """\
## Real recordings: fitted on one half, compared with the other

Figures, heights and spectra of the first half are aimed at; nothing of the second half is used.
Form: a line for each profile and the Gaussian filter of ISO 16610-21 with the cut-off that the
picture marks. Errors are against the unseen half; "first half itself" is how far the two real
halves differ, below which no model can be expected to fall. Spectra: largest deviation of a band
between the form cut-off and the resolution limit. KS at most 0.05 is the paper's criterion.
"""

WHY = """\
What the family can't reach, and why:

- **OCR_3D 34, base**: the errors above 5 % are those of the two real halves.
- **x3p-2** has parallel grooves, about nine over its 0.083 mm: their lay puts a line into the
  spectrum along the profiles and takes power out of the low frequencies across. Gradients of
  uniform direction have a smooth spectrum; two cell sizes make it elliptic, not lined. The
  compromise between its figures and a spectrum out of reach leaves Rv and Pc 6 to 7 % off.
- **sur-2** has bands and a few spikes of 20 times Rq; its halves differ by up to 40 % themselves,
  and there are more peaks than white noise has (0.351 a point against 0.333), which no
  interpolated noise gives.
- **The stylus profile** is one line: its halves differ by 10 to 15 %, and so does what is fitted.
  Its spectrum falls more slowly than four octaves do.
"""


def write(lines: list[str]) -> None:
    """Write the page."""
    PAGE.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


def tables_section() -> list[str]:
    """Return everything about the paper's own surfaces."""
    tables, errors = papers_tables()
    low, high = beat()
    spread = np.abs(errors["calibrated"])
    return [
        HEAD,
        f"**Result: mean error over the 21 cells of Tables 2 to 4 {spread.mean():.2f} %, worst"
        f" cell {spread.max():.2f} %.**",
        "",
        *summary(errors),
        "",
        VERBATIM,
        *tables,
        WHAT_VERBATIM_SAYS,
        *readings(),
        "",
        WHAT_READINGS_SAY,
        "### Control points that nearly match the profiles",
        "",
        "The bearing cap's 4.36 peaks per mm are 98 control points on 100 profiles. Sampled as they"
        " are, they fall together and apart once in 50 profiles, and the variance of a profile"
        f" swings by ±{100 * low:.0f} % (visible as bands in figure 9, left). With the band limit"
        f" it is ±{100 * high:.1f} %.",
        "",
        CALIBRATED,
        *other_readings(),
        "",
        WINDOW,
        *pitches(),
        "",
        THREE,
        *three_figures(),
        "",
    ]


def figures_section() -> list[str]:
    """Draw the paper's figures and return what is said of them."""
    scan = door_scan()
    figure_6(scan)
    figure_7(scan)
    surfaces()
    figure_10()
    return [
        "## Figures 6 and 7: the full scan of a door",
        "",
        "2000 profiles × 4096 points, AT-C5-4090CS30-495, 0.1 m/s, 500 Hz, calibrated noise of the"
        " stamped door (`docs/paper/figure6.yaml`).",
        "",
        "![Figure 6](paper/figure-06.png)",
        "",
        "A profile through the handle's recess: none, Gaussian, Gaussian and Perlin noise of 80 µm"
        " amplitude (equation 9, unit gradients).",
        "",
        "![Figure 7](paper/figure-07.png)",
        "",
        "## Figures 9, 11, 12: image and profile",
        "",
        *[f"![Figure {n}](paper/figure-{n:02d}.png)\n" for n in (9, 11, 12)],
        KS,
    ]


def recordings_section() -> list[str]:
    """Fit the real recordings and return the comparison."""
    if not SHARED.is_dir():
        return [REAL, "*No real recordings beside this checkout: nothing was compared.*"]
    outcomes: list[Outcome] = []
    for region in REGIONS:
        start = time.perf_counter()
        outcomes.append(compare(region))
        recording(outcomes[-1])
        print(f"{region.what}: {time.perf_counter() - start:.0f} s", flush=True)
    ks, worst = shuffled(outcomes[0])
    within = [
        o.region.what
        for o in outcomes
        if np.abs(o.errors).max() <= 5.0
        and o.ks <= 0.05
        and max(np.abs(o.along_db).max(), np.abs(o.across_db).max(initial=0.0)) <= 3.0
    ]
    return [
        REAL,
        *table(outcomes),
        "",
        "Within 5 % in every figure, KS 0.05 and 3 dB: " + ("; ".join(within) or "none") + ".",
        "",
        f"The unseen half of the first recording with its own points shuffled has KS {ks:.4f} and"
        f" is off by {worst:.1f} dB in its spectra: a distribution says nothing about texture.",
        "",
        WHY,
        *[f"![{o.region.what}](paper/real-{o.region.key}.png)\n" for o in outcomes],
    ]


def main() -> None:
    """Make the page."""
    write(tables_section() + figures_section() + recordings_section())
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
