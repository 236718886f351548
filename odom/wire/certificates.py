"""A rig's own certificate authority and the certificates of its processes."""

import datetime
import ipaddress
import os
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
_AUTHORITY_LASTS = 10
"""Times that the authority's own certificate is valid for longer than those it signs, so that it can renew them."""
_CLOCKS_DIFFER = datetime.timedelta(hours=1)
"""How far a host's clock may be behind without refusing a new certificate. Longer does no harm within a rig."""


def make_keys(folder: Path, identities: Iterable[str], hosts: Iterable[str], days: int) -> tuple[Path, ...]:
    """Write `ca.pem` and, for each identity, `IDENTITY.pem` and `IDENTITY.key` into `folder`; return what was written.

    In file names the slashes of a namespace become dashes. `hosts` are the names and addresses under which listening
    processes are reached. An existing authority signs the new identities; existing certificates stay as they are. Only
    their owner may read private keys.
    Raises ConfigError for an identity without a known role, or an authority whose private key is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    identities = tuple(identities)
    for identity in identities:
        grants(identity)
    written: list[Path] = []
    authority, authority_key = _authority(folder, days, written)
    for identity in identities:
        name = identity.replace("/", "-")
        file = folder / f"{name}.pem"
        if file.exists():
            continue
        key = ec.generate_private_key(ec.SECP256R1())
        names = [_alternative(host) for host in dict.fromkeys((*_LOCAL_HOSTS, *hosts))]
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
        written += [_write_key(folder / f"{name}.key", key), _write(file, certificate)]
    return tuple(written)


def _authority(folder: Path, days: int, written: list[Path]) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    file, key_file = folder / "ca.pem", folder / "ca.key"
    if file.exists():
        if not key_file.exists():
            raise ConfigError(f"{key_file} is missing: run this where the authority was made, or give an empty folder")
        key = serialization.load_pem_private_key(key_file.read_bytes(), None)
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise ConfigError(f"{key_file} was not made by this command")
        return x509.load_pem_x509_certificate(file.read_bytes()), key
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
