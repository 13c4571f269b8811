"""The driver, as the panel sees it. Needs ROS.

rospy calls the subscribers in threads of its own: they only keep the newest message. The server's thread
reads it when it needs it, and never waits for ROS: calls of services run in threads.
"""

import math
import threading
import time
from collections import deque
from concurrent.futures import Future, wait

import rospy
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from stepdriver.msg import AxisStates, DriverState, Endstops, IoStates, Jog

from .errors import Refusal
from .units import UNITS, in_page_units

EVENTS = 50  # kept
JOINT_STATES = 64  # at most between two updates
PATIENCE = 1.0  # [s] for the answer of an urgent call, before the next one is sent on another connection
MOST_HANGING = 4  # urgent calls without an answer
ENGINE = "pulse engine"
LATENESS = "lateness in the last second max [us]"
LEVELS = {Log.WARN: "warning", Log.ERROR: "error", Log.FATAL: "error"}


class Newest:
    """The newest message of a topic, and when it came; also the latest ones before it that nobody has taken."""

    def __init__(self, most=1):
        """most: messages that are kept."""
        self.message, self.at = None, -math.inf
        self._kept = deque(maxlen=most)

    def take(self, message):
        self.message, self.at = message, time.monotonic()
        self._kept.append(message)

    def taken(self):
        """The kept messages, which are then forgotten."""
        messages = []
        while self._kept:
            messages.append(self._kept.popleft())
        return messages


class Urgent:
    """A service that only stops, on a connection that stays open: new ones need the ROS master. A call that is
    on its way may have reached the driver before what its caller wants to stop, and another one follows it. All
    callers that come meanwhile share the answer of that one."""

    def __init__(self, service):
        self._service = service
        self._lock = threading.Lock()
        self._idle = []  # proxies
        self._last, self._next = None, None  # the newest call that was sent, and the one that follows it
        self._open = 0

    def call(self):
        """A Future of the service's answer."""
        with self._lock:
            if self._next is not None:
                return self._next
            before = self._last if self._last is not None and not self._last.done() else None
            if self._open >= MOST_HANGING:
                return before
            future = Future()
            if before is None:
                self._last = future
            else:
                self._next = future
            self._open += 1
            threading.Thread(target=self._run, args=(future, before), daemon=True).start()
            return future

    def connect(self):
        """Opens the connection ahead of the first call. It may wait: call it in a thread."""
        proxy = rospy.ServiceProxy(self._service, Trigger, persistent=True)
        proxy.wait_for_service(timeout=PATIENCE)
        with self._lock:
            self._idle.append(proxy)

    def _run(self, future, before):
        if before is not None:
            wait([before], PATIENCE)
            with self._lock:
                self._last, self._next = future, None
        try:
            future.set_result(self._answer())
        except Exception as error:  # noqa: BLE001: whatever it is, the caller must be told
            future.set_exception(error)
        finally:
            with self._lock:
                self._open -= 1

    def _answer(self):
        with self._lock:
            proxy = self._idle.pop() if self._idle else None
        if proxy is not None:
            try:
                return self._asked(proxy)
            except rospy.ServiceException:
                pass  # the driver has closed an old connection, or is another one: a stop may be repeated
        return self._asked(rospy.ServiceProxy(self._service, Trigger, persistent=True))

    def _asked(self, proxy):
        answer = proxy()
        with self._lock:
            if not self._idle:
                self._idle.append(proxy)
        return answer


