#!/usr/bin/env python3
"""What the documents point to is there: relative links and images in *.md with their headings, and docs/... in the code.

usage: links_test.py ROOT
"""
import pathlib
import re
import subprocess
import sys

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
MENTION = re.compile(r"\bdocs/[\w/-]+\.(?:md|svg|png)")


def anchors(text):
    """GitHub's names of the headings of a page."""
    headings = re.findall(r"^#+ +(.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(file):
    for target in LINK.findall(re.sub(r"^```.*?^```", "", file.read_text(), flags=re.M | re.S)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = (file.parent / path).resolve() if path else file
        if not there.exists():
            yield target
        elif anchor and there.suffix == ".md" and anchor not in anchors(there.read_text()):
            yield target


def main():
    root = pathlib.Path(sys.argv[1])
    listed = subprocess.run(["git", "-C", root, "ls-files", "-z"], stdout=subprocess.PIPE, check=False)
    if listed.returncode != 0:
        print("not a git work tree: left out")
        return 77
    files = [root / name for name in listed.stdout.decode().split("\0") if name and (root / name).is_file()]
    broken = [f"{f.relative_to(root)}: {what}" for f in files if f.suffix == ".md" for what in broken_links(f)]
    broken += [f"{f.relative_to(root)}: {what}" for f in files if f.suffix in (".cc", ".h")
               for what in MENTION.findall(f.read_text()) if not (root / what).exists()]
    print("\n".join(broken) or f"{len(files)} files, nothing is broken")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
