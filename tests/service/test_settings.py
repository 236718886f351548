"""Settings: every one with a meaning, refused by name when wrong, environment over file over default."""

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from typer.testing import CliRunner

from odom.cli import app
from odom.cli.config import annotated, settings_list
from odom.errors import ConfigError
from odom.service.settings import Settings, load_settings


def test_every_setting_has_a_meaning_and_a_unit() -> None:
    entries = list(settings_list(Settings()))
    assert len(entries) > 20
    assert [entry.name for entry in entries if not entry.description or not entry.unit] == []


def test_environment_wins_over_file_over_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text("wire: {namespace: from_file, lease_ms: 3000}\n")
    monkeypatch.setenv("ODOM_WIRE__NAMESPACE", "from_environment")
    settings = load_settings(file)
    assert settings.wire.namespace == "from_environment"
    assert settings.wire.lease_ms == 3000
    assert settings.service.live_frames == Settings().service.live_frames


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("wire: {name_space: x}", "wire.name_space"),
        ("service: {live_frames: 0}", "service.live_frames"),
        ("wires: {}", "sections"),
        ("- 1", "sections"),
        ("a: [", "YAML"),
    ],
)
def test_a_wrong_setting_is_named(tmp_path: Path, text: str, named: str) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=named):
        load_settings(file)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("odometry: {pixel_sigma_px: 1}\nwire: {}\nodometry:\n  self_calibration: false\n", "line 3: 'odometry'"),
        ("wire:\n  lease_ms: 3000\n  lease_ms: 4000\n", "line 3: 'lease_ms'"),
    ],
)
def test_what_stands_twice_in_a_file_is_refused_with_its_line(tmp_path: Path, text: str, named: str) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=f"{file}, {named} stands twice"):
        load_settings(file)


def test_a_section_may_take_over_another_and_change_it(tmp_path: Path) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text("wire: {zenoh: {a: &a {x: 1, y: 2}, b: {<<: *a, x: 3}}}\n")
    assert load_settings(file).wire.zenoh["b"] == {"x": 3, "y": 2}


def test_a_section_may_take_over_one_that_has_taken_over_another(tmp_path: Path) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text(
        """
wire:
  zenoh:
    usual: &usual {lease: 1000, batch: 2}
    slow: {link: &slow {<<: *usual, lease: 3000}}
    slow_too: {<<: *slow}
"""
    )
    assert load_settings(file).wire.zenoh["slow_too"] == {"lease": 3000, "batch": 2}


def test_a_file_that_is_set_to_nothing_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = ("certificate", "key", "ca", "password_file", "users_file")
    for name in files:
        monkeypatch.setenv(f"ODOM_WIRE__SECURITY__{name.upper()}", "")
    monkeypatch.setenv("ODOM_SERVICE__MASK", "")
    assert load_settings() == Settings.model_construct()
    assert load_settings().service.mask is None
    assert not load_settings().wire.security.tls


@pytest.mark.parametrize("section", ["service: {mask: ''}", "wire: {security: {certificate: '', users_file: ''}}"])
def test_a_file_that_is_nothing_in_a_file_of_settings_is_none(tmp_path: Path, section: str) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text(section)
    assert load_settings(file) == Settings()


def printed(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["config", *arguments])
    assert done.exit_code == 0
    return done.output


@pytest.mark.parametrize("arguments", [[], ["--yaml"]])
def test_what_is_printed_is_a_file_of_settings(tmp_path: Path, arguments: list[str]) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text(printed(*arguments))
    assert load_settings(file) == Settings()


words = st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0\x85\u2028\u2029"), max_size=20)


@given(words, st.lists(words, max_size=3), st.dictionaries(words, words | st.integers() | st.none(), max_size=3))
@example("yes", ["# no comment", "a: b"], {"~": None})
@example("1e-6", ["a\nb", "\"'"], {"": 1})
@example(" \t", ["\ufeff", "\U0001f600\x1b"], {})
def test_any_settings_are_printed_as_they_are_typed(
    tmp_path_factory: pytest.TempPathFactory, text: str, texts: list[str], further: dict[str, str | int | None]
) -> None:
    changed = Settings.model_validate(
        {
            "odometry": {"inverse_depth_sigma": 1e-6},
            "wire": {"namespace": text, "listen": texts, "zenoh": further, "security": {"key": "/etc/a b/#1.key"}},
        }
    )
    file = tmp_path_factory.getbasetemp() / "printed.yaml"
    file.write_text("\n".join(annotated(changed)) + "\n")
    assert load_settings(file) == changed


def test_config_is_aligned_and_has_default_and_unit(tmp_path: Path) -> None:
    file = tmp_path / "odom.yaml"
    file.write_text("service: {stop_timeout_s: 5}\nwire: {listen: tcp/rig:1}\n")
    lines = printed("--config", str(file)).splitlines()
    assert len({line.index(" # ") for line in lines if "#" in line}) == 1
    assert next(line.split() for line in lines if "stop_timeout_s" in line)[:4] == ["stop_timeout_s:", "5.0", "#", "s"]
    assert any("(default 60.0)" in line for line in lines)
    assert any(
        '["tcp/rig:1"]' in line and '(default ["tcp/127.0.0.1:7447", "tcp/127.0.0.1:0"])' in line for line in lines
    )


def test_every_command_has_help_with_an_example() -> None:
    for command in app.registered_commands:
        shown = CliRunner().invoke(app, [str(command.name), "--help"])
        assert shown.exit_code == 0, command.name
        assert "Example: odom " in shown.output, command.name
