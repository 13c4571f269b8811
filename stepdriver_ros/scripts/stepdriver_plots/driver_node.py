"""What the programs ask of a running stepdriver_node. The only part here that needs ROS."""

import math

import rosgraph
import rospy

from .errors import NodeError

CONNECT = 10.0  # [s] how long a node may take until it has its services


class DriverNode:
    def __init__(self, name):
        if not rosgraph.is_master_online():
            raise NodeError(f"no ROS master answers at {rosgraph.get_master_uri()}: is roslaunch "
                            "running, and ROS_MASTER_URI right?")
        self.name = rospy.resolve_name(name)
        self._proxies = {}

    def call(self, service, kind, **fields):
        """Calls a service below the node's name; raises NodeError where it isn't accepted."""
        full = f"{self.name}/{service}"
        try:
            if full not in self._proxies:
                rospy.wait_for_service(full, CONNECT)
                self._proxies[full] = rospy.ServiceProxy(full, kind, persistent=True)
            answer = self._proxies[full](**fields)
        except rospy.ROSException as error:
            raise NodeError(f"the service {full} isn't there: is the node called {self.name}, and "
                            f"has it such an axis? ({error})") from error
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
        """How pictures show an axis: how many of the unit in one of ROS's, and its name."""
        if self.axis_param(axis, "max_speed_mm_s") is not None:
            return 1000.0, "mm"
        if self.axis_param(axis, "max_speed_deg_s") is not None:
            return 180.0 / math.pi, "deg"
        axes = ", ".join(sorted(self.param("axes", {})))
        raise NodeError(f"{self.name} has no axis {axis}: its axes are {axes}" if axes else
                        f"the parameter {self.name}/axes has no axis; it must have {axis}. Is {self.name} the "
                        "name of the node, and does it run?")

    def wiring(self, axis):
        """Whether STEP and DIR are inverted on their lines."""
        both = bool(self.axis_param(axis, "common_anode", False))
        return [both != bool(self.axis_param(axis, f"invert/{pin}", False))
                for pin in ("step", "dir")]
