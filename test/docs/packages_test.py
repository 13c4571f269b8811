#!/usr/bin/env python3
"""Checks package.xml: rosdep must know each key, and scripts/packages.txt must have its Debian package.
The Debian package of the programs must depend on each module that one of its Python programs imports.

usage: test/docs/packages_test.py

Exit code 0: they agree; 1: otherwise. The table below is from rosdep's base.yaml and python.yaml. A new
dependency needs a line here, with the package of its rule for Debian 12. A key like
libboost-program-options, whose rules end with Debian 11, is refused.
"""

import ast
import re
import sys
import xml.etree.ElementTree as xml

import pages

# rosdep's key: the package of its rule for Debian 12.
SYSTEM_KEYS = {
    "doxygen": "doxygen",
    "fmt": "libfmt-dev",
    "libboost-program-options-dev": "libboost-program-options-dev",
    "libgpiod-dev": "libgpiod-dev",
    "libncurses-dev": "libncurses-dev",
    "libsystemd-dev": "libsystemd-dev",
    "liburdfdom-dev": "liburdfdom-dev",
    "libxml2": "libxml2-dev",
    "nlohmann-json-dev": "nlohmann-json3-dev",
    "python3-aiohttp": "python3-aiohttp",
    "python3-matplotlib": "python3-matplotlib",
    "python3-shapely": "python3-shapely",
    "python3-yaml": "python3-yaml",
    "tmux": "tmux",
    "yaml-cpp": "libyaml-cpp-dev",
    "zlib": "zlib1g-dev",
}
# Packages of noetic/distribution.yaml: their names are keys.
ROS_KEYS = set(
    "actionlib actionlib_msgs catkin diagnostic_msgs diagnostic_updater geometry_msgs message_generation "
    "message_runtime nav_msgs robot_state_publisher rosbag roscpp rosgraph rosgraph_msgs roslaunch rosparam rospy "
    "rostest rviz sensor_msgs std_msgs std_srvs tf2_msgs tf2_ros trajectory_msgs visualization_msgs".split()
)
# Needed by an installed program, but rosdep has no key for them: docs/first_programs.md names them.
WITHOUT_KEY = {"librsvg2-bin", "python3-svgelements"}
# draw and the panel need them for SVG files only, only the panel needs aiohttp, and both say so. Without the
# messages of diagnostics, the panel shows no lateness.
RECOMMENDED = WITHOUT_KEY | {"python3-shapely", "python3-aiohttp", "python3-diagnostic-msgs"}
# In the Debian package itself, and one in whose place a program takes its own messages.
OWN_MODULES = {"stepdriver", "stepdriver_panel", "stepdriver_plots"}
WITH_SUBSTITUTE = {"control_msgs"}


def imported_by(program):
    for node in ast.walk(ast.parse(pages.text_of(program))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module


def python_packages_of(program):
    modules = {name.split(".")[0] for name in imported_by(program)}
    modules -= sys.stdlib_module_names | OWN_MODULES | WITH_SUBSTITUTE
    return {"python3-" + name.replace("_", "-") for name in modules}


def missing_from_control():
    stanza = re.search(r"^Package: ros-stepdriver\n(?:.+\n)+", pages.text_of("debian/control"), re.MULTILINE).group()
    depends, recommends = (
        set(re.findall(r"^ ([a-z0-9-]+)", lines, re.MULTILINE))
        for lines in re.findall(r"^(?:Depends|Recommends):\n((?: .*\n)+)", stanza, re.MULTILINE)
    )
    for package in sorted(RECOMMENDED - recommends):
        yield f"debian/control: ros-stepdriver doesn't recommend {package}"
    for program in pages.own_files():
        if not re.match(r"stepdriver_ros/scripts/(?!.*\.(?:pyc|html|css|js|svg)$)|examples/first_programs/.*\.py$", program):
            continue
        for package in sorted(python_packages_of(program) - depends - RECOMMENDED):
            yield f"debian/control: ros-stepdriver doesn't depend on {package}, which {program} needs"


def problems():
    yield from missing_from_control()
    keys = {
        element.text.strip()
        for element in xml.fromstring(pages.text_of("package.xml"))
        if element.tag.endswith("depend")
    }
    for key in sorted(keys - SYSTEM_KEYS.keys() - ROS_KEYS):
        yield f"package.xml: {key} isn't in the table of keys that rosdep knows for Debian 12"
    for key in sorted((SYSTEM_KEYS.keys() | ROS_KEYS) - keys):
        yield f"{key} is in the table of keys, but not in package.xml"
    listed = set(re.findall(r"^[a-z][^ \n]*", pages.text_of("scripts/packages.txt"), re.MULTILINE))
    for package in sorted((set(SYSTEM_KEYS.values()) | WITHOUT_KEY) - listed):
        yield f"scripts/packages.txt: {package} is missing"
    page = pages.text_of("docs/first_programs.md")
    for package in sorted(WITHOUT_KEY):
        if f"`{package}`" not in page:
            yield f"docs/first_programs.md doesn't say that rosdep has no key for {package}"


found = list(problems())
for problem in found:
    print(problem)
sys.exit(1 if found else 0)
