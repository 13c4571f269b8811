"""A program whose types mypy accepts: types_test.sh."""

from typing import Dict, Optional

from stepdriver_core import AxisState, Machine, MoveEnd, MoveResult, Refused, arc_through


def move_there(machine: Machine, position: float) -> Optional[MoveResult]:
    try:
        return machine["x"].move_to(position, velocity=0.05).wait(10.0, check=False)
    except Refused as refused:
        print(str(refused))
        return None


with Machine.from_file("axis.yaml", simulated=True) as m:
    result = move_there(m, 0.05)
    ok: bool = result is not None and result.end is MoveEnd.REACHED
    states: Dict[str, AxisState] = m.states
    m.follow_path(["x", "y"], [(0.1, 0.1), arc_through((0.2, 0.1), (0.15, 0.15))]).wait()
    m["x"].plan(0.1).plot().savefig("plan.svg")
