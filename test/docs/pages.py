"""The project's pages and their testable parts: commands, links, tables."""

import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]

# The first words of commands within sentences.
_PROGRAMS = (
    "apt|apt-get|bash|cmake|ctest|gpioinfo|gtkwave|journalctl|pkill|pulseview|python3|ros[a-z]+|"
    r"scripts/\w+\.sh|setup_system|sigrok-cli|source|stepdriver_\w+|sudo|systemctl"
)


def names():
    """The pages, by their paths in the checkout."""
    return ["README.md", "CONTRIBUTING.md"] + sorted(
        f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md")
    )


def _listed_by_git():
    """None without git, or if this is no checkout."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT, check=False, capture_output=True, text=True,
        )
    except FileNotFoundError:
        return None
    return listed.stdout.splitlines() if listed.returncode == 0 else None


def own_files():
    """All files of the project, by their paths in the checkout."""
    listed = _listed_by_git()
    if listed is not None:
        return [name for name in listed if (ROOT / name).is_file()]
    made = re.compile(r"(build.*|\..*)/")
    files = (str(file.relative_to(ROOT)) for file in ROOT.rglob("*") if file.is_file())
    return [name for name in files if not made.match(name)]


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def _blocks(text):
    """Yields (language, lines) for fenced blocks, and (None, lines) for the text between them."""
    language, lines = None, []
    for line in text.splitlines():
        fence = re.match(r"\s*```\s*(\w*)\s*$", line)
        if not fence:
            lines.append(line)
            continue
        yield language, lines
        language, lines = (fence[1] if language is None else None), []
    yield language, lines


def _of_block(lines):
    whole = re.sub(r"\\\n\s*", "", "\n".join(lines))
    for line in whole.splitlines():
        command = re.sub(r"^\$ ", "", re.sub(r"(^|\s+)#(\s.*)?$", "", line).strip())
        if command:
            yield command


def prose(text):
    """A page without its fenced blocks."""
    return "\n".join(
        line for language, lines in _blocks(text) if language is None for line in lines
    )


def _of_sentences(text):
    for quoted in re.findall(r"`([^`]+)`", text):
        command = re.sub(r"\s+", " ", quoted)
        if re.match(rf"({_PROGRAMS}) (?!->)", command):
            yield command


def commands(text):
    """All commands of a page, in order: the lines of blocks, except those of text, YAML, CMake, C++, Python and
    nftables, and whole commands in sentences."""
    for language, lines in _blocks(text):
        if language is None:
            yield from _of_sentences("\n".join(lines))
        elif language not in ("text", "yaml", "cmake", "cpp", "python", "nft"):
            yield from _of_block(lines)


def tables(text):
    """The tables of a page: for each its heading, and its rows of cells."""
    heading, rows = "", []
    for line in prose(text).splitlines() + [""]:
        if line.startswith("|"):
            cells = re.split(r"(?<!\\)\|", line)[1:-1]
            rows.append([cell.strip().replace(r"\|", "|") for cell in cells])
            continue
        if rows:
            yield heading, [row for row in rows if not all(re.match("-+$", cell) for cell in row)]
        rows = []
        if line.startswith("#"):
            heading = line.strip("# ")
