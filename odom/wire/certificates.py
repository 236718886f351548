"""A rig's own certificate authority and the certificates of its processes."""

import datetime
import ipaddress
import os
import re
from collections.abc import Iterable
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from odom.errors import ConfigError
from odom.wire.security import grants

_AUTHORITY = "odom authority"
_LOCAL_HOSTS = ("localhost", "127.0.0.1")
_HOST = re.compile(r"(\*\.)?[A-Za-z0-9_]([A-Za-z0-9_.-]*[A-Za-z0-9_.])?")
_AUTHORITY_LASTS = 10
"""Times that the authority's own certificate is valid for longer than those it signs, so that it can renew them."""
_CLOCKS_DIFFER = datetime.timedelta(hours=1)
"""How far a host's clock may be behind without refusing a new certificate. Longer does no harm within a rig."""


def make_keys(folder: Path, identities: Iterable[str], hosts: Iterable[str], days: int) -> tuple[Path, ...]:
    """Write `ca.pem` and, for each identity, `IDENTITY.pem` and `IDENTITY.key` into `folder`; return what was written.

    In file names the slashes of a namespace become dashes. `hosts` are the names and addresses under which listening
    processes are reached. An existing authority signs the new identities; existing certificates stay as they are. Only
    their owner may read private keys.
    Raises ConfigError, before anything is written, for an identity without a known role, a host that has no such name,
    a folder that cannot be made, or an authority that is damaged or whose private key is missing.
    """
    identities = tuple(identities)
    for identity in identities:
        grants(identity)
    names = [_alternative(host) for host in dict.fromkeys((*_LOCAL_HOSTS, *hosts))]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder} is no folder and cannot be made one: {error.strerror}; give another") from error
    written: list[Path] = []
    authority, authority_key = _authority(folder, days, written)
    for identity in identities:
        file = _file_of(folder, identity)
        if file.exists():
            continue
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = (
            _builder(identity, authority.subject, key.public_key(), days)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .add_extension(
                x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]),
                critical=False,
            )
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), critical=False
            )
            .sign(authority_key, hashes.SHA256())
        )
        written += [_write_key(file.with_name(f"{file.stem}.key"), key), _write(file, certificate)]
    return tuple(written)


def outdated(folder: Path, identities: Iterable[str], hosts: Iterable[str], days: int | None) -> list[Path]:
    """Return the certificates that are not for all `hosts`, or were made for another number of `days` (None: any)."""
    wanted = {_alternative(host) for host in hosts}
    return [
        file
        for file in (_file_of(folder, identity) for identity in identities)
        if not _is_for(_certificate(file), wanted, days)
    ]


def _is_for(certificate: x509.Certificate, hosts: set[x509.GeneralName], days: int | None) -> bool:
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    lasts = certificate.not_valid_after_utc - certificate.not_valid_before_utc - _CLOCKS_DIFFER
    return hosts <= set(names) and days in (None, lasts.days)


def _file_of(folder: Path, identity: str) -> Path:
    return folder / f"{identity.replace('/', '-')}.pem"


def _certificate(file: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(file.read_bytes())
    except ValueError as error:
        raise ConfigError(f"{file} is damaged: copy it from where it is whole, or give an empty folder") from error


def _authority(folder: Path, days: int, written: list[Path]) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    file, key_file = folder / "ca.pem", folder / "ca.key"
    if file.exists():
        if not key_file.exists():
            raise ConfigError(f"{key_file} is missing: run this where the authority was made, or give an empty folder")
        try:
            key = serialization.load_pem_private_key(key_file.read_bytes(), None)
        except (ValueError, TypeError) as error:
            raise ConfigError(
                f"{key_file} is damaged: copy it from where it is whole, or give an empty folder"
            ) from error
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise ConfigError(f"{key_file} was not made by this command")
        return _certificate(file), key
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = (
        _builder(_AUTHORITY, _name(_AUTHORITY), key.public_key(), _AUTHORITY_LASTS * days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    written += [_write_key(key_file, key), _write(file, certificate)]
    return certificate, key


def _builder(name: str, issuer: x509.Name, public: ec.EllipticCurvePublicKey, days: int) -> x509.CertificateBuilder:
    now = datetime.datetime.now(datetime.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(_name(name))
        .issuer_name(issuer)
        .public_key(public)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _CLOCKS_DIFFER)
        .not_valid_after(now + datetime.timedelta(days=days))
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _alternative(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        if not _HOST.fullmatch(host):
            raise ConfigError(
                f"--host {host!r}: give an address, or a name of letters, digits, dashes and dots (of other letters as "
                "DNS has it, xn--...)"
            ) from None
        return x509.DNSName(host)


def _write(file: Path, certificate: x509.Certificate) -> Path:
    file.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    return file


def _write_key(file: Path, key: ec.EllipticCurvePrivateKey) -> Path:
    content = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as opened:
        opened.write(content)
    return file
