"""Whatever stands in a setting, it is taken or refused in one line; never a traceback."""

import json
import os
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from odom.backend.settings import OdometrySettings
from odom.cli import app
from odom.errors import ConfigError
from odom.service.settings import Settings, load_settings
from odom.service.settings_errors import _SECTIONS, names, variable
from odom.service.settings_sources import part_settings
from odom.service.startup import warm_up
from odom.viewer import ViewerSettings
from odom.wire import Topics, WireSettings

NAMES = list(names(Settings))

numbers = st.one_of(st.integers(), st.floats(), st.sampled_from([0, -1, 10**400, 1e300, -1e300, 5e-324, 2**63]))
texts = st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0"), max_size=30)
values = st.recursive(
    st.one_of(st.none(), st.booleans(), numbers, texts, st.dates()),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(texts | numbers, inner, max_size=4)),
    max_leaves=8,
)


def said(read: Any) -> str:
    """The words with which settings are refused, empty for good ones; anything but a ConfigError comes through."""
    words = ""
    try:
        read()
    except ConfigError as error:
        words = str(error)
    assert len(words.splitlines()) < 2
    assert len(words) < 3000
    return words


@settings(max_examples=3 * settings.default.max_examples)
@given(st.sampled_from(NAMES), st.one_of(texts, values.map(lambda value: json.dumps(value, default=str))))
@example("wire.listen", "[" * 100_000)
@example("wire.zenoh", '{"a":' * 5_000)
@example("odometry.pixel_sigma_px", "1e300")
@example("odometry.pixel_sigma_px", "nan")
@example("odometry.depth_lag_prior_s", "inf")
@example("service.keyframe_points", "9" * 5000)
@example("wire.security", "5")
@example("wire.security.nothing.deep", "5")
@example("wire", "[]")
def test_any_text_in_a_variable_is_taken_or_refused_by_name(name: str, text: str) -> None:
    with patch.dict(os.environ, {variable(name): text}):
        words = said(load_settings)
        assert not words or variable(name) in words or name.rsplit(".", 1)[0] in words
        said(lambda: part_settings("wire", WireSettings, None, {}))
        said(lambda: part_settings("viewer", ViewerSettings, None, {}))


@settings(max_examples=2 * settings.default.max_examples)
@given(st.dictionaries(st.sampled_from(NAMES) | texts, values, max_size=3))
def test_any_value_in_a_file_is_taken_or_refused(tmp_path_factory: pytest.TempPathFactory, given: Any) -> None:
    file = tmp_path_factory.getbasetemp() / "fuzz.yaml"
    tree: dict[Any, Any] = {}
    for name, value in given.items():
        *sections, last = name.split(".")
        place = tree
        for section in sections:
            place = place.setdefault(section, {}) if isinstance(place.get(section, {}), dict) else {}
        place[last] = value
    file.write_text(yaml.safe_dump(tree, allow_unicode=True))
    said(lambda: load_settings(file))
    said(lambda: part_settings("wire", WireSettings, file, {}))


@settings(max_examples=2 * settings.default.max_examples)
@given(st.text(max_size=60) | st.binary(max_size=60))
@example("wire: {zenoh: &a {x: *a}}")
@example("wire: {listen: " + "[" * 1_500)
@example("{" * 500 + "}" * 500)
@example("wire: {zenoh: {a: " + "[" * 100 + "]" * 100 + "}}")
@example("a: 2001-99-99")
@example("a: " + "9" * 5000)
@example("1: 2")
@example("? [a]\n: 2")
@example("wire: 5")
@example("wire: {1: 2, ~: 3}")
@example("&a [*a]")
@example("a: !!python/object:os.system x")
def test_any_content_of_a_file_is_taken_or_refused(tmp_path_factory: pytest.TempPathFactory, content: Any) -> None:
    file = tmp_path_factory.getbasetemp() / "content.yaml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
    said(lambda: load_settings(file))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("ODOM_WIRE__LEASE_MS", "5", "ODOM_WIRE__LEASE_MS = '5': input should be greater than or equal to 200"),
        ("ODOM_ODOMETRY__PIXEL_SIGMA_PX", "1e300", "= '1e300': input should be less than or equal to 100"),
        ("ODOM_WIRE__MODE", "piar", "= 'piar': input should be 'peer', 'client' or 'router'"),
        ("ODOM_WIRE__NAME_SPACE", "x", "no such setting (did you mean wire.namespace?)"),
        ("ODOM_WIRE__LISTEN", "5", "ODOM_WIRE__LISTEN = 5: input should be a valid tuple"),
    ],
)
def test_a_refusal_gives_name_value_and_what_fits(
    monkeypatch: pytest.MonkeyPatch, name: str, text: str, words: str
) -> None:
    monkeypatch.setenv(name, text)
    assert words in said(load_settings)


@pytest.mark.parametrize(
    "text",
    ["tcp/0.0.0.0:7447,tls/rig:7448", " tcp/0.0.0.0:7447 , tls/rig:7448,", '["tcp/0.0.0.0:7447", "tls/rig:7448"]'],
)
def test_a_list_is_json_or_texts_with_commas(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str) -> None:
    monkeypatch.setenv("ODOM_WIRE__LISTEN", text)
    assert load_settings().wire.listen == ("tcp/0.0.0.0:7447", "tls/rig:7448")
    monkeypatch.delenv("ODOM_WIRE__LISTEN")
    file = tmp_path / "odom.yaml"
    file.write_text(f"wire:\n  listen: {text if text.startswith('[') else json.dumps(text)}\n")
    assert load_settings(file).wire.listen == ("tcp/0.0.0.0:7447", "tls/rig:7448")


def test_a_variable_that_is_no_setting_is_told_with_the_nearest(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("ODOM_WRIE__NAMESPACE", "ODOM_LISTEN", "ODOM_SHARED_DATA", "ODOM_LOG_LEVEL", "ODOM_VIEWER__HOST"):
        monkeypatch.setenv(name, "INFO")
    monkeypatch.setattr("odom.cli.logs.configure", lambda level, as_json: None)
    assert CliRunner().invoke(app, ["config"]).exit_code == 0
    assert [record.getMessage() for record in caplog.records] == [
        "ODOM_LISTEN is no setting and has no effect (did you mean ODOM_WIRE__LISTEN?); see `odom config`",
        "ODOM_WRIE__NAMESPACE is no setting and has no effect (did you mean ODOM_WIRE__NAMESPACE?); see `odom config`",
    ]
    assert set(_SECTIONS) == {section.upper() for section in Settings.model_fields}


def bounds(end: str) -> dict[str, float]:
    """Every number of the odometry at an end of what is taken."""
    extremes = {}
    for name, field in OdometrySettings.model_json_schema()["properties"].items():
        if field["type"] == "boolean":
            continue
        limit = (
            field["maximum" if end == "highest" else "minimum"] if end == "highest" or "minimum" in field else 1e-300
        )
        extremes[name] = limit
    return extremes


@pytest.mark.parametrize("end", ["lowest", "highest"])
def test_the_odometry_lives_with_the_ends_of_what_is_taken(end: str) -> None:
    warm_up(OdometrySettings.model_validate(bounds(end)), Topics())


@pytest.mark.parametrize("days", ["99999999", "0"])
def test_keys_are_good_for_a_century_at_most(tmp_path: Path, days: str) -> None:
    done = CliRunner().invoke(app, ["keys", str(tmp_path / "keys"), "--days", days])
    assert done.exit_code == 2
    assert not (tmp_path / "keys").exists()
