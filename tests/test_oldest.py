"""constraints/oldest.txt, which `make test-oldest` installs, is what pyproject.toml allows."""

import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

HOME = Path(__file__).resolve().parents[1]


def test_every_lower_bound_is_the_version_tested():
    project = tomllib.loads((HOME / "pyproject.toml").read_text())["project"]
    text = (HOME / "constraints" / "oldest.txt").read_text()
    pins = [Requirement(line) for line in text.splitlines() if line and line[0] != "#"]
    oldest = {
        canonicalize_name(pin.name): Version(next(iter(pin.specifier)).version) for pin in pins
    }
    wanted = [Requirement(line) for line in project["dependencies"]]
    assert set(oldest) == {canonicalize_name(one.name) for one in wanted}
    for one in wanted:
        version = oldest[canonicalize_name(one.name)]
        (bound,) = (s for s in one.specifier if s.operator == ">=")
        assert version in one.specifier, one
        low = Version(bound.version).release  # the first release under the bound that there is
        assert version.release[: len(low)] == low, (one, version)
