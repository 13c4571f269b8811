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
        self._trajectory_action = None

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

    def place_of(self, axis):
        """The answer of the service plan for a move to where an axis is: its position and its scale."""
        from stepdriver.srv import Plan
        return self.call(f"{axis}/plan", Plan, relative=True, position=0.0)

    def follow_path(self, tell, **fields):
        """Follows a path until its end. tell: is called with the covered part, 0 to 1, from time to time.
        Returns the positions at its end. Raises NodeError if the path is refused, or if something else
        ends it."""
        if self._path_action is None:
            self._path_action = PathAction(f"{self.name}/follow_path")
        return self._path_action.follow(tell, **fields)

    @staticmethod
    def join(name):
        """Makes this program a node, which topics need."""
        rospy.init_node(name, anonymous=True, disable_signals=True)

    def follow_trajectory(self, joint, points):
        """Moves a joint along points (time [s], position, velocity) until its end, from time 0 on. Raises
        NodeError if the trajectory is refused, or if something else ends it."""
        if self._trajectory_action is None:
            self._trajectory_action = TrajectoryAction(f"{self.name}/follow_joint_trajectory")
        self._trajectory_action.follow(joint, points)

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


class Action:
    """A client of an action, through its topics."""

    def __init__(self, name, goal, result, feedback):
        self._name, self._goal = name, goal
        self._id, self._result, self._feedback = "", None, None
        self._goals = rospy.Publisher(f"{name}/goal", goal, queue_size=1)
        self._subscribers = [rospy.Subscriber(f"{name}/result", result, self._end),
                             rospy.Subscriber(f"{name}/feedback", feedback, self._see)]
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
            self._feedback = message.feedback

    def run(self, fields, look=lambda feedback: None):
        """Sends a goal, and returns its result. look: is called with the last feedback from time to time."""
        goal = self._goal()
        for name, value in fields.items():
            setattr(goal.goal, name, value)
        goal.header.stamp = rospy.Time.now()
        self._result, self._feedback = None, None
        self._id = goal.goal_id.id = f"{rospy.get_name()}-{time.monotonic_ns()}"
        self._goals.publish(goal)
        while self._result is None:
            if rospy.is_shutdown() or not self._goals.get_num_connections():
                raise NodeError(f"{self._name}: the node is gone")
            time.sleep(PAUSE)
            if self._feedback is not None:
                look(self._feedback)
        return self._result


class PathAction:
    """A client of the action follow_path."""

    def __init__(self, name):
        from stepdriver.msg import FollowPathActionFeedback, FollowPathActionGoal, FollowPathActionResult
        self._name = name
        self._action = Action(name, FollowPathActionGoal, FollowPathActionResult,
                              FollowPathActionFeedback)

    def follow(self, tell, **fields):
        from stepdriver.msg import FollowPathResult
        result = self._action.run(fields, lambda feedback: tell(feedback.progress))
        if result.end != FollowPathResult.REACHED:
            raise NodeError(f"{self._name}: {result.message}")
        tell(1.0)
        return result.position


class TrajectoryAction:
    """A client of the action follow_joint_trajectory."""

    def __init__(self, name):
        try:
            import control_msgs.msg as messages
        except ImportError:  # the node has its own messages then, which are the same
            import stepdriver.msg as messages
        self._name = name
        self._action = Action(name, messages.FollowJointTrajectoryActionGoal,
                              messages.FollowJointTrajectoryActionResult,
                              messages.FollowJointTrajectoryActionFeedback)

    def follow(self, joint, points):
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
        trajectory = JointTrajectory(joint_names=[joint])
        for at, position, velocity in points:
            point = JointTrajectoryPoint(positions=[position], velocities=[velocity])
            point.time_from_start = rospy.Duration.from_sec(at)
            trajectory.points.append(point)
        result = self._action.run({"trajectory": trajectory})
        if result.error_code != 0:
            raise NodeError(f"{self._name}: {result.error_string}")


class Accelerometer:
    """The samples of a sensor_msgs/Imu in one direction."""

    def __init__(self, topic, direction):
        from sensor_msgs.msg import Imu
        self.topic = rospy.resolve_name(topic)
        self._direction = direction
        self._samples = []
        self._subscriber = rospy.Subscriber(topic, Imu, self._take, queue_size=1000)
        latest = time.monotonic() + CONNECT
        while not self._samples:
            if time.monotonic() > latest:
                raise NodeError(f"{self.topic}: no sensor_msgs/Imu has come in {CONNECT:g} s")
            time.sleep(PAUSE)

    def _take(self, message):
        self._samples.append((message.header.stamp.to_sec(),
                              getattr(message.linear_acceleration, self._direction)))

    @staticmethod
    def now():
        """[s] in the time of the samples' stamps."""
        return rospy.Time.now().to_sec()

    def between(self, begin, end):
        """Times and accelerations. Forgets them, and all before."""
        samples = self._samples
        self._samples = [sample for sample in samples if sample[0] > end]
        wanted = [sample for sample in samples if begin <= sample[0] <= end]
        return [time for time, _ in wanted], [value for _, value in wanted]


class LoadOfDriver:
    """What the driver chips of an axis measure of their load in a motion."""

    def __init__(self, topic):
        from stepdriver.msg import DriverState
        self._samples = []
        self._last = None
        self._newest = None
        self._subscriber = rospy.Subscriber(topic, DriverState, self._take, queue_size=100)
        latest = time.monotonic() + CONNECT
        while self._newest is None:
            if time.monotonic() > latest:
                raise NodeError(f"{topic}: no stepdriver/DriverState has come in {CONNECT:g} s")
            time.sleep(PAUSE)

    def _take(self, message):
        self._newest = message
        measured = [values for values in zip(message.sg_position, message.sg_velocity, message.sg_result)
                    if values[2] >= 0]
        if not measured or measured == self._last:  # the chip was asked for something else
            return
        self._last = measured
        self._samples.append(min(measured, key=lambda values: values[2]))  # the motor with the highest load

    def begin(self):
        """Forgets all samples."""
        self._samples = []

    def end(self):
        """Positions, velocities and values of SG_RESULT since begin()."""
        return list(self._samples)
