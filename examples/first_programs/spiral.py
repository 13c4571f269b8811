#!/usr/bin/python3
"""Follows a spiral with x and y, and makes it while they move: docs/first_programs.md."""

from math import cos, pi, sin

import rospy
from stepdriver.msg import PathSegment
from stepdriver.srv import AppendPath, FollowPath

AHEAD = 2.0  # [s] so much of the path is kept ahead of the axes


def spiral(turns, segments_per_turn=60):
    """Lines around (60, 60) mm, 2 mm wider with each turn."""
    for i in range(turns * segments_per_turn):
        turn = i / segments_per_turn
        radius = 0.002 * turn
        end = [0.06 + radius * cos(2.0 * pi * turn), 0.06 + radius * sin(2.0 * pi * turn)]
        yield PathSegment(shape=PathSegment.LINE, end=end)


def require(answer):
    if not answer.success:
        raise SystemExit(answer.message)
    return answer


rospy.init_node("spiral")
rospy.wait_for_service("/stepdriver/append_path", timeout=30.0)
follow_path = rospy.ServiceProxy("/stepdriver/follow_path", FollowPath, persistent=True)
append_path = rospy.ServiceProxy("/stepdriver/append_path", AppendPath, persistent=True)

segments = list(spiral(turns=10))
begun = require(follow_path(name=["x", "y"], segments=segments[:30], velocity=0.05, tolerance=5e-5,
                            more_follows=True))
for first in range(30, len(segments), 30):
    part = segments[first:first + 30]
    now = require(append_path(path=begun.path, segments=part, more_follows=first + 30 < len(segments)))
    print(now.message)
    if now.time_ahead > AHEAD:
        rospy.sleep(now.time_ahead - AHEAD)
