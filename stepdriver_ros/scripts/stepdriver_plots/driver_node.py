"""The services and parameters of a running stepdriver_node. Needs ROS."""

import math

import rosgraph
import rospy

from .errors import NodeError

CONNECT = 10.0  # [s] a node may take this long to advertise its services


class DriverNode:
    def __init__(self, name):
        if not rosgraph.is_master_online():
            raise NodeError(f"no ROS master answers at {rosgraph.get_master_uri()}: is roslaunch "
                            "running, and is ROS_MASTER_URI right?")
        self.name = rospy.resolve_name(name)
        self._proxies = {}

    def call(self, service, kind, **fields):
        """Calls a service below the node's name. Raises NodeError if the call fails or is refused."""
        full = f"{self.name}/{service}"
        try:
            if full not in self._proxies:
                rospy.wait_for_service(full, CONNECT)
                self._proxies[full] = rospy.ServiceProxy(full, kind, persistent=True)
            answer = self._proxies[full](**fields)
        except rospy.ROSException as error:
            raise NodeError(f"the service {full} doesn't exist: is the node called {self.name}, "
                            f"and does it have this axis? ({error})") from error
        except rospy.ServiceException as error:
            raise NodeError(f"the service {full} failed: {error}") from error
        if not getattr(answer, "success", True):
            raise NodeError(f"{self.name} refuses: {answer.message}")
        return answer

    def param(self, key, default=None):
        return rospy.get_param(f"{self.name}/{key}", default)

    def axis_param(self, axis, key, default=None):
        return self.param(f"axes/{axis}/{key}", default)

    def scale(self, axis):
        """The unit in which pictures show an axis: how many of it are one ROS unit, and its name."""
        if self.axis_param(axis, "max_speed_mm_s") is not None:
            return 1000.0, "mm"
        if self.axis_param(axis, "max_speed_deg_s") is not None:
            return 180.0 / math.pi, "deg"
        axes = ", ".join(sorted(self.param("axes", {})))
        raise NodeError(f"{self.name} has no axis {axis}: its axes are {axes}" if axes else
                        f"the parameter {self.name}/axes has no axis; it must have {axis}. Is {self.name} the "
                        "name of the node, and is it running?")
