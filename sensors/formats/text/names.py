"""What a column holds, by its name: positions, heights, brightness, time, counters."""

import re

ROLES: dict[str, tuple[str, ...]] = {
    "counter": (
        "index", "idx", "frame", "frames", "framenumber", "frameid", "no", "nr", "num", "row",
        "line", "profile", "profileid", "profilenumber", "scan", "id", "point", "pointid", "count",
        "counter", "sample", "column", "col", "i", "n",
    ),
    "time": ("t", "time", "timestamp", "ts", "zeit", "sec", "seconds"),
    "encoder": ("encoder", "enc", "encodervalue", "encodercount", "ticks", "pulses"),
    "brightness": (
        "intensity", "brightness", "reflectance", "reflectivity", "gray", "grey", "luminance",
        "peak", "exposure", "scalarintensity", "amplitude",
    ),
    "quality": ("quality", "snr", "width", "valid", "status", "flag", "flags", "mask"),
    "x": ("x", "lateral", "position", "distance", "length", "pos", "abscissa", "xdistance"),
    "y": ("y", "travel", "ypos", "yposition"),
    "z": ("z", "height", "depth", "range", "value", "profileheight", "totalprofile", "elevation"),
}  # fmt: skip
_ROLE_OF = {word: role for role, words in ROLES.items() for word in words}


def role_of(name: str) -> str | None:
    """Return what a column of this name holds, a key of `ROLES`, or None."""
    text = name.strip().lstrip("#%").strip().strip('"')
    # The unit goes: what follows a bracket, a slash or " in ".
    base = re.split(r"[\[(/]|\s+in\s+", text)[0].strip().lower()
    joined = re.sub(r"[^a-z]", "", base)
    if joined in _ROLE_OF:
        return _ROLE_OF[joined]
    first = re.split(r"[_\s.\-]+", base)[0]
    return _ROLE_OF.get(first)
