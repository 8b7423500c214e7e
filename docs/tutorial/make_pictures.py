"""Make the tutorial's pictures by its own commands.

Run `python docs/tutorial/make_pictures.py` from the top of the checkout.
"""

import importlib.util
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PICTURES = ("setup.png", "scan.png")


def main() -> None:
    """Run the page's blocks and keep the pictures that they write."""
    spec = importlib.util.spec_from_file_location("blocks", HERE.parent / "site/blocks.py")
    assert spec is not None
    assert spec.loader is not None
    blocks = importlib.util.module_from_spec(spec)
    sys.modules["blocks"] = blocks
    spec.loader.exec_module(blocks)
    with tempfile.TemporaryDirectory() as folder:
        blocks.run(HERE.parent / "tutorial.md", Path(folder))
        for name in PICTURES:
            shutil.copyfile(Path(folder) / name, HERE / name)


if __name__ == "__main__":
    main()
