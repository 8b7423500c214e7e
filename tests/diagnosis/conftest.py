"""A small diagnosis, and prepared recordings, that several tests look at."""

from pathlib import Path

import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.explanation import Explanation
from diagnosis.prepare import Prepared
from diagnosis.report.outputs import write_outputs
from tests.support.diagnosis_of import diagnosis_of
from tests.support.explained import explained
from tests.support.prepared_parts import ready
from tests.support.small_parts import VIEWS, datasheet, part, record

BOW = [{"name": "line_bow", "sag_um": 40.0}]


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, Path]:
    """A bowl of which a bow is diagnosed, and the folder of its files."""
    scene, sheet = part("bowl"), datasheet(100)
    made = [
        record(scene, sheet, BOW, name=n, seed=k, profiles=60, pitch_mm=0.7, **VIEWS[k])
        for k, n in enumerate(("left", "right", "kept back"))
    ]
    result = diagnosis_of(made, scene, sheet)
    folder = tmp_path_factory.mktemp("diagnosis")
    write_outputs(result, folder, part_name="bowl")
    return result, folder


@pytest.fixture(scope="session")
def bowed() -> Prepared:
    """Domes by a line that is bowed by half of the noise, with baselines by a straight one."""
    return ready([{"name": "line_bow", "sag_um": 4.0}], 3, baselines=True)


@pytest.fixture(scope="session")
def bent() -> Prepared:
    """Domes by a line that is bowed by four times the noise."""
    return ready(BOW, 7)


@pytest.fixture(scope="session")
def found(bent: Prepared) -> Explanation:
    """What explains them: the bow."""
    return explained(bent)
