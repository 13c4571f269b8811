"""Shared by the programs that draw motions. Only driver_node.py and trail.py need ROS."""
