"""The state of the panel: its viewers, the one with control, and the calls that wait for the driver. Everything
here runs in the server's thread."""

import asyncio
import json
import math
import secrets
import time

from aiohttp import WSCloseCode

from .commands import COMMANDS, MOTIONS, axis_of, carry_out, number
from .drawing import Drawing
from .errors import Refusal
from .jog import HeldJog
from .threads import in_thread
from .viewer import Viewer

UPDATES = 20.0  # [1/s]
MOST_VIEWERS = 16
MOST_CALLS = 16  # calls of the driver at once
LINGER = 2.0  # [s] without a viewer before nothing is received any more
STOP_AGAIN = 0.2  # [s]
STOPS_AGAIN = 50
REFUSED_LOG_EVERY = 60.0  # [s]


class Panel:
    """The state of the server: its viewers, the one that has control, and what was last sent."""

    def __init__(self, machine, gate, log):
        """log: called with each text for the log."""
        self.machine, self.gate, self.log = machine, gate, log
        self.jog = HeldJog(self._publish_jog, machine.jog_timeout)
        self.drawing = Drawing(machine)
        self.viewers = []
        self.controller = None
        self._parts = {}
        self._stops = 0  # so far
        self._pending = {}  # what the driver was asked, and has not answered
        self._way = []
        self._numbers = 0
        self._jog_timer = None
        self._refused, self._refused_told = 0, -math.inf
        self._tasks = set()
        self._was_live = False
        self._watching = False

    # ---- what the viewers see

    def publish(self, name, value):
        """Sends a value to each viewer that doesn't have it yet."""
        version, old = self._parts.get(name, (0, None))
        if version == 0 or old is not value and old != value:
            self._parts[name] = (version + 1, value)

    def newest(self):
        age = self.machine.age()
        update = {"tick": round(time.monotonic(), 4), "age": round(age, 2) if age < 1e6 else None,
                  "positions": self.machine.positions(), "late": self.machine.lateness()}
        if self.drawing.shown["state"] == "drawing":
            update["way"] = self._way
        return update, self._parts

    async def _beat(self):
        """Updates the viewers, while there are any."""
        while self.viewers:
            self._look()
            for viewer in self.viewers:
                viewer.wake()
            await asyncio.sleep(1.0 / UPDATES)

    def _look(self):
        live = self.machine.live
        if live and not self._was_live:
            self.begin(self._configure())  # it may be another driver, or have other parameters
        if not live:
            self.jog.end()
        self._was_live = live
        self._way = self.machine.way(self.drawing.shown["axes"])
        self.publish_drawing()
        self.publish("states", self.machine.states())
        self.publish("io", self.machine.io())
        self.publish("chips", self.machine.chips())
        self.publish("override", self.machine.override())
        self.publish("events", list(self.machine.driver.events))
        self._publish_control()

    def _publish_control(self):
        self.publish("control", {"controller": self.controller.number if self.controller else None,
                                 "viewers": len(self.viewers)})

    def publish_drawing(self):
        self.publish("drawing", self.drawing.shown)

    async def _configure(self):
        driver = self.machine.driver
        try:
            self.machine.configure(await in_thread(driver.parameters))
            await in_thread(driver.watch_chips, [axis.name for axis in self.machine.axes.values() if axis.has_chips])
        except Exception as error:  # noqa: BLE001: the master may be gone in many ways
            driver.tell("error", f"the driver's parameters can't be read: {error}")
            self._was_live = False
            return
        self.jog.timeout = self.machine.jog_timeout
        self.publish("settings", self.machine.settings())

    def begin(self, coroutine):
        """Runs it without waiting for it."""
        task = asyncio.get_running_loop().create_task(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def end(self):
        """Ends the jog, and says goodbye to all pages."""
        self.jog.end()
        for viewer in list(self.viewers):
            await viewer.socket.close(code=WSCloseCode.GOING_AWAY)

    # ---- who may what

    def enter(self, socket, transport, was):
        """was: the key that the page had before it lost its connection. It gets its control back."""
        self._numbers += 1
        viewer = Viewer(socket, transport, self._numbers, secrets.token_urlsafe(16))
        if len(self.viewers) >= MOST_VIEWERS:
            oldest = next(other for other in self.viewers if other is not self.controller)
            self.begin(oldest.socket.close(message=b"too many pages are open"))
        self.viewers.append(viewer)
        lost = next((other for other in self.viewers if other.key == was), None)
        if lost is not None:
            self.jog.end(lost)
            self.begin(lost.socket.close())
        if self.controller in (None, lost):
            self.controller = viewer
        self._publish_control()
        if not self._watching:
            self._watching = True
            self.begin(self._watch())
        return viewer

    async def _watch(self):
        """Receives what the driver publishes while there are viewers, and a little longer: a page that is
        loaded again is a new viewer."""
        driver = self.machine.driver
        # These ask the master, which may take long to answer.
        try:
            await in_thread(driver.watch)
        except Exception as error:  # noqa: BLE001: the master may be gone in many ways
            driver.tell("error", f"the driver's topics can't be received: {error}")
        for urgent in (driver.stop, driver.emergency_stop):
            self.begin(self._quietly(urgent.connect))
        while self.viewers:
            await self._beat()
            await asyncio.sleep(LINGER)
        await self._quietly(driver.unwatch)
        self._watching = False
        if self.viewers:  # one came during that
            self._watching = True
            self.begin(self._watch())

    @staticmethod
    async def _quietly(function):
        try:
            await in_thread(function)
        except Exception:  # noqa: BLE001: the call itself will say what is wrong
            pass

    def leave(self, viewer):
        self.jog.forget(viewer)
        self.viewers.remove(viewer)
        if self.controller is viewer:
            self.controller = None

    def refuse_login(self):
        """Says that logins were refused, at most once a minute."""
        self._refused += 1
        now = time.monotonic()
        if now - self._refused_told >= REFUSED_LOG_EVERY:
            self.log(f"refused {self._refused} connection(s) without the token or from a foreign page")
            self._refused, self._refused_told = 0, now

    # ---- commands

    def take(self, viewer, text):
        """A message of a viewer."""
        try:
            message = json.loads(text)
            what, call = message["do"], message["id"]
        except (ValueError, TypeError, KeyError, RecursionError):
            return
        if not isinstance(call, int):
            return
        if what in ("stop", "emergency_stop"):
            self.jog.end()
            self._stops += 1
            self.begin(self._stop(viewer, call, getattr(self.machine.driver, what)))
            self.begin(self._stop_what_is_on_its_way(dict(self._pending)))
            return
        if not viewer.rate.take():
            viewer.answer(id=call, ok=False, text="not sent: too many messages")
            return
        try:
            if what == "take_control":
                self._take_control(viewer)
                viewer.answer(id=call, ok=True, text="this page has control")
                return
            if what == "jog_end":
                self.jog.end(viewer)
                return
            self.require_control(viewer)
            if what == "jog":
                self._press(viewer, message)
            elif isinstance(what, str) and (what == "draw" or what in COMMANDS):
                self._start(viewer, call, message)
            else:
                raise Refusal(f"there is no command {what!r}")
        except Refusal as refusal:
            viewer.answer(id=call, ok=False, text=str(refusal), jog=what == "jog")

    def require_control(self, viewer):
        if viewer is not self.controller:
            raise Refusal("nothing was sent: " + (
                "another page has control; take it over first" if self.controller else
                "no page has control; take it first"))
        if not self.machine.live:
            raise Refusal("nothing was sent: no state of the driver arrives")

    def _take_control(self, viewer):
        self.jog.end()
        if self.controller not in (None, viewer):
            self.machine.driver.tell("event", f"page {viewer.number} took control from page "
                                              f"{self.controller.number}")
        self.controller = viewer

    def _press(self, viewer, message):
        axis = axis_of(self.machine, message)
        velocity, press = number(message, "velocity") / axis.factor, number(message, "press")
        now = time.monotonic()
        if not self.jog.press(viewer, press, axis.name, velocity, number(message, "tick"), now):
            raise Refusal(f"{axis.name}: the jog ended: something stopped it, or no message came in time for "
                          f"jog_timeout, {self.machine.jog_timeout:g} s. Press again")
        self._end_jog_in_time(now)

    def _end_jog_in_time(self, now):
        if self._jog_timer is not None:
            self._jog_timer.cancel()
        self._jog_timer = asyncio.get_running_loop().call_later(
            max(0.0, self.jog.until - now), self.jog.end)

    def _publish_jog(self, axis, velocity):
        self.machine.driver.jog(axis, velocity)

    def _start(self, viewer, call, message):
        of = message.get("output" if message["do"] == "set_output" else "axis")
        name = (message["do"], of if isinstance(of, str) else None)
        shown = (f"{name[1]}: " if name[1] else "") + name[0].replace("_", " ")
        if name in self._pending:
            raise Refusal(f"{shown}: not sent again, because the driver has not answered the last one yet")
        if len(self._pending) >= MOST_CALLS:
            raise Refusal(f"{shown}: not sent, because {MOST_CALLS} calls wait for the driver")
        self._pending[name] = message
        self.begin(self._carry_out(viewer, call, message, name, shown, self._stops))

    async def _carry_out(self, viewer, call, message, name, shown, stops):
        """stops: how many there were when the message came."""
        try:
            if message["do"] == "draw":
                self.drawing.begin(message.get("version"))
                text = await in_thread(self.drawing.draw)
            else:
                text = await in_thread(carry_out, self.machine, message)
        except Refusal as refusal:
            self.machine.driver.tell("refused", f"{shown}: {refusal}")
            viewer.answer(id=call, ok=False, text=str(refusal))
        except Exception as error:  # noqa: BLE001: whatever it is, the person must be told
            viewer.answer(id=call, ok=False, text=f"{shown}: failed, for a reason of the panel: {error!r}")
            raise
        else:
            viewer.answer(id=call, ok=True, text=text)
        finally:
            del self._pending[name]
            if self._stops != stops and name[0] in MOTIONS:
                self.machine.driver.stop.call()  # the driver may have got the stop before the motion

    async def _stop_what_is_on_its_way(self, asked):
        """A motion that the driver was asked for before a stop may reach it after the stop. It is stopped too,
        even if the driver answers only at its end."""
        for _ in range(STOPS_AGAIN):
            await asyncio.sleep(STOP_AGAIN)
            if not any(name[0] in MOTIONS and self._pending.get(name) is message
                       for name, message in asked.items()):
                return
            await asyncio.wait([asyncio.wrap_future(self.machine.driver.stop.call())])

    async def _stop(self, viewer, call, urgent):
        try:
            answer = await asyncio.wrap_future(urgent.call())
        except Exception as error:  # noqa: BLE001: whatever it is, the person must be told
            text = f"THE DRIVER DID NOT ANSWER: {error}. Cut the power of the motors"
            self.machine.driver.tell("error", text)
            viewer.answer(id=call, ok=False, text=text)
            return
        viewer.answer(id=call, ok=bool(answer.success), text=answer.message)
