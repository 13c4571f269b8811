"""The jog by press and hold: a dead man's switch across the network."""

from collections import namedtuple

Jog = namedtuple("Jog", "viewer press axis until")


class HeldJog:
    """The jog of the viewer that holds a button. It has no thread, and its times are seconds on any clock
    that never goes back.

    The page repeats its message while the button is held, and each message names the newest update that has
    reached the page. A jog lasts until jog_timeout after the server sent that update, not after the
    message came: messages that a broken network delivers late, all at once, prolong nothing. A jog that has
    ended begins again only with a new press. If this process hangs, the driver ends the jog by itself.
    """

    def __init__(self, publish, timeout):
        """publish: called with the axis and its velocity. timeout: the driver's jog_timeout [s]."""
        self._publish = publish
        self.timeout = timeout
        self._jog = None
        self._ended = {}  # for each viewer, the number of its newest press that has ended

    def press(self, viewer, press, axis, velocity, seen, now):
        """A message of the page. press: counts the presses of the page. seen: when the newest update that it
        has seen was sent. Returns whether the axis jogs."""
        if self._jog is not None and (self._jog.viewer, self._jog.press, self._jog.axis) != (viewer, press, axis):
            self.end()
        until = min(seen, now) + self.timeout
        if until <= now:
            self.end(viewer)
            self._ended[viewer] = max(press, self._ended.get(viewer, press))
        if press <= self._ended.get(viewer, press - 1):
            return False
        self._jog = Jog(viewer, press, axis, until)
        self._publish(axis, velocity)
        return True

    def end(self, viewer=None):
        """Ends the jog of a viewer, by default of any."""
        if self._jog is None or viewer not in (None, self._jog.viewer):
            return
        jog, self._jog = self._jog, None
        self._ended[jog.viewer] = jog.press
        self._publish(jog.axis, 0.0)

    def forget(self, viewer):
        """The viewer has gone."""
        self.end(viewer)
        self._ended.pop(viewer, None)

    @property
    def until(self):
        """When the jog under way ends without another message."""
        return self._jog.until if self._jog is not None else 0.0
