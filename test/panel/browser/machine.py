"""What the tests of the page need: a machine on the simulated rig with its panel, a browser, and a network
between them that can be cut."""

import os
import pathlib
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

SOURCES = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(SOURCES / "stepdriver_ros/scripts"))

BOUND = float(os.environ.get("PANEL_TEST_BOUND", 60.0))  # [s] limit of each wait: long enough for a machine under load
PAUSE = 0.05  # [s] between two looks

CONFIG = """
jog_timeout: 1.5
recorder: {folder: FOLDER/recordings, keep: 5}
outputs:
  pen: {pin: GPIO5, active_level: high, initial: off, at_fault: off}
  lamp: {pin: GPIO6, active_level: high, initial: off, at_fault: off}
  laser: {pwm: {chip: 0, channel: 0, frequency_hz: 5000.0}}
inputs:
  paper: {pin: GPIO12, active_level: high}
axes:
  x:
    driver: a4988
    joint: x_joint
    pins: {step: GPIO17, dir: GPIO27, enable: GPIO22}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 1000.0
    min_position_mm: 0.0
    max_position_mm: 200.0
    endstops:
      min: {pin: GPIO23, active_level: high}
    require_homing: false
    homing: {switch: min, seek_speed_mm_s: 50.0, latch_speed_mm_s: 5.0, pull_off_mm: 4.0,
             offset_mm: -2.0, max_travel_mm: 250.0}
  y:
    driver: tmc2209
    joint: y_joint
    pins: {step: GPIO20, dir: GPIO21, enable: GPIO16}
    tmc: {port: /dev/serial0, address: 0, sense_resistor_mohm: 110.0, run_current_a: 0.8, hold_current_a: 0.4}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 1000.0
    min_position_mm: 0.0
    max_position_mm: 150.0
"""


def wait_until(condition, what):
    """Returns what the condition returns, as soon as that is true. what: a text, or a function that makes one."""
    latest = time.monotonic() + BOUND
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > latest:
            raise AssertionError(f"{what() if callable(what) else what}: not within {BOUND:g} s")
        time.sleep(PAUSE)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Machine:
    """A node with its panel, started as a user starts them, and the same facts by ROS."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="panel_test_"))
        (self.folder / "recordings").mkdir()
        self.trace = self.folder / "trace.vcd"
        config = self.folder / "axes.yaml"
        config.write_text(CONFIG.replace("FOLDER", str(self.folder)), encoding="utf-8")
        port = free_port()
        os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1",
                          ROS_HOME=str(self.folder / "ros"))
        os.environ.pop("ROS_HOSTNAME", None)
        self.log = self.folder / "log"
        with self.log.open("w") as output:
            self._launch = subprocess.Popen(
                ["setpriv", "--pdeathsig", "TERM", "roslaunch", "--no-summary", "-p", str(port),
                 str(SOURCES / "launch/axis.launch"), f"config:={config}", f"trace:={self.trace}", "panel:=true",
                 "panel_port:=0"],
                stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
        self.link = wait_until(self._link, "the panel's link")
        self.port = int(re.search(r":(\d+)/", self.link)[1])
        self.token = self.link.partition("#")[2]
        import rospy
        from stepdriver.msg import AxisStates, IoStates
        rospy.init_node("test", anonymous=True, disable_signals=True)
        self._states, self._io = None, None
        rospy.Subscriber("/stepdriver/io_states", IoStates, self._take_io)
        rospy.Subscriber("/stepdriver/axis_states", AxisStates, self._take)
        wait_until(lambda: self._states, "the state of the axes")

    def _take(self, message):
        self._states = message

    def _take_io(self, message):
        self._io = message

    def is_on(self, output):
        """Whether an output is on, as the driver says."""
        return self._io.output_on[self._io.output_name.index(output)]

    def _link(self):
        if self._launch.poll() is not None:
            raise AssertionError(self.log.read_text(errors="replace"))
        found = re.search(r"http://\S+/#\S+", self.log.read_text(errors="replace"))
        return found and found.group()

    def state(self, axis):
        """The newest state of an axis: a name for each field of AxisStates."""
        states, number = self._states, self._states.name.index(axis)
        return {field: getattr(states, field)[number] for field in
                ("enabled", "moving", "held", "homed", "position_valid", "position", "fault", "motor", "state")}

    @property
    def override(self):
        return self._states.speed_override

    def call(self, service, kind, **fields):
        import rospy
        return rospy.ServiceProxy(f"/stepdriver/{service}", kind)(**fields)

    def rig(self):
        from stepdriver.srv import RigReport
        return self.call("rig/report", RigReport)

    def pulses(self, axis="x"):
        report = self.rig()
        number = report.name.index(axis)
        return report.pulses_forward[number] + report.pulses_backward[number]

    def last_pulse(self, axis):
        """[s] on the rig's clock."""
        from stepdriver_plots.vcd import PinTrace
        self.rig()  # which completes the trace
        return PinTrace(self.trace).counts(axis)[0][-1]

    def at_rest(self):
        wait_until(lambda: not any(self._states.moving), "the axes are at rest")

    def calm(self):
        """At rest, without a fault or a hold, enabled, at the full speed."""
        from std_srvs.srv import SetBool, Trigger
        from stepdriver.srv import SpeedOverride
        self.call("stop", Trigger)
        self.at_rest()
        self.call("recover", Trigger)
        self.call("speed_override", SpeedOverride, factor=1.0)
        for axis in ("x", "y"):
            self.call(f"{axis}/enable", SetBool, data=True)

    def panel_process(self):
        """The number of the panel's process."""
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            if any(word.endswith(b"/panel") for word in words) and os.environ["ROS_MASTER_URI"].encode() in environment:
                return int(entry.name)
        raise AssertionError("the panel doesn't run")

    def end(self):
        os.killpg(self._launch.pid, signal.SIGINT)
        try:
            self._launch.wait(BOUND)
        except subprocess.TimeoutExpired:
            os.killpg(self._launch.pid, signal.SIGKILL)


