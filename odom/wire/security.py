"""Who may come in and who may say what: TLS with certificates of both sides, user and password, rules by key.

A process that listens (the router of a rig) checks; a process that connects presents its certificate or password. What
an identity may do follows from its name, which is the certificate's common name or the user: a role and, behind a dot,
the namespace it is for (`sensor.cam0`, `odometry.lab/cam0`), of any device without (`recorder`, `viewer`, `router`).
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field

from odom.errors import ConfigError
from odom.wire.topics import TRUTH_HISTORY

ROLES = ("router", "sensor", "odometry", "recorder", "viewer", "mocap")

_EVERYTHING = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
_HEAR = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")
_SAY = ("put", "delete")
_BE = ("liveliness_token",)
_ANSWER = ("declare_queryable", "reply")

Grants = tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]


class SecuritySettings(BaseModel, frozen=True, extra="forbid"):
    """Certificates and identities; all are files, so that no secret stands in a command line, a log or a report."""

    certificate: Path | None = Field(
        None, description="this process's certificate (PEM); switches TLS on, both sides checked"
    )
    key: Path | None = Field(None, description="private key of the certificate (PEM)")
    ca: Path | None = Field(None, description="certificate of the authority that signed everybody's (PEM)")
    user: str = Field("", description="user name to present")
    password_file: Path | None = Field(None, description="file that holds the user's password in its first line")
    users_file: Path | None = Field(None, description="a listening process: who may come in, lines of user:password")
    access: tuple[str, ...] = Field(
        (),
        description="a listening process: who has rights, such as sensor.cam0, odometry.cam0, viewer; empty: no rules",
    )

    @property
    def tls(self) -> bool:
        """Whether links are encrypted and both sides show certificates."""
        return self.certificate is not None


def secured(endpoints: Iterable[str], settings: SecuritySettings) -> list[str]:
    """Return the endpoints with `tls/` for `tcp/` when TLS is on: nothing goes in the clear by oversight."""
    return ["tls/" + e.removeprefix("tcp/") if settings.tls and e.startswith("tcp/") else e for e in endpoints]


def security_configuration(settings: SecuritySettings) -> dict[str, Any]:
    """Return the Zenoh configuration, path to value. Raises ConfigError for files that are missing or incomplete."""
    configuration: dict[str, Any] = {}
    files = (settings.certificate, settings.key, settings.ca)
    if any(files) and not all(files):
        raise ConfigError(
            "TLS needs three files: certificate, private key and the authority's certificate (--tls CERT KEY CA)"
        )
    if settings.certificate and settings.key and settings.ca:
        certificate, key, ca = (_readable(file) for file in (settings.certificate, settings.key, settings.ca))
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
    if settings.user:
        if settings.password_file is None:
            raise ConfigError(f"user {settings.user}: give the file that holds the password (--password-file)")
        lines = Path(_readable(settings.password_file)).read_text().splitlines()
        if not lines or not lines[0]:
            raise ConfigError(f"{settings.password_file} holds no password in its first line")
        configuration["transport/auth/usrpwd/user"] = settings.user
        configuration["transport/auth/usrpwd/password"] = lines[0]
    if settings.users_file:
        configuration["transport/auth/usrpwd/dictionary_file"] = _readable(settings.users_file)
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
    """Return what `identity` may send to the process that checks: pairs of message kinds and key expressions.

    Raises ConfigError for a role that is unknown or lacks its namespace.
    """
    role, _, namespace = identity.partition(".")
    ns = namespace or "**"
    if role not in ROLES:
        raise ConfigError(f"identity {identity!r}: its role must be one of {', '.join(ROLES)}")
    if role in ("sensor", "odometry") and not namespace:
        raise ConfigError(f"identity {identity!r}: say for which device, such as {role}.cam0")
    if role == "router":
        return ((_EVERYTHING, ("**",)),)
    if role == "sensor":
        images = (f"{ns}/color/**", f"{ns}/depth/**", f"{ns}/device", f"{ns}/end")
        return (_SAY, images), (_BE, (f"{ns}/alive",)), (_HEAR, (f"{ns}/ack/**", f"{ns}/alive/**"))
    if role == "odometry":
        results = ("odom", "pose", "path", "status", "loops", "features", "landmarks", "keyframes", "ack/odometry")
        says = (*(f"{ns}/{result}" for result in results), "tf")
        lives = (f"{ns}/alive/odometry", f"{ns}/ack/odometry")
        heard = (f"{ns}/**", "truth/**")
        return (_SAY, says), (_BE, lives), (_HEAR, heard), (_ANSWER, (f"{ns}/**", TRUTH_HISTORY))
    if role == "recorder":
        return (_SAY, (f"{ns}/ack/recorder",)), (_BE, (f"{ns}/alive/recorder", f"{ns}/ack/recorder")), (_HEAR, ("**",))
    if role == "viewer":
        return (_BE, (f"{ns}/alive/viewer",)), (_HEAR, ("**",))
    own = namespace or "mocap"
    return (_SAY, ("truth/**", f"{own}/end")), (_BE, (f"{own}/alive",)), (_HEAR, (f"{own}/ack/**", f"{own}/alive/**"))


def access_rules(identities: Iterable[str], by_certificate: bool) -> Mapping[str, Any]:
    """Return Zenoh's `access_control`: what is not granted to an identity is refused, strangers get nothing."""
    rules: list[dict[str, Any]] = [
        {"id": "out", "permission": "allow", "flows": ["egress"], "messages": list(_EVERYTHING), "key_exprs": ["**"]}
    ]
    subjects, policies = [], []
    for identity in identities:
        names = []
        for number, (messages, keys) in enumerate(grants(identity)):
            names.append(f"{identity}:{number}")
            rules.append(
                {
                    "id": names[-1],
                    "permission": "allow",
                    "flows": ["ingress"],
                    "messages": list(messages),
                    "key_exprs": list(keys),
                }
            )
        field = "cert_common_names" if by_certificate else "usernames"
        subjects.append({"id": identity, field: [identity]})
        policies.append({"rules": [*names, "out"], "subjects": [identity]})
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}
