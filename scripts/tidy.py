#!/usr/bin/env python3
"""Runs clang-tidy on files, and remembers which of them had no finding.

usage: scripts/tidy.py BUILD [OPTION...]    the files on standard input, one a line

BUILD is a build folder with compile_commands.json. A file without findings is not read again until
something changes that its result depends on: the contents of all files that it includes, its compile
command, the options, the version of clang-tidy or a .clang-tidy. That is kept in ~/.cache/stepdriver/tidy
(or $XDG_CACHE_HOME/stepdriver/tidy), for every checkout of this user; what was of no use for 60 days is
removed. Exit code 0: no file has a finding.
"""

import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache", "stepdriver", "tidy")
LONGEST_UNUSED = 60 * 24 * 3600  # [s]


class Tidy:
    def __init__(self, build, options):
        self._command = ["clang-tidy", "--quiet", "-p", str(build), *options]
        commands = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))
        self._compile = {entry["file"]: entry for entry in commands}
        version = subprocess.run(["clang-tidy", "--version"], check=True, capture_output=True).stdout
        configurations = [(ROOT / folder / ".clang-tidy").read_bytes() for folder in (".", "test")]
        self._common = [version, *configurations, self._portable(" ".join(options).encode())]
        self._digests = {}

    def check(self, path):
        """Returns whether the file has no finding, what there is to print, and whether that was known."""
        key = self._key(path)
        known = CACHE / key if key else None
        if known and known.exists():
            known.touch()
            return True, "", True
        result = subprocess.run([*self._command, path], check=False, capture_output=True, text=True)
        clean = result.returncode == 0 and not result.stdout.strip()
        if clean and known:
            known.touch()
        return result.returncode == 0, result.stdout + (result.stderr if result.returncode else ""), False

    def _key(self, path):
        """None if the compiler can't read the file; then clang-tidy says why."""
        entry = self._compile[path]
        words = shlex.split(entry["command"])
        # After the launcher comes the compiler.
        words = words[next(i for i, word in enumerate(words) if word.endswith("c++")):]
        output = words.index("-o")
        words[output:output + 2] = []
        listed = subprocess.run([*words, "-M"], cwd=entry["directory"], check=False, capture_output=True, text=True)
        if listed.returncode != 0:
            return None
        total = hashlib.sha256()
        for part in (*self._common, self._portable(" ".join(words).encode())):
            total.update(hashlib.sha256(part).digest())
        for name in listed.stdout.replace("\\\n", " ").split()[1:]:
            total.update(self._digest(os.path.join(entry["directory"], name)))
        return total.hexdigest()

    def _digest(self, path):
        if path not in self._digests:
            self._digests[path] = hashlib.sha256(self._portable(pathlib.Path(path).read_bytes())).digest()
        return self._digests[path]

    @staticmethod
    def _portable(content):
        """Generated files and commands name the checkout."""
        return content.replace(str(ROOT).encode(), b"")


def main():
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        print(__doc__, file=sys.stderr)
        return 64
    CACHE.mkdir(parents=True, exist_ok=True)
    for known in CACHE.iterdir():
        if time.time() - known.stat().st_mtime > LONGEST_UNUSED:
            known.unlink(missing_ok=True)
    tidy = Tidy(pathlib.Path(sys.argv[1]), sys.argv[2:])
    paths = sys.stdin.read().splitlines()
    all_clean, unchanged = True, 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for clean, output, known in pool.map(tidy.check, paths):
            all_clean &= clean
            unchanged += known
            if output.strip():
                print(output, flush=True)
    print(f"{len(paths)} files, {unchanged} of them unchanged since an earlier run")
    return 0 if all_clean else 1


sys.exit(main())
