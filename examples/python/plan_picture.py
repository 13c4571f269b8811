"""Draws the plan of a move to 100 mm into plan.svg, and moves nothing: docs/python.md."""

from pathlib import Path

from stepdriver_core import Machine

with Machine.from_file(Path(__file__).parent / "../move_axis/axis.yaml", simulated=True) as machine:
    machine["x"].enable()
    plan = machine["x"].plan(0.1)
    plan.plot().savefig("plan.svg")
    print(f"plan.svg: {plan.duration:.3f} s")
