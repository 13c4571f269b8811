"""What the programs that draw motions share; none of it needs ROS."""
