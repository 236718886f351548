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

from odom.errors import ConfigError, writing_to
from odom.wire.expiry import certificates, is_due, longest, validity
from odom.wire.security import ROLES, grants

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
    processes are reached. An existing authority signs the new identities; existing certificates stay as they are, and a
    private key without one gets one. Only their owner may read private keys. No file is ever half written.
    Raises ConfigError, before anything is written, for an identity without a known role, a host that has no such name,
    a folder that cannot be made, a private key that is damaged, or an authority that is, has expired or lacks its
    private key; OdomError for a file that cannot be written.
    """
    identities = tuple(identities)
    for identity in identities:
        grants(identity)
    names = [_alternative(host) for host in dict.fromkeys((*_LOCAL_HOSTS, *hosts))]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder} is no folder and cannot be made one: {error.strerror}; give another") from error
    for file in (_file_of(folder, identity) for identity in identities):
        if not _is_there(file) and _is_there(key_file := file.with_suffix(".key")):
            _private_key(key_file)  # refuses a damaged one
    written: list[Path] = []
    authority, authority_key = _authority(folder, days, written)
    for identity in identities:
        file = _file_of(folder, identity)
        if _is_there(file):
            continue
        key = _key_in(file.with_suffix(".key"), written)
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
        written.append(_write(file, certificate.public_bytes(serialization.Encoding.PEM)))
    return tuple(written)


def held(folder: Path) -> tuple[str, ...]:
    """Return the identities whose certificates are in `folder`; raises ConfigError for one that is damaged."""
    files = (file for file in sorted(folder.glob("*.pem")) if file.stem.partition(".")[0] in ROLES and _is_there(file))
    names = (certificates(file)[0].subject.get_attributes_for_oid(NameOID.COMMON_NAME) for file in files)
    return tuple(str(found[0].value) for found in names if found)


def outdated(folder: Path, identities: Iterable[str], hosts: Iterable[str], days: int | None) -> dict[str, Path]:
    """Return the certificates that are to be renewed, by identity.

    They have expired or soon will, lack their private key, are not for all `hosts`, or were made for another number of
    `days` (None: any).
    """
    wanted, now = {_alternative(host) for host in hosts}, datetime.datetime.now(datetime.UTC)
    files = {identity: _file_of(folder, identity) for identity in identities}
    return {
        identity: file
        for identity, file in files.items()
        if is_due(certificate := certificates(file)[0], now)
        or not _is_there(file.with_suffix(".key"))
        or not _is_for(certificate, wanted, days)
    }


def _is_for(certificate: x509.Certificate, hosts: set[x509.GeneralName], days: int | None) -> bool:
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    lasts = certificate.not_valid_after_utc - certificate.not_valid_before_utc - _CLOCKS_DIFFER
    return hosts <= set(names) and days in (None, lasts.days)


def _file_of(folder: Path, identity: str) -> Path:
    return folder / f"{identity.replace('/', '-')}.pem"


def _authority(folder: Path, days: int, written: list[Path]) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    file, key_file = folder / "ca.pem", folder / "ca.key"
    if _is_there(file):
        if not key_file.exists():
            raise ConfigError(f"{key_file} is missing: run this where the authority was made, or give an empty folder")
        now = datetime.datetime.now(datetime.UTC)
        certificate = longest(certificates(file), now)
        if is_due(certificate, now):
            ends = f"{certificate.not_valid_after_utc:%Y-%m-%d}"
            raise ConfigError(f"{file} expires on {ends}: delete it to renew it, and give each host the new one")
        if fault := validity(certificate, now):
            raise ConfigError(f"{file} {fault}")
        return certificate, _private_key(key_file)
    key = _key_in(key_file, written)
    certificate = (
        _builder(_AUTHORITY, _name(_AUTHORITY), key.public_key(), _AUTHORITY_LASTS * days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    written.append(_write(file, certificate.public_bytes(serialization.Encoding.PEM)))
    return certificate, key


def _private_key(file: Path) -> ec.EllipticCurvePrivateKey:
    try:
        key = serialization.load_pem_private_key(file.read_bytes(), None)
    except (ValueError, TypeError) as error:
        raise ConfigError(f"{file} is damaged: copy it from where it is whole, or give an empty folder") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ConfigError(f"{file} was not made by this command")
    return key


def _key_in(file: Path, written: list[Path]) -> ec.EllipticCurvePrivateKey:
    """Return the private key in a file, a new one where there is none."""
    if _is_there(file):
        return _private_key(file)
    key = ec.generate_private_key(ec.SECP256R1())
    form = serialization.PrivateFormat.PKCS8
    content = key.private_bytes(serialization.Encoding.PEM, form, serialization.NoEncryption())
    written.append(_write(file, content, 0o600))
    return key


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


def _is_there(file: Path) -> bool:
    return file.exists() and file.stat().st_size > 0


def _write(file: Path, content: bytes, mode: int = 0o666) -> Path:
    """Write a file, which is whole or as it was."""
    part = file.with_name(f"{file.name}.part")
    with writing_to(file):
        part.unlink(missing_ok=True)
        try:
            with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as opened:
                opened.write(content)
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)
    return file
