"""Settings: every one with a meaning, refused by name when wrong, environment over file over default."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from odom.cli import app
from odom.cli.config import settings_list
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


def test_printed_yaml_is_a_file_of_settings(tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, ["config", "--yaml"])
    assert printed.exit_code == 0
    file = tmp_path / "odom.yaml"
    file.write_text(printed.output)
    assert load_settings(file) == Settings()


def test_config_prints_default_and_unit() -> None:
    printed = CliRunner().invoke(app, ["config"])
    assert "service.stop_timeout_s" in printed.output
    assert "60.0 s" in printed.output


def test_every_command_has_help_with_an_example() -> None:
    for command in app.registered_commands:
        shown = CliRunner().invoke(app, [str(command.name), "--help"])
        assert shown.exit_code == 0, command.name
        assert "Example: odom " in shown.output, command.name
