"""What is put is what is read from then on, whatever is read ahead meanwhile."""

from dataclasses import replace

from made_up_map import CAMERA, details, make

from odom.backend.map.saved import MapChanges
from odom.map_file.map_file import MapFile


def test_what_is_read_ahead_while_details_are_put_is_not_older_than_they(tmp_path, monkeypatch):
    make(tmp_path / "a.map", 5)
    opened = MapFile(tmp_path / "a.map", is_written=True)
    opened.begin(CAMERA)
    fewer = replace(details(2), identities=details(2).identities[:3])
    ahead, put = opened._ahead, opened._writer.put

    def read_ahead_before(step):
        def reading(values):
            ahead.ask([2])
            ahead._coming[2].result()
            step(values)

        return reading

    monkeypatch.setattr(ahead, "forget", read_ahead_before(ahead.forget))
    monkeypatch.setattr(opened._writer, "put", read_ahead_before(put))
    opened.put(MapChanges(details={2: fewer}))
    assert len(opened.fetch(2).identities) == 3
    opened.close()
