"""The line that a pen has drawn, for rviz."""

HEIGHT = 0.001  # [m] above the paper
WIDTH = 0.0015  # [m]


class Trail:
    """Publishes visualization_msgs/Marker, latched."""

    def __init__(self, topic, frame):
        # Imported here, so that programs that only read files don't need ROS.
        from visualization_msgs.msg import Marker
        import rospy
        self._publisher = rospy.Publisher(topic, Marker, queue_size=1, latch=True)
        self._marker = Marker(type=Marker.LINE_STRIP, ns="drawing")
        self._marker.header.frame_id = frame
        self._marker.pose.orientation.w = 1.0
        self._marker.scale.x = WIDTH
        self._marker.color.b, self._marker.color.a = 0.6, 1.0

    def show(self, places):
        """places [mm]: those of the pen so far."""
        from geometry_msgs.msg import Point
        self._marker.points = [Point(x / 1000.0, y / 1000.0, HEIGHT) for x, y in places]
        self._publisher.publish(self._marker)
