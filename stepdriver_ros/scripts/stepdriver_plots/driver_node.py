"""The services, actions and parameters of a running stepdriver_node. Needs ROS."""

import math
import time

import rosgraph
import rospy

from .errors import NodeError

CONNECT = 10.0  # [s] a node may take this long to advertise its services and actions
PAUSE = 0.05  # [s] between two looks at an action


class DriverNode:
    def __init__(self, name):
        if not rosgraph.is_master_online():
            raise NodeError(f"no ROS master answers at {rosgraph.get_master_uri()}: is roslaunch "
                            "running, and is ROS_MASTER_URI right?")
        self.name = rospy.resolve_name(name)
        self._proxies = {}
        self._path_action = None

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

    def follow_path(self, tell, **fields):
        """Follows a path until its end. tell: is called with the covered part, 0 to 1, from time to time.
        Returns the positions at its end. Raises NodeError if the path is refused, or if something else
        ends it."""
        if self._path_action is None:
            self._path_action = PathAction(f"{self.name}/follow_path")
        return self._path_action.follow(tell, **fields)

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


class PathAction:
    """A client of the action follow_path, through its topics."""

    def __init__(self, name):
        from stepdriver.msg import FollowPathActionFeedback, FollowPathActionGoal, FollowPathActionResult
        self._name = name
        self._id, self._result, self._progress = "", None, 0.0
        self._goals = rospy.Publisher(f"{name}/goal", FollowPathActionGoal, queue_size=1)
        self._subscribers = [
            rospy.Subscriber(f"{name}/result", FollowPathActionResult, self._end),
            rospy.Subscriber(f"{name}/feedback", FollowPathActionFeedback, self._see)]
        peers = [self._goals.get_num_connections] + [
            subscriber.get_num_connections for subscriber in self._subscribers]
        latest = time.monotonic() + CONNECT
        while not all(connections() for connections in peers):
            if time.monotonic() > latest:
                raise NodeError(f"the action {name} doesn't exist: is the node's name right?")
            time.sleep(PAUSE)

    def _end(self, message):
        if message.status.goal_id.id == self._id:
            self._result = message.result

    def _see(self, message):
        if message.status.goal_id.id == self._id:
            self._progress = message.feedback.progress

    def follow(self, tell, **fields):
        from stepdriver.msg import FollowPathActionGoal, FollowPathResult
        goal = FollowPathActionGoal()
        for name, value in fields.items():
            setattr(goal.goal, name, value)
        goal.header.stamp = rospy.Time.now()
        self._result, self._progress = None, 0.0
        self._id = goal.goal_id.id = f"{rospy.get_name()}-{time.monotonic_ns()}"
        self._goals.publish(goal)
        while self._result is None:
            if rospy.is_shutdown() or not self._goals.get_num_connections():
                raise NodeError(f"{self._name}: the node is gone")
            time.sleep(PAUSE)
            tell(self._progress)
        if self._result.end != FollowPathResult.REACHED:
            raise NodeError(f"{self._name}: {self._result.message}")
        tell(1.0)
        return self._result.position
