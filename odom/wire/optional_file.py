"""Settings that name a file, or none: an empty text is none, not the present folder that `Path("")` is."""

from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator

OptionalFile = Annotated[Path | None, BeforeValidator(lambda value: None if value == "" else value)]
"""A setting that is a file or none; `NAME=` in a file of variables and `name: ""` in YAML are none."""
