#!/usr/bin/env python3
"""Writes a program of the examples in the public headers, one function for each, to compile it."""
import argparse
import pathlib
import re
import sys

# What the examples use without saying where it comes from.
PARAMETERS = (
    "machine::Machine& machine, gpio::Backend& backend, pulse::Clock& clock,"
    " const setup::MachineConfig& config"
)
INCLUDES = ("cstring", "iostream", "memory")
EXAMPLE = re.compile(r"^ */// @code\{\.cpp\}\n(.*?)^ */// @endcode$", re.MULTILINE | re.DOTALL)


def examples(header: pathlib.Path) -> list[str]:
    """The code of a header's examples."""
    return [
        "\n".join(line.partition("///")[2] for line in found.splitlines())
        for found in EXAMPLE.findall(header.read_text(encoding="utf-8"))
    ]


def program(include: pathlib.Path) -> tuple[str, int]:
    """The program, and how many examples it has. Exits if a header has none."""
    headers = sorted(include.rglob("*.h"))
    lines = [f"#include <{name}>" for name in INCLUDES]
    lines += [f'#include "{header.relative_to(include)}"' for header in headers]
    lines += ["using namespace stepdriver;"]
    count = 0
    for header in headers:
        found = examples(header)
        if not found:
            sys.exit(f"{header.relative_to(include)} has no example")
        for code in found:
            count += 1
            lines += [
                f"void example{count}({PARAMETERS}) {{  // {header.relative_to(include)}",
                "  static_cast<void>(machine), static_cast<void>(backend);",
                "  static_cast<void>(clock), static_cast<void>(config);",
                "  {",
                code,
                "  }",
                "}",
            ]
    return "\n".join(lines) + "\n", count


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("include", type=pathlib.Path, help="folder of the public headers")
    arguments.add_argument("output", type=pathlib.Path, help="the program")
    given = arguments.parse_args()
    text, count = program(given.include)
    given.output.write_text(text, encoding="utf-8")
    print(count)


if __name__ == "__main__":
    main()
