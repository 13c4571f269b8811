#!/usr/bin/env python3
"""Compares docs/interfaces.md with running nodes: two_axes.launch and joystick.launch.

usage: test/docs/interfaces_test.py

Compares names, types, fields and latching, in both directions, and the services with what
stepdriver_node --help names. Exit code 0: they agree; 1: otherwise.
"""

import re
import subprocess
import sys

import roslib.message
import rosgraph
import rosservice
import rospy

import pages

NODE = "/stepdriver"
PAGE = "docs/interfaces.md"
# Interfaces that every roscpp node has, and those of other nodes of the launch files.
OF_ROS = r".*/(get_loggers|set_logger_level)|/rosout(_agg)?|/tf(_static)?"


def rows(heading):
    [table] = [table for under, table in pages.tables(pages.text_of(PAGE)) if under == heading]
    return table[1:]


def full_name(name, axis):
    name = name.split("`")[1]
    if name.startswith("/"):
        return name
    return f"{NODE}/" + re.sub(r"(^|/)x/", rf"\g<1>{axis}/", name)


def on_page(heading, axes=("x", "r")):
    """The cells of each row, by the full names that the row describes."""
    return {full_name(row[0], axis): row for row in rows(heading) for axis in axes}


def fields_in(text):
    return set(re.findall(r"`(\w+)`", text))


def compare(what, there, said):
    for name in sorted(there.keys() - said.keys()):
        yield f"{what} {name} isn't on the page"
    for name in sorted(said.keys() - there.keys()):
        yield f"{what} {name} is on the page and isn't there"
    for name in sorted(there.keys() & said.keys()):
        if there[name] != said[name]:
            yield f"{what} {name} is {there[name]}, and on the page {said[name]}"


def services(running):
    said = on_page("Services")
    # An axis without homing and without switches doesn't have these.
    for name in ("r/home", "rig/r/press_min", "rig/r/press_max"):
        if f"{NODE}/{name}" not in running:
            said.pop(f"{NODE}/{name}")
    types = {name: rosservice.get_service_type(name) for name in running}
    yield from compare("service", types, {name: row[1] for name, row in said.items()})
    for name in sorted(types.keys() & said.keys()):
        service = roslib.message.get_service_class(types[name])
        asked, _, answered = said[name][2].partition("→")
        same = answered.strip() == "the same"
        for where, text, message in (
            ("asks for", asked, service._request_class),
            ("answers with", asked if same else answered, service._response_class),
        ):
            fields = set(message.__slots__) - {"success", "message"}
            if fields != fields_in(text):
                yield f"{name} {where} {sorted(fields)}, and on the page {sorted(fields_in(text))}"


def helped(running):
    text = subprocess.run(
        ["rosrun", "stepdriver", "stepdriver_node", "--help"], check=True, capture_output=True, text=True
    ).stdout
    named = set(re.findall(r"~[\w/]+", text))
    for name in sorted(running):
        short = "~" + re.sub(r"(^|/)[xr]/", r"\1AXIS/", name[len(NODE) + 1:])
        if short not in named:
            yield f"stepdriver_node --help doesn't name {short}"


def actions(topics):
    """Returns the differences of the actions, and removes their topics from `topics`."""
    there = {}
    for name, of_type in list(topics.items()):
        if name.endswith("/goal") and of_type.endswith("ActionGoal"):
            there[name[: -len("/goal")]] = of_type[: -len("ActionGoal")]
    for action in there:
        for part in ("goal", "cancel", "status", "feedback", "result"):
            topics.pop(f"{action}/{part}")
    said = on_page("Actions")
    if f"{NODE}/r/homing" not in there:
        said.pop(f"{NODE}/r/homing")
    wrong = list(compare(
        "action",
        # Debian has no control_msgs: the node's own action is the same on the wire.
        {
            name: of_type.replace("stepdriver/FollowJoint", "control_msgs/FollowJoint")
            for name, of_type in there.items()
        },
        {name: row[1] for name, row in said.items()},
    ))
    for name in sorted(there.keys() & said.keys()):
        goal, _, rest = said[name][2].partition("→")
        result, _, feedback = rest.partition(";")
        for part, text in (("Goal", goal), ("Result", result), ("Feedback", feedback)):
            message = roslib.message.get_message_class(there[name] + part)
            fields, said_fields = set(message.__slots__) - {"header"}, fields_in(text)
            if fields != said_fields:
                wrong.append(
                    f"{name} {part}: {sorted(fields)}, and on the page {sorted(said_fields)}"
                )
    return wrong


def latched(name):
    """Whether the publisher of a topic says in its connection header that it is latched."""
    # Not in that of a message: some topics have none until something happens.
    subscriber = rospy.Subscriber(name, rospy.AnyMsg)
    headers = []
    while not headers and not rospy.is_shutdown():
        rospy.sleep(0.05)
        headers = [each.header for each in subscriber.impl.connections if each.header]
    subscriber.unregister()
    return headers[0].get("latching") == "1"


def topics(types, published):
    said = on_page("Topics")
    del said["/clock"]  # only with publish_clock
    # Only with a chip on a UART, see test/node/tmc_test.cpp.
    _, of_type, fields, _ = [said.pop(f"{NODE}/{axis}/driver") for axis in ("x", "r")][0]
    of_driver = set(roslib.message.get_message_class(of_type).__slots__) - {"header"}
    if of_driver != fields_in(fields):
        yield f"{of_type} has {sorted(of_driver)}, and on the page {sorted(fields_in(fields))}"
    yield from compare(
        "topic",
        # Debian has no control_msgs: the node's own message is the same on the wire.
        {
            name: of_type.replace("stepdriver/JointTrajectory", "control_msgs/JointTrajectory")
            for name, of_type in types.items()
        },
        {name: row[1] for name, row in said.items()},
    )
    for name in sorted(types.keys() & said.keys()):
        subscribed = "(subscribed)" in said[name][0]
        if subscribed == (name in published):
            yield f"topic {name} is {'published' if subscribed else 'subscribed'}"
        is_said = said[name][3].startswith("latched")
        if not subscribed and latched(name) != is_said:
            yield f"topic {name} is{' not' if is_said else ''} latched"
        fields = set(roslib.message.get_message_class(types[name]).__slots__)
        for field in sorted(fields_in(said[name][2]) - fields):
            yield f"topic {name} has no field {field}"


def of_node(state):
    return {
        name for name, nodes in state if NODE in nodes and not re.fullmatch(OF_ROS, name)
    }


def main():
    rospy.init_node("interfaces_test", disable_signals=True)
    master = rosgraph.Master(rospy.get_name())
    publishers, subscribers, providers = master.getSystemState()
    types = dict(master.getTopicTypes())
    published, subscribed = of_node(publishers), of_node(subscribers)
    there = {name: types[name] for name in published | subscribed}
    wrong = actions(there)
    wrong += services(of_node(providers))
    wrong += helped(of_node(providers))
    wrong += topics(there, published)
    for text in wrong:
        print(f"FAILED: {PAGE}: {text}", file=sys.stderr)
    print(f"{len(of_node(providers))} services, {len(there)} topics: {len(wrong)} differences")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