class Driver:
    def __init__(self, name):
        self.name = rospy.resolve_name(name)
        self.stop = Urgent(f"{self.name}/stop")
        self.emergency_stop = Urgent(f"{self.name}/emergency_stop")
        self.events = deque(maxlen=EVENTS)
        self.states, self.endstops, self.joints, self.engine = Newest(), Newest(), Newest(JOINT_STATES), Newest()
        self.io = Newest()  # of pairs: IoStates, and what to add to its stamps to get monotonic time [s]
        self._jog = rospy.Publisher(f"{self.name}/jog", Jog, queue_size=1, tcp_nodelay=True)
        self.chips = {}  # by axis with driver chips on a UART: the Newest of what they say
        self._watched, self._chip_subscribers = None, []  # the subscribers, while there are viewers
        self._lock = threading.Lock()
        # Always, so that a page shows what happened before it was opened; it is rare.
        self._log = rospy.Subscriber("/rosout", Log, self._take_log)

    def watch(self):
        """Subscribes to what the page shows. Without a viewer, nothing is received."""
        with self._lock:
            self._watched = self._subscribed()
            self._watch_chips()

    def watch_chips(self, axes):
        """The axes whose chips are on a UART. It may wait for the master: call it in a thread."""
        with self._lock:
            self.chips = {axis: Newest() for axis in axes}
            self._watch_chips()

    def _watch_chips(self):
        if self._watched is None:
            return
        for subscriber in self._chip_subscribers:
            subscriber.unregister()
        self._chip_subscribers = [
            rospy.Subscriber(f"{self.name}/{axis}/driver", DriverState, newest.take) for axis, newest in self.chips.items()]

    def _subscribed(self):
        space = rospy.names.namespace(self.name)
        subscribers = [
            rospy.Subscriber(f"{self.name}/axis_states", AxisStates, self.states.take),
            rospy.Subscriber(f"{self.name}/endstops", Endstops, self.endstops.take),
            rospy.Subscriber(f"{self.name}/io_states", IoStates, self._take_io),
            rospy.Subscriber(f"{space}joint_states", JointState, self.joints.take)]
        try:
            from diagnostic_msgs.msg import DiagnosticArray
        except ImportError:  # then the node doesn't publish them
            return subscribers
        return [*subscribers, rospy.Subscriber("/diagnostics", DiagnosticArray, self._take_diagnostics)]

    def unwatch(self):
        with self._lock:
            subscribers = [*(self._watched or []), *self._chip_subscribers]
            self._watched, self._chip_subscribers = None, []
        for subscriber in subscribers:
            subscriber.unregister()

    def jog(self, axis, velocity):
        """velocity: [m/s|rad/s]; 0 ends the jog."""
        message = Jog(name=[axis], velocity=[velocity])
        message.header.stamp = rospy.Time.now()
        self._jog.publish(message)

    def tell(self, level, text):
        """Adds an event to those that the page lists."""
        self.events.append({"time": time.time(), "level": level, "text": text})

    def call(self, service, kind, **fields):
        """Calls a service below the driver's name, and returns its answer; it may wait for long. Raises a
        Refusal with the driver's words if the call is refused or fails."""
        full = f"{self.name}/{service}"
        try:
            answer = rospy.ServiceProxy(full, kind)(**fields)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise Refusal(f"the driver can't be reached: {error}") from error
        if not answer.success:
            raise Refusal(in_page_units(answer.message))
        return answer

    def parameters(self):
        """The driver's parameters. It waits for the master: call it in a thread."""
        return rospy.get_param(self.name, {})

    def _take_log(self, message):
        if message.name == self.name and message.level in LEVELS:
            self.tell(LEVELS[message.level], in_page_units(message.msg))

    def _take_io(self, message):
        self.io.take((message, time.monotonic() - rospy.get_time()))

    def _take_diagnostics(self, message):
        own = f"{self.name.rpartition('/')[2]}: {ENGINE}"
        for status in message.status:
            if status.name == own:
                self.engine.take({value.key: value.value for value in status.values})


class Axis:
    """What the page has to know of an axis, from the driver's parameters."""

    def __init__(self, name, parameters):
        self.name = name
        linear = "max_speed_mm_s" in parameters
        self.factor, self.unit = UNITS["m" if linear else "rad"]  # how many of the page's units are one of the driver's
        key = "mm" if linear else "deg"
        self.joint = parameters.get("joint", name)
        self.limits = tuple(parameters.get(f"{end}_position_{key}") for end in ("min", "max"))
        self.max_speed = parameters.get(f"max_speed_{key}_s", 0.0)
        self.has_homing = "homing" in parameters
        self.switches = {end: end in parameters.get("endstops", {}) for end in ("min", "max")}
        self.has_chips = any("tmc" in part for part in (parameters, *parameters.get("motors", {}).values()))

    def shown(self):
        return {"name": self.name, "unit": self.unit, "min": self.limits[0], "max": self.limits[1],
                "maxSpeed": self.max_speed, "homing": self.has_homing, "switches": self.switches, "chips": self.has_chips}
