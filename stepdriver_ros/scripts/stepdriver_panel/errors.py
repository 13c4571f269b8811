"""The reason why the panel refuses something."""


class Refusal(Exception):
    """Says what is wrong, and what is allowed, in one line for the page."""
