#!/usr/bin/env python3
"""Looks for phrases that aren't plain English in pages and comments, and for long lines in pages.

usage: test/docs/prose_test.py [--show PHRASE]

The table below says how often each phrase may occur: a few uses are correct, or quote a message. Exit code 0:
no phrase is more frequent, and no line is too long; 1: otherwise. --show lists the places of one phrase.
"""

import re
import sys

import pages

MOST_COLUMNS = 120

# A condition takes "if" or "when"; "where" is for places.
_CONDITION = (
    r"(?:(?<=[.:;|] )|(?<=- )|^)Where (?!does |do |is |are |an? [a-z ]+ (?:is|was) *$)|"
    r"\b(?:only|(?<!How )and|but|or|0|false|true|empty|none) where\b|"
    r"(?<!from )(?<!stays )(?<!place )(?<!position )\bwhere (?:it|they|this|that|there|one|both|nothing|nobody|no one|none|no|possible|wait) |"
    r"\bwhere (?:refused|given|configured|wired|needed|active|installed|asked)\b|"
    r"@throw [\w:]+ where\b|"
    r"(?<!from )(?<!is )(?<!place )(?<!point )(?<!position )(?<!stays )\bwhere [^.,;:|()]{0,50}(?:n't|\bnot|\bhas|\bhave|\bcan|\bmust|\bmay|\bfails?)\b"
)

# Name: what it matches, and how often it may occur in pages and comments together.
PHRASES = {
    "conditional where": (_CONDITION, 13),
    "go on": (r"\b(?:go|goes|going|went) on\b(?! the )", 0),
    "as ... has it": (r"\bas (?:\S+ ){1,4}(?:has|have|had) (?:it|them)\b", 0),
    "none of": (r"\bnone of (?:it|them|that)\b", 0),
    "beside": (r"\bbesides?\b", 1),
    "can't but": (r"\b(?:can't|cannot|can not) but\b", 0),
    "of now": (r"\bof now\b|\bbe it\b", 0),
    "leaves of": (r"\b(?:leaves?|left|makes?|becomes?|comes?|came) of\b", 1),
    "it is that": (r"\b[Ii]t is that\b|\b[Tt]hat is (?:what|why|how|the)\b", 2),
    "what holds": (r"\bwhat (?:then )?holds\b|\bholds? good\b", 0),
    "can be had": (r"\b(?:be|is|are|was) had\b", 0),
    "who does": (r"(?:^|[.:;,(] ?|\b(?:by|to|of|for) )[Ww]ho(?:ever)? \w+s\b", 3),
    "without effect": (r"\b[Ww]ithout (?:an? )?effect\b|\bnot else\b|\belse not\b", 0),
    "held against": (r"\bh(?:e|o)ld (?:them |it |\w+ )?against\b", 0),
    "gone by": (r"\bgone by\b|\bnot any more\b|\bno more (?:of|use)\b", 0),
    "anew": (r"\banew\b|\bas ever\b|\b(?:the|in) midst\b", 0),
    "has to be": (r"\bis to be\b|\bare to be\b|\bwhich is to\b", 0),
    "no restart mends": (r"\bmends?\b|\bminds?\b|\bforetells?\b|\bheeds?\b", 0),
    "known of": (r"\bknown of\b|\bsays? of\b|\btells? of\b|\bhears? of\b", 0),
    "so chain": (r"[;:] so\b(?! that)", 2),
}


def blocks():
    """Yields (file, line, text) for each paragraph of the pages, and for each comment."""
    for name in sorted(pages.own_files()):
        if name.endswith((".md", ".rst")):
            yield from _paragraphs(name)
        else:
            for line, text in pages.comments(name):
                yield name, line, text


def _paragraphs(name):
    text = pages.without_blocks(pages.text_of(name))
    line, paragraph = 0, []
    for number, content in enumerate(text.splitlines() + [""], 1):
        if content.strip() and not content.startswith(("|", "- ", "#")):
            line = line if paragraph else number
            paragraph.append(content.strip())
            continue
        if paragraph:
            yield name, line, " ".join(paragraph)
        line, paragraph = number, [content.strip()] if content.strip() else []


def found(pattern, among):
    for name, line, text in among:
        for match in re.finditer(pattern, text):
            shown = text[max(0, match.start() - 30) : match.end() + 40]
            yield f"{name}:{line}: {shown}"


def too_long():
    for name in pages.own_files():
        if not name.endswith(".md"):
            continue
        for number, line in enumerate(pages.text_of(name).splitlines(), 1):
            if len(line) > MOST_COLUMNS and not line.startswith("|"):
                yield f"{name}:{number} has {len(line)} columns; {MOST_COLUMNS} are allowed"


def main():
    prose = list(blocks())
    if sys.argv[1:2] == ["--show"]:
        print("\n".join(found(PHRASES[sys.argv[2]][0], prose)))
        return 0
    wrong = list(too_long())
    for phrase, (pattern, most) in PHRASES.items():
        places = list(found(pattern, prose))
        print(f"{phrase:20} {len(places):4} of at most {most}")
        if len(places) > most:
            wrong += places + [f'"{phrase}" occurs {len(places)} times; {most} are allowed']
    for text in wrong:
        print(f"FAILED: {text}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
