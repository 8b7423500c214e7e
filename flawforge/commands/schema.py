"""`flawforge schema`: the JSON Schema of a recipe, with which editors check and complete it."""

import argparse
import json
from pathlib import Path

EPILOG = """\
An editor with a YAML language server reads the schema that the first line of a recipe names:

  # yaml-language-server: $schema=flawforge-recipe.schema.json

example:
  flawforge schema --out flawforge-recipe.schema.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("--out", type=Path, metavar="JSON", help="default: standard output")


def run(arguments: argparse.Namespace) -> int:
    """Write the schema."""
    from files.whole_file import write_whole
    from pipeline.json_schema import schema

    text = json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"
    if arguments.out is None:
        print(text, end="")
    else:
        write_whole(arguments.out, text)
        print(arguments.out)
    return 0
