"""The commands of `flawforge`, one a file: `add_arguments(parser)` and `run(arguments)`."""
