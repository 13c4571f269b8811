#!/usr/bin/env python3
"""Runs a command with the system calls that a unit of systemd allows; any other call kills it.

usage: test/operations/sandbox.py UNIT COMMAND [ARGUMENT...]

Applies these settings of the unit: SystemCallFilter=, RestrictAddressFamilies=, RestrictNamespaces=,
MemoryDenyWriteExecute= and NoNewPrivileges=. The sets of calls are those of systemd-analyze. A refused call
kills the command with SIGSYS here, but returns an error in the service: a test must see it.
"""

import ctypes
import errno
import mmap
import os
import pathlib
import re
import socket
import subprocess
import sys

import seccomp

PR_SET_NO_NEW_PRIVS = 38
# CLONE_NEWTIME, NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID and NEWNET.
NEW_NAMESPACES = 0x80 | 0x20000 | 0x2000000 | 0x4000000 | 0x8000000 | 0x10000000 | 0x20000000 | 0x40000000


def calls_of(name):
    """The calls of a name: itself, or the members of a set like @system-service."""
    if not name.startswith("@"):
        return {name}
    listed = subprocess.run(
        ["systemd-analyze", "syscall-filter", name], check=True, capture_output=True, text=True,
        env={**os.environ, "SYSTEMD_COLORS": "0"},
    ).stdout.splitlines()[1:]
    return set().union(*(
        calls_of(line.strip()) for line in listed if line.strip() and not line.strip().startswith("#")
    ))


def allowed_calls(lines):
    allowed = calls_of("@default")
    for line in lines:
        names = set().union(*(calls_of(name) for name in line.lstrip("~").split()))
        allowed = allowed - names if line.startswith("~") else allowed | names
    return allowed


def conditions(call, settings):
    """The alternatives, each a list of arguments, of which one must be true for the call."""
    if call == "socket":
        families = settings["RestrictAddressFamilies"][0].split()
        return [[seccomp.Arg(0, seccomp.EQ, getattr(socket, family))] for family in families]
    if call == "clone":
        return [[seccomp.Arg(0, seccomp.MASKED_EQ, NEW_NAMESPACES, 0)]]
    if call == "mmap":
        return [[seccomp.Arg(2, seccomp.MASKED_EQ, protection, 0)]
                for protection in (mmap.PROT_WRITE, mmap.PROT_EXEC)]
    if call in ("mprotect", "pkey_mprotect"):
        return [[seccomp.Arg(2, seccomp.MASKED_EQ, mmap.PROT_EXEC, 0)]]
    return [[]]


def confine(settings):
    for setting in ("RestrictNamespaces", "MemoryDenyWriteExecute", "NoNewPrivileges"):
        if settings.get(setting) != ["yes"]:
            sys.exit(f"sandbox.py: the unit has {setting}={settings.get(setting)}, and not yes")
    rules = seccomp.SyscallFilter(seccomp.KILL_PROCESS)
    known = 0
    for call in sorted(allowed_calls(settings["SystemCallFilter"]) - {"clone3", "setns", "unshare"}):
        try:
            number = seccomp.resolve_syscall(seccomp.Arch(), call)
        except ValueError:
            continue  # newer than this library
        if number < 0:
            continue  # it belongs to another architecture
        known += 1
        for arguments in conditions(call, settings):
            rules.add_rule(seccomp.ALLOW, call, *arguments)
    if known < 100:
        sys.exit(f"sandbox.py: only {known} allowed calls are known")
    # As systemd does: its arguments can't be checked, and glibc then uses clone.
    rules.add_rule(seccomp.ERRNO(errno.ENOSYS), "clone3")
    if ctypes.CDLL(None).prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        sys.exit("sandbox.py: no_new_privs is refused")
    rules.load()


unit, *command = sys.argv[1:]
found = {}
for key, value in re.findall(r"^(\w+)=(.*)$", pathlib.Path(unit).read_text(encoding="utf-8"), re.MULTILINE):
    found.setdefault(key, []).append(value)
confine(found)
os.execvp(command[0], command)
