"""What a router says of the clients it refuses, from lines that Zenoh 1.10.2 logged (shortened).

Whether the installed version still logs such lines is what tests/field/test_security.py checks with a real router.
"""

import pytest

from odom.wire.refused_clients import RefusedClients

ACCEPT = "2026-01-01T12:00:00.000000Z TRACE acc-0 ThreadId(06) zenoh_transport::unicast::establishment::accept: "
ACL = "2026-01-01T12:00:00.000000Z TRACE  rx-1 ThreadId(10) zenoh::net::routing::interceptor::access_control: "
CLIENT = "7178e6574cac198cccd81682d685dbde"
SUBJECT = f"{CLIENT} on Interface(lo)+Username(sensor.cam0)+Transport(Tcp)+{CLIENT}"
SYN = ACCEPT + "Establishment Accept OpenSyn: tcp/127.0.0.1:7447 => tcp/127.0.0.1:45506. Received: TransportMessage { }"


def said_of(lines: list[str], caplog: pytest.LogCaptureFixture) -> list[str]:
    clients = RefusedClients()
    for line in lines:
        clients.line(line + "\n")
    return caplog.messages


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("Recv OpenSyn. Invalid password.", "whose password is wrong"),
        ("Recv OpenSyn. Invalid user.", "whose user is not known here"),
        ("Recv InitSyn. Expected extension.", "that gives no user and password"),
    ],
)
def test_a_failed_password_names_the_host_and_the_fault(
    fault: str, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    line = f"{ACCEPT}UsrPwd extension - {fault} at usrpwd.rs:424."
    assert said_of([SYN, line], caplog) == [f"refused: a client at 127.0.0.1 {words}"]


def test_only_what_is_sent_is_refused_not_what_is_decided_ahead(caplog: pytest.LogCaptureFixture) -> None:
    ahead = [f"{ACL}ACL (ingress): caching permissions for `cam0/pose` ..."]
    for kind in ("Query", "Put", "Declare/Undeclare Subscriber", "Declare Liveliness Subscriber"):
        ahead.append(f"{ACL}{SUBJECT} is unauthorized to {kind} (ingress) on cam0/pose")
    assert said_of(ahead, caplog) == []
    clients = RefusedClients()
    cached = f"{ACL}Using cached result: {CLIENT} is unauthorized to Declare Subscriber (ingress) on cam0/pose"
    direct = f"{ACL}{SUBJECT} is unauthorized to Put (ingress) on cam0/pose"
    for line in (*ahead, cached, direct):
        clients.line(line)
    assert caplog.messages == [
        "refused: sensor.cam0 may not subscribe to cam0/pose",
        "refused: sensor.cam0 may not publish cam0/pose",
    ]


def test_the_same_again_is_logged_at_its_1st_10th_and_100th_time(caplog: pytest.LogCaptureFixture) -> None:
    said = said_of([f"{ACL}{SUBJECT} is unauthorized to Put (ingress) on cam0/pose"] * 150, caplog)
    assert [line.partition("cam0/pose")[2] for line in said] == ["", ", 10 times by now", ", 100 times by now"]


def test_a_client_of_no_known_name_is_named_by_its_address(caplog: pytest.LogCaptureFixture) -> None:
    stranger = (
        "2026-01-01T12:00:00.000000Z  INFO acc-0 ThreadId(06) zenoh::net::routing::interceptor::access_control: "
        f"{CLIENT} did not match any configured ACL subject. Default permission `Deny` will be applied on all messages"
    )
    assert said_of([SYN, stranger], caplog) == ["refused: a client at 127.0.0.1 is not among those allowed"]
