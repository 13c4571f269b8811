"""An open page, as the server sees it."""

import asyncio
import json
from collections import deque

from .gate import Rate

MESSAGES = (100.0, 100)  # [1/s] and at once: a jog takes 25 a second
MOST_ANSWERS = 32  # not yet sent
SEND_TIMEOUT = 5.0  # [s] for a page that takes nothing


class Viewer:
    """Sends the newest values to a page. A page that is slow misses old ones; nothing else is queued than the
    answers to its own commands."""

    def __init__(self, socket, transport, number, key):
        """number: known to all pages. key: a secret of this page, for its uploads."""
        self.socket, self.transport, self.number, self.key = socket, transport, number, key
        self.rate = Rate(*MESSAGES)
        self._answers = deque(maxlen=MOST_ANSWERS)
        self._sent = {}  # the versions of the parts that the page has
        self._wake = asyncio.Event()

    def answer(self, **fields):
        self._answers.append(fields)
        self._wake.set()

    def wake(self):
        """There is something new to send."""
        self._wake.set()

    async def send(self, newest):
        """Sends until the connection ends. newest: a function that returns the values of each update, and the
        parts: name: (version, value)."""
        while not self.socket.closed:
            await self._wake.wait()
            self._wake.clear()
            update, parts = newest()
            for name, (version, value) in parts.items():
                if self._sent.get(name) != version:
                    self._sent[name] = version
                    update[name] = value
            if self._answers:
                update["answers"] = list(self._answers)
                self._answers.clear()
            text = json.dumps(update, separators=(",", ":"), allow_nan=False)
            await asyncio.wait_for(self.socket.send_str(text), SEND_TIMEOUT)
