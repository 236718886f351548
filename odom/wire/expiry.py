"""Until when certificates are valid: those that are not are refused, those that soon expire are told."""

import datetime
from collections.abc import Iterator
from pathlib import Path

from cryptography import x509

from odom.errors import ConfigError

_DUE = datetime.timedelta(days=30)
"""How long before its end a certificate is to be renewed. Longer: more renewals; shorter: less time for all hosts."""
_DUE_SHARE = 0.1
"""The same as a share of the time that it is valid for, where that is less: one of a day is not due at once."""
_RENEWAL = "`odom keys FOLDER` says how to renew it"


def certificates(file: Path) -> list[x509.Certificate]:
    """Return the certificates in a file, one or more; raises ConfigError where it is damaged."""
    try:
        return x509.load_pem_x509_certificates(file.read_bytes())
    except ValueError as error:
        raise ConfigError(
            f"{file} is damaged: copy it from where it is whole, or let `odom keys` make others in an empty folder"
        ) from error


def validity(certificate: x509.Certificate, now: datetime.datetime) -> str | None:
    """Return why a certificate is not valid at the time `now` (with its zone), and what to do; None where it is."""
    if now < certificate.not_valid_before_utc:
        begins = f"{certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC"
        return f"is not valid before {begins}; is this computer's clock right?"
    if now > certificate.not_valid_after_utc:
        return f"expired on {certificate.not_valid_after_utc:%Y-%m-%d}; {_RENEWAL}"
    return None


def is_due(certificate: x509.Certificate, now: datetime.datetime) -> bool:
    """Whether a certificate has expired by the time `now` (with its zone), or will so soon that it is to be renewed."""
    lasts = certificate.not_valid_after_utc - certificate.not_valid_before_utc
    return certificate.not_valid_after_utc - now < min(_DUE, _DUE_SHARE * lasts)


def check_validity(files: tuple[Path, ...]) -> None:
    """Raise ConfigError where a process's certificate, the first file, or its authority's is damaged or not valid now.

    A file may hold several certificates: of a process's the first counts, of authorities one that is valid is enough.
    """
    now = datetime.datetime.now(datetime.UTC)
    for file, certificate in _that_count(files, now):
        if fault := validity(certificate, now):
            raise ConfigError(f"{file} {fault}")


def due(files: tuple[Path, ...]) -> Iterator[str]:
    """Yield a warning for each file of those that `check_validity` takes whose certificate is to be renewed."""
    now = datetime.datetime.now(datetime.UTC)
    for file, certificate in _that_count(files, now):
        if is_due(certificate, now):
            yield f"{file} expires on {certificate.not_valid_after_utc:%Y-%m-%d}; {_RENEWAL}"


def longest(authorities: list[x509.Certificate], now: datetime.datetime) -> x509.Certificate:
    """Return the one that is valid for longest; where none is, the one that was."""
    return max(authorities, key=lambda one: (validity(one, now) is None, one.not_valid_after_utc))


def _that_count(files: tuple[Path, ...], now: datetime.datetime) -> Iterator[tuple[Path, x509.Certificate]]:
    own, *authorities = files
    yield own, certificates(own)[0]
    for file in authorities:
        yield file, longest(certificates(file), now)
