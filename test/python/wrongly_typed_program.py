"""A program with three wrong types, which mypy must find: types_test.sh."""

from stepdriver_core import Machine

with Machine.from_file("axis.yaml") as m:
    m["x"].move_to("0.05")
    m["x"].move_to(0.05).wait().positions
    m[0].enable()