class Network(threading.Thread):
    """Passes bytes between browsers and the panel, until it is cut: then it keeps the connections, and what
    is sent waits."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self._to = port
        self._server = socket.create_server(("127.0.0.1", 0))
        # rospy's threads change the default of new sockets for a while.
        self._server.settimeout(None)
        self.port = self._server.getsockname()[1]
        self._open = threading.Event()
        self._open.set()
        self._ended = False
        self.start()

    def cut(self):
        self._open.clear()

    def mend(self):
        self._open.set()

    def end(self):
        self._ended = True
        self._open.set()
        self._server.close()

    def run(self):
        while not self._ended:
            try:
                near = self._server.accept()[0]
            except OSError:
                if self._ended:
                    return
                raise
            far = socket.create_connection(("127.0.0.1", self._to))
            for one in (near, far):
                one.settimeout(None)
            threading.Thread(target=self._pass, args=(near, far), daemon=True).start()

    def _pass(self, near, far):
        with near, far:
            while not self._ended:
                ready, _, _ = select.select([near, far], [], [], 1.0)
                self._open.wait()
                for one in ready:
                    try:
                        data = one.recv(65536)
                        (far if one is near else near).sendall(data)
                    except OSError:
                        return
                    if not data:
                        return


def browser(width=1000, height=900, dark=False, mobile=False):
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    options = webdriver.ChromeOptions()
    # Without its sandbox it runs as root, as in CI.
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu",
                     "--disable-extensions", "--no-first-run", "--hide-scrollbars"):
        options.add_argument(argument)
    options.binary_location = "/usr/bin/chromium"
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    driver.set_page_load_timeout(BOUND)
    driver.set_script_timeout(BOUND)
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile})
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [
        {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]})
    return driver


class Page:
    """A page of the panel in a browser."""

    def __init__(self, driver):
        self.driver = driver

    def open(self, link):
        # A link that differs only behind its # doesn't load the page again.
        self.driver.get("about:blank")
        self.driver.get(link)
        return self

    def open_live(self, link):
        self.open(link)
        wait_until(self.is_live, "the page shows live data")
        return self

    def text(self, name):
        return self.driver.find_element("id", name).text

    def is_live(self):
        return self.text("connection").startswith("live") and self.driver.find_elements("css selector", ".axis")

    def find(self, selector):
        return self.driver.find_element("css selector", selector)

    def click(self, selector):
        # By the script: an element may be under the bar with the stops.
        element = self.find(selector)
        self.driver.execute_script("arguments[0].scrollIntoView({block: 'center'}); arguments[0].click()", element)

    def axis(self, name, selector):
        return f'.axis[data-axis="{name}"] {selector}'

    def said(self):
        return self.text("said")

    def wait_said(self, words):
        wait_until(lambda: words in self.said(), lambda: f"the page says {words!r}; it says {self.said()!r}")

    def take_control(self):
        if self.find("#control").is_displayed():
            self.click("#take-control")
            wait_until(lambda: not self.find("#control").is_displayed(), "this page has control")

    def complaints(self):
        """What the browser's console says."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def hold(self, selector):
        """Presses the pointer on an element, and keeps it there."""
        from selenium.webdriver import ActionChains
        element = self.find(selector)
        self.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
        ActionChains(self.driver, duration=0).move_to_element(element).click_and_hold().perform()

    def release(self):
        from selenium.webdriver import ActionChains
        ActionChains(self.driver, duration=0).release().perform()

    def keys(self, *keys):
        from selenium.webdriver import ActionChains
        ActionChains(self.driver, duration=0).send_keys(*keys).perform()
