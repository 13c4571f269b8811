"""The files of the driver's flight recorder. No other file is shown or opened."""

import os
import re
import stat

from .errors import Refusal

MOST_SHOWN = 100


def default_folder():
    """The driver's default: it has the same environment if the same launch started both."""
    if os.environ.get("ROS_HOME", "").startswith("/"):
        return os.path.join(os.environ["ROS_HOME"], "stepdriver")
    return os.path.join(os.environ.get("HOME", "/tmp"), ".ros/stepdriver")


class Recordings:
    def __init__(self, folder, driver):
        """driver: its full name, `/lab/stepdriver`, with which the names of its files begin."""
        self._folder = folder or default_folder()
        prefix = re.sub(r"[^A-Za-z0-9]", "_", driver.lstrip("/"))
        self._name = re.compile(rf"{re.escape(prefix)}_[0-9]{{8}}-[0-9]{{6}}_[0-9]{{1,20}}\.(?:vcd|txt)")

    def shown(self):
        """Name and size [bytes] of each file, the newest first."""
        found = []
        try:
            with os.scandir(self._folder) as entries:
                for entry in entries:
                    if self._name.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                        found.append((entry.stat(follow_symlinks=False).st_mtime, entry.name,
                                      entry.stat(follow_symlinks=False).st_size))
        except FileNotFoundError:
            return []
        except OSError as error:
            raise Refusal(f"the recordings can't be read: {error.strerror}") from error
        found.sort(reverse=True)
        return [{"name": name, "size": size} for _, name, size in found[:MOST_SHOWN]]

    def open(self, name):
        """The file, and its size. Raises Refusal if it is none of the recordings."""
        if not self._name.fullmatch(name):
            raise Refusal("there is no such recording")
        try:
            number = os.open(os.path.join(self._folder, name), os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except OSError as error:
            raise Refusal(f"the recording can't be read: {error.strerror}") from error
        status = os.fstat(number)
        if not stat.S_ISREG(status.st_mode):
            os.close(number)
            raise Refusal("there is no such recording")
        return os.fdopen(number, "rb"), status.st_size
