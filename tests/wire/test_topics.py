import zenoh
from hypothesis import given
from hypothesis import strategies as st

from odom.wire import TRUTH, TRUTH_HISTORY, Topics, truth, truth_history


@given(st.text())
def test_a_body_of_any_name_has_a_key_below_those_that_are_listened_to(body: str) -> None:
    for key, expression in ((truth(body), TRUTH), (truth_history(body), TRUTH_HISTORY)):
        assert zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(key))
        assert len(key.split("/")[1]) <= 64
    assert truth(truth(body).split("/")[1]) == truth(body)


def test_the_history_of_a_device_is_below_its_namespace() -> None:
    topics = Topics("rig/cam1")
    assert (topics.history, topics.odom_history) == ("rig/cam1/history", "rig/cam1/history/odom")
    assert truth_history("camera rig") == "truth/camera_rig/history"
