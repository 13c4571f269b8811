"""Lets librsvg interpret SVG: it resolves styles, units, copies, markers and text. What remains is what a
viewer would show, as paths. Tried with librsvg 2.54 on cairo 1.16 (Debian 12) and 2.60 on cairo 1.18
(Debian 13), which write the same paths with styles and with attributes."""

import resource
import signal
import subprocess
import tempfile
import xml.etree.ElementTree as xml

from .errors import BadDrawing

PROGRAM = "rsvg-convert"
LONGEST = 60  # [s] of processor time
MEMORY = 2 << 30  # [bytes]
LARGEST = 64 << 20  # [bytes] of the result


def interpreted(document, path):
    """The root of librsvg's version of a document. path: names the file in errors.

    The document goes to the standard input of rsvg-convert, so it has no address: librsvg then reads no file
    and no network address that it refers to.
    """
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        try:
            ended = subprocess.run([PROGRAM, "--format=svg"], input=document, stdout=output, stderr=errors,
                                   preexec_fn=limit, check=False)
        except FileNotFoundError as error:
            raise BadDrawing(f"SVG files are interpreted by {PROGRAM}: apt install librsvg2-bin") from error
        if ended.returncode != 0:
            errors.seek(0)
            raise BadDrawing(f"{path}: {PROGRAM} can't interpret it: {why(ended.returncode, errors.read())}")
        output.seek(0)
        return xml.parse(output).getroot()


def limit():
    """Bounds the time, the memory and the output of the calling process."""
    for kind, most in ((resource.RLIMIT_CPU, LONGEST), (resource.RLIMIT_AS, MEMORY),
                       (resource.RLIMIT_FSIZE, LARGEST)):
        _, hard = resource.getrlimit(kind)
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (most, most))


def why(code, errors):
    """The reason for an exit code of rsvg-convert."""
    if -code in (signal.SIGXCPU, signal.SIGKILL):
        return f"it takes longer than {LONGEST} s"
    if -code == signal.SIGXFSZ:
        return f"the result is larger than {LARGEST >> 20} MB"
    lines = errors.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else f"exit code {code}"
