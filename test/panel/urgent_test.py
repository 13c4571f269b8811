"""Calls that stop. Needs the modules of ROS, but no master."""

import pathlib
import sys
import threading
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "stepdriver_ros/scripts"))
try:
    from stepdriver_panel import driver
except ImportError as error:
    raise unittest.SkipTest(f"not in an environment with stepdriver: {error}") from None

BOUND = 30.0  # [s]


class Service:
    """In place of rospy's proxy: each call waits until it is let go."""

    def __init__(self):
        self.calls = []
        self.came = threading.Semaphore(0)

    def __call__(self, *_, **__):
        return self.proxy

    def proxy(self):
        let_go = threading.Event()
        self.calls.append(let_go)
        self.came.release()
        if not let_go.wait(BOUND):
            raise AssertionError("not let go")
        return len(self.calls)


class UrgentCalls(unittest.TestCase):
    def setUp(self):
        self.service = Service()
        kept, driver.rospy.ServiceProxy = driver.rospy.ServiceProxy, self.service
        self.addCleanup(setattr, driver.rospy, "ServiceProxy", kept)
        self.urgent = driver.Urgent("/stop")

    def wait_for_call(self):
        self.assertTrue(self.service.came.acquire(timeout=BOUND))

    def test_another_call_follows_one_that_is_on_its_way_and_is_shared(self):
        first = self.urgent.call()
        self.wait_for_call()
        second, third = self.urgent.call(), self.urgent.call()
        self.assertIsNot(second, first)
        self.assertIs(second, third)
        self.service.calls[0].set()
        first.result(BOUND)
        self.wait_for_call()
        self.assertEqual(len(self.service.calls), 2)
        self.service.calls[1].set()
        second.result(BOUND)

    def test_one_that_hangs_holds_up_no_other_and_they_are_bounded(self):
        futures = [self.urgent.call()]
        self.wait_for_call()
        for _ in range(driver.MOST_HANGING - 1):
            futures.append(self.urgent.call())
            self.wait_for_call()
        self.assertIs(self.urgent.call(), futures[-1])
        self.assertEqual(len(self.service.calls), driver.MOST_HANGING)
        for call in self.service.calls:
            call.set()
        for future in futures:
            future.result(BOUND)
