#!/usr/bin/python3
"""Moves the axis x to 50 mm and back: docs/first_programs.md."""

import rospy
from std_srvs.srv import SetBool
from stepdriver.srv import MoveTo

rospy.init_node("there_and_back")
rospy.wait_for_service("/stepdriver/x/move_to", timeout=30.0)
rospy.ServiceProxy("/stepdriver/x/enable", SetBool)(True)
move_to = rospy.ServiceProxy("/stepdriver/x/move_to", MoveTo)
for position in (0.05, 0.0):  # [m]
    answer = move_to(position=position, wait=True)
    print(answer.message)
    if not answer.success:
        raise SystemExit(1)
