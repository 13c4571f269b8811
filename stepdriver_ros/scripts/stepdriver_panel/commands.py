"""The commands of the page: each is one call of the driver, in its own words."""

import math

from std_srvs.srv import SetBool, Trigger

from stepdriver.srv import Home, HomeAxes, MoveTo, SetCurrent, SetOutput, SetPosition, SpeedOverride

from .errors import Refusal
from .units import in_page_units, position_text


def axis_of(machine, message):
    name = message.get("axis")
    if not isinstance(name, str) or name not in machine.axes:
        raise Refusal(f"the driver has no axis {name!r}; it has {', '.join(machine.axes) or 'none yet'}")
    return machine.axes[name]


def number(message, key):
    value = message.get(key)
    try:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    except OverflowError:  # an integer of more than 308 digits
        pass
    raise Refusal(f"{key} is {str(value)[:40]}, but must be a number")


def enable(machine, message):
    on = message.get("on") is True
    of = "" if message.get("axis") is None else f"{axis_of(machine, message).name}/"
    return machine.driver.call(f"{of}enable", SetBool, data=on).message


def home(machine, message):
    if message.get("axis") is None:
        return machine.driver.call("home", HomeAxes, wait=True).message
    axis = axis_of(machine, message)
    return machine.driver.call(f"{axis.name}/home", Home, wait=True).message


def move(machine, message):
    """By a distance, or to a position. The answer comes when the motion is accepted."""
    axis = axis_of(machine, message)
    relative = "by" in message
    position = number(message, "by" if relative else "to") / axis.factor
    return machine.driver.call(f"{axis.name}/move_to", MoveTo, position=position, relative=relative).message


def set_zero(machine, message):
    axis = axis_of(machine, message)
    answer = machine.driver.call(f"{axis.name}/set_position", SetPosition, position=0.0)
    return f"{axis.name}: this position is {position_text(answer.position * axis.factor, axis.unit)} from now on"


def set_output(machine, message):
    name = message.get("output")
    if not isinstance(name, str):
        raise Refusal(f"output is {str(name)[:40]}, but must be the name of an output")
    return machine.driver.call("set_output", SetOutput, name=name, on=message.get("on") is True).message


def set_current(machine, message):
    """Of the chips of an axis on a UART, in motion and at rest [A rms]; 0: as configured."""
    axis = axis_of(machine, message)
    return machine.driver.call(f"{axis.name}/set_current", SetCurrent, run_current=number(message, "run"),
                               hold_current=number(message, "hold")).message


def speed_override(machine, message):
    return machine.driver.call("speed_override", SpeedOverride, factor=number(message, "factor")).message


def trigger(service):
    return lambda machine, message: machine.driver.call(service, Trigger).message


COMMANDS = {
    "enable": enable,
    "home": home,
    "move": move,
    "set_zero": set_zero,
    "set_output": set_output,
    "set_current": set_current,
    "speed_override": speed_override,
    "hold": trigger("hold"),
    "resume": trigger("resume"),
    "recover": trigger("recover"),
    "dump": trigger("dump"),
}


# Those after which something moves, and the drawing.
MOTIONS = {"home", "move", "resume", "draw"}


def carry_out(machine, message):
    """Calls the driver, and returns what it says, in the units of the page. It may wait for long. Raises
    Refusal."""
    return in_page_units(COMMANDS[message["do"]](machine, message))
