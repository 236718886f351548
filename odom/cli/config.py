"""`odom config`: every setting with its default and unit."""

from pathlib import Path
from typing import Annotated

import typer


def config(
    file: Annotated[Path | None, typer.Option("--config", help="YAML file of settings to show the values of.")] = None,
    as_yaml: Annotated[bool, typer.Option("--yaml", help="Print YAML, to start a file of one's own with.")] = False,
) -> None:
    """Print every setting with its value, default, unit and meaning.

    A setting is changed in a YAML file (`--config FILE` or ODOM_CONFIG) or in the environment, as in
    ODOM_WIRE__NAMESPACE=cam1.

    Example: odom config --yaml > odom.yaml
    """
    import yaml

    from odom.service.catalogue import catalogue
    from odom.service.settings import load_settings

    settings = load_settings(file)
    if as_yaml:
        typer.echo(yaml.safe_dump(settings.model_dump(mode="json"), sort_keys=False), nl=False)
        return
    for entry in catalogue(settings):
        changed = "" if entry.value == entry.default else f" (default {entry.default})"
        typer.echo(f"{entry.name:<44} {entry.value} {entry.unit}{changed}  # {entry.description}")
