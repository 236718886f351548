"""`odom keys DIR`: a rig's own certificate authority and certificates."""

from pathlib import Path
from typing import Annotated

import typer

DEFAULT = ("router", "sensor.cam0", "odometry.cam0", "recorder", "viewer", "mocap")


def keys(
    folder: Annotated[Path, typer.Argument(help="Where the files go; an authority already there signs further ones.")],
    identities: Annotated[
        list[str] | None,
        typer.Argument(help=f"Role, with the device behind a dot where it has one. Default: {' '.join(DEFAULT)}"),
    ] = None,
    host: Annotated[
        list[str] | None, typer.Option(help="Name or address under which the router is reached; may be repeated.")
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=36500, help="How long the certificates are good for.")] = 365,
) -> None:
    """Make the certificates with which the processes of a rig know each other.

    Each host gets ca.pem and the .pem and .key of what runs there; ca.key stays where it is. Files are named
    for the identities: sensor.cam0.pem, and sensor.lab-cam0.pem for sensor.lab/cam0.

    Example: odom keys rig-keys --host rig.local --host 192.168.1.10 router sensor.cam0 odometry.cam0 viewer
    """
    from odom.wire.certificates import make_keys

    written = make_keys(folder, identities or DEFAULT, host or (), days)
    for file in written:
        typer.echo(str(file))
    if not written:
        typer.echo(f"{folder} already holds these certificates; nothing was changed")
