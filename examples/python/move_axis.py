"""Moves the axis x to 50 mm and back, on the simulated rig, without ROS: docs/python.md."""

from pathlib import Path

from stepdriver_core import Machine

with Machine.from_file(Path(__file__).parent / "../move_axis/axis.yaml", simulated=True) as machine:
    x = machine["x"]
    x.enable()
    for position in (0.05, 0.0):  # [m]
        print(x.move_to(position).wait().message)
