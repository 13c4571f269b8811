"""The panel's own parameters."""

from .errors import Refusal

DEFAULTS = {"driver": "stepdriver", "listen": "127.0.0.1", "port": 8137, "hosts": []}
HIGHEST_PORT = 65535


def is_text(value):
    return isinstance(value, str) and value.strip() == value != ""


CHECKS = {
    "driver": (is_text, "must be the name of a node"),
    "listen": (is_text, "must be an address or a name of this computer"),
    "port": (lambda value: type(value) is int and 0 <= value <= HIGHEST_PORT,
             f"must be an integer from 0 to {HIGHEST_PORT}"),
    "hosts": (lambda value: isinstance(value, list) and all(map(is_text, value)), "must be a list of names"),
}


def settings_of(parameters):
    """The settings by their names. Raises a Refusal that names each parameter that is wrong."""
    if not isinstance(parameters, dict):
        raise Refusal(f"the parameters are {parameters!r}, but must be a map")
    wrong = [f"{key}: there is no such parameter (parameters: {', '.join(CHECKS)})" for key in parameters
             if key not in CHECKS]
    settings = {**DEFAULTS, **parameters}
    wrong += [f"{key} is {settings[key]!r}, but {allowed}" for key, (is_right, allowed) in CHECKS.items()
              if not is_right(settings[key])]
    if wrong:
        raise Refusal("; ".join(wrong))
    return {key: settings[key] for key in CHECKS}
