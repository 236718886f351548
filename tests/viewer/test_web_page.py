"""The web page of a viewer is its own, and whoever looks is told when it is gone."""

import socket
import urllib.request
from collections.abc import Callable, Iterator

import psutil
import pytest
from viewer_processes import Running

from odom.viewer import outputs
from odom.viewer.outputs import Outputs, open_outputs
from odom.viewer.settings import ViewerSettings


@pytest.fixture
def taken() -> Iterator[int]:
    """A port on which another viewer listens."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_page_whose_port_is_taken_by_another_viewer_meanwhile_gets_another_port(
    monkeypatch: pytest.MonkeyPatch, taken: int
) -> None:
    free_port = outputs.free_port
    ports = iter([free_port("127.0.0.1", 0), taken])  # free when they were chosen
    monkeypatch.setattr(outputs, "free_port", lambda host, *more, **taken: next(ports, 0) or free_port(host, 0))
    with open_outputs(Outputs(web=True), ViewerSettings(web_port=taken), "cam0") as opened:
        assert opened.address is not None
        assert f":{taken}/" not in opened.address
        assert b"<html" in urllib.request.urlopen(opened.address, timeout=20).read()
        assert not opened.closed


def test_a_viewer_whose_page_is_gone_says_so_and_ends(start: Callable[..., Running]) -> None:
    view = start("view", "--web", "--web-port", "0", "--data-port", "0")
    view.wait_for("showing cam0", 120)
    (page,) = psutil.Process(view.pid).children()
    page.kill()
    assert view.process.wait(60) == 1
    assert view.said("web page ended with status -9: .+; start the viewer again"), view.lines
