"""A source that ends with the reason where none of its images of colour, or of depth, could be used."""

from collections.abc import Iterator

from odom.errors import SourceError
from odom.evaluation.diagnosis import advice_on_refused
from odom.wire import Message, Topics
from sensors.source import Source, refused_images


class NeededImages:
    """The source `name`, whose `messages` end with SourceError where it gave no image of a stream and left some out."""

    def __init__(self, name: str, source: Source, topics: Topics) -> None:
        self._name, self._source = name, source
        self._images = {"colour": topics.color_keys, "depth": topics.depth_keys}
        self.lossless, self.length = source.lossless, source.length

    def messages(self) -> Iterator[Message]:
        """Yield the source's messages; raises SourceError as above, with the reason and what to do."""
        seen = set[str]()
        for message in self._source.messages():
            seen.add(message.topic)
            yield message
        for (stream, why), count in refused_images(self._source).items():
            if seen.isdisjoint(self._images[stream]):
                raise SourceError(
                    f"{self._name}: none of its {stream} images can be used, {count} of them: {why}; "
                    f"{advice_on_refused(why)}"
                )

    def close(self) -> None:
        """Close the source."""
        self._source.close()
