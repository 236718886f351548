"""`odom keys DIR`: a rig's own certificate authority and certificates."""

from pathlib import Path
from typing import Annotated

import typer

DEFAULT = ("router", "sensor.cam0", "odometry.cam0", "recorder", "viewer", "mocap")
_DAYS = 365
"""How long certificates are good for unless it is said. Longer: a stolen one is good for longer; shorter: more work."""


def keys(
    folder: Annotated[Path, typer.Argument(help="Where the files go; an authority already there signs further ones.")],
    identities: Annotated[
        list[str] | None,
        typer.Argument(
            help="Role, with the device behind a dot where it has one. "
            f"Default: those in the folder; where none are, {' '.join(DEFAULT)}"
        ),
    ] = None,
    host: Annotated[
        list[str] | None, typer.Option(help="Name or address under which the router is reached; may be repeated.")
    ] = None,
    days: Annotated[
        int | None, typer.Option(min=1, max=36500, help="How long the certificates are good for; default 365.")
    ] = None,
) -> None:
    """Make the certificates with which the processes of a rig know each other.

    Each host gets ca.pem and the .pem and .key of what runs there; ca.key stays where it is. Files are named
    for the identities: sensor.cam0.pem, and sensor.lab-cam0.pem for sensor.lab/cam0. Those that are there stay as they
    are; exit status 1 when one of them expires in the next 30 days, lacks its key, or is for other hosts or days.
    Without identities all that are there are looked at.

    Example: odom keys rig-keys --host rig.local --host 192.168.1.10 router sensor.cam0 odometry.cam0 viewer
    """
    from shlex import join

    from odom.errors import OdomError
    from odom.wire.certificates import held, make_keys, outdated

    wanted, host = identities or held(folder) or DEFAULT, host or []
    written = make_keys(folder, wanted, host, days or _DAYS)
    for file in written:
        typer.echo(str(file))
    if old := outdated(folder, wanted, host, days):
        names = ", ".join(f"{file.name} and {file.stem}.key" for file in old.values())
        command = join(["odom", "keys", str(folder), *old])
        raise OdomError(
            f"{folder} holds certificates that expire, lack their key, or are for other hosts or days: "
            f"delete {names} to renew them with `{command}` and each --host of the rig"
        )
    if not written:
        those = ", ".join(wanted)
        typer.echo(f"{folder} already holds the certificates of {those}; nothing was changed (name others to add them)")
