"""Who may connect and what each may send: TLS with certificates on both sides, user and password, rules by key.

A process that listens (the router of a rig) checks; a process that connects presents its certificate or password. The
rights of an identity follow from its name, which is the certificate's common name or the user: a role and, behind a
dot, the namespace of one device (`sensor.cam0`, `odometry.lab/cam0`); without it, of any device (`recorder`, `viewer`).
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field

from odom.errors import ConfigError
from odom.wire.optional_file import OptionalFile
from odom.wire.passwords import check_users, first_line
from odom.wire.text_list import TextList
from odom.wire.topics import TF, TRUTH_HISTORY

ROLES = ("router", "sensor", "odometry", "recorder", "viewer", "mocap")

_RECEIVE = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")
_PUBLISH = ("put", "delete")
_BE_ALIVE = ("liveliness_token",)
_ANSWER = ("declare_queryable", "reply")
_EVERYTHING = (*_PUBLISH, *_BE_ALIVE, *_RECEIVE, *_ANSWER)
"""Zenoh's kinds of messages, by what a process does with them."""

Grants = tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]


class SecuritySettings(BaseModel, frozen=True, extra="forbid"):
    """Certificates and identities, given as files so that no secret is in a command line, a log or a report."""

    certificate: OptionalFile = Field(
        None, description="this process's certificate (PEM); switches TLS on, both sides checked"
    )
    key: OptionalFile = Field(None, description="private key of the certificate (PEM)")
    ca: OptionalFile = Field(None, description="certificate of the authority that signed everybody's (PEM)")
    user: str = Field("", description="user name to present")
    password_file: OptionalFile = Field(None, description="file that holds the user's password in its first line")
    users_file: OptionalFile = Field(None, description="a listening process: who may come in, lines of user:password")
    access: TextList = Field(
        (),
        description="a listening process: who has rights, such as sensor.cam0, odometry.cam0, viewer; empty: no rules",
    )

    @property
    def tls(self) -> bool:
        """Whether links are encrypted and both sides show certificates."""
        return self.certificate is not None

    @property
    def certificates(self) -> tuple[Path, ...]:
        """The files of this process's certificate and the authority's, as far as they are given."""
        return tuple(file for file in (self.certificate, self.ca) if file is not None)


def secured(endpoints: Iterable[str], settings: SecuritySettings) -> list[str]:
    """Return the endpoints, with `tls/` in place of `tcp/` when TLS is on, so that nothing goes unencrypted."""
    return ["tls/" + e.removeprefix("tcp/") if settings.tls and e.startswith("tcp/") else e for e in endpoints]


def security_configuration(settings: SecuritySettings) -> dict[str, Any]:
    """Return the Zenoh configuration, path to value. Raises ConfigError for files that are missing or wrong."""
    configuration: dict[str, Any] = {}
    files = [file for file in (settings.certificate, settings.key, settings.ca) if file is not None]
    if len(files) not in (0, 3):
        raise ConfigError(
            "TLS needs three files: certificate, private key and the authority's certificate (--tls CERT KEY CA)"
        )
    if files:
        certificate, key, ca = map(_readable, files)
        configuration |= {
            "transport/link/tls/root_ca_certificate": ca,
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/listen_certificate": certificate,
            "transport/link/tls/listen_private_key": key,
            "transport/link/tls/connect_certificate": certificate,
            "transport/link/tls/connect_private_key": key,
            "transport/link/tls/verify_name_on_connect": True,
            "transport/link/tls/close_link_on_expiration": True,
        }
    if settings.password_file is not None and not settings.user:
        raise ConfigError(f"{settings.password_file}: give the name of the user whose password it holds (--user)")
    if settings.user:
        if settings.password_file is None:
            raise ConfigError(f"user {settings.user}: give the file that holds the password (--password-file)")
        _readable(settings.password_file)
        configuration["transport/auth/usrpwd/user"] = settings.user
        configuration["transport/auth/usrpwd/password"] = first_line(settings.password_file)
    if settings.users_file:
        configuration["transport/auth/usrpwd/dictionary_file"] = _readable(settings.users_file)
        check_users(settings.users_file)
    if settings.access:
        if not (settings.tls or settings.users_file):
            raise ConfigError("rules need identities: give --tls or a users file with them")
        configuration["access_control"] = access_rules(settings.access, by_certificate=settings.tls)
    return configuration


def _readable(file: Path) -> str:
    try:
        with file.open("rb"):
            return str(file.resolve())
    except OSError as error:
        raise ConfigError(f"{file} cannot be read: {error.strerror}") from error


def grants(identity: str) -> Grants:
    """Return what `identity` may send to the process that checks, as pairs of message kinds and key expressions.

    Raises ConfigError for a role that is unknown or lacks its namespace.
    """
    role, _, namespace = identity.partition(".")
    if role not in ROLES:
        raise ConfigError(f"identity {identity!r}: its role must be one of {', '.join(ROLES)}")
    if role in ("sensor", "odometry") and not namespace:
        raise ConfigError(f"identity {identity!r}: say for which device, such as {role}.cam0")

    def below(*names: str, device: str = namespace or "**") -> tuple[str, ...]:
        return tuple(f"{device}/{name}" for name in names)

    mocap = namespace or "mocap"
    results = (
        "odom",
        "pose",
        "chain",
        "chain/closed",
        "path",
        "path/*",
        "status",
        "loops",
        "features",
        "moving",
        "landmarks",
        "keyframes",
        "ack/odometry",
    )
    rights: dict[str, Grants] = {
        "router": ((_EVERYTHING, ("**",)),),
        "sensor": (
            (_PUBLISH, below("color/**", "depth/**", "device", "end")),
            (_BE_ALIVE, below("alive", "alive/sensor/*")),
            (_RECEIVE, below("ack/**", "alive/**")),
        ),
        "odometry": (
            (_PUBLISH, (*below(*results), TF)),
            (_BE_ALIVE, below("alive/odometry", "alive/odometry/*", "ack/odometry")),
            (_RECEIVE, (*below("**"), "truth/**")),
            (_ANSWER, (*below("**"), TRUTH_HISTORY)),
        ),
        "recorder": (
            (_PUBLISH, below("ack/recorder")),
            (_BE_ALIVE, below("alive/recorder", "ack/recorder")),
            (_RECEIVE, ("**",)),
        ),
        "viewer": ((_BE_ALIVE, below("alive/viewer")), (_RECEIVE, ("**",))),
        "mocap": (
            (_PUBLISH, ("truth/**", *below("end", device=mocap))),
            (_BE_ALIVE, below("alive", "alive/sensor/*", device=mocap)),
            (_RECEIVE, below("ack/**", "alive/**", device=mocap)),
        ),
    }
    return rights[role]


def access_rules(identities: Iterable[str], by_certificate: bool) -> Mapping[str, Any]:
    """Return Zenoh's `access_control`: whatever is not granted to an identity is refused, and strangers get nothing."""

    def rule(name: str, flow: str, messages: tuple[str, ...], keys: tuple[str, ...]) -> dict[str, Any]:
        allowed = {"flows": [flow], "messages": list(messages), "key_exprs": list(keys)}
        return {"id": name, "permission": "allow", **allowed}

    rules, subjects, policies = [rule("out", "egress", _EVERYTHING, ("**",))], [], []
    for identity in identities:
        own = [rule(f"{identity}:{i}", "ingress", *granted) for i, granted in enumerate(grants(identity))]
        rules += own
        subjects.append({"id": identity, "cert_common_names" if by_certificate else "usernames": [identity]})
        policies.append({"rules": [*(entry["id"] for entry in own), "out"], "subjects": [identity]})
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}
