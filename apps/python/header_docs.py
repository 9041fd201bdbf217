#!/usr/bin/env python3
"""Writes the descriptions that stand in C++ headers as constants, for the docstrings of the Python module.

usage: header_docs.py OUTPUT HEADER...

`/// text` before a declaration and `///< text` behind a field become `doc::Class_Name` (of a function outside of classes:
`doc::Name`). A binding that asks for a description that no header has does not compile.
"""
import pathlib
import re
import sys

# Parameters that Python has not, or under another name: what is said of them is left out.
CPP_ONLY = re.compile(r"`(?:stop|chordal_optimum|recorder|more|times_s|format)`(?:[^.]|\.(?! |$))*\. ?")
SCOPE = re.compile(r"^(?:struct|class) (\w+)[^;]*{")
FUNCTION = re.compile(r"(~?\w+|operator\S+) ?\(")
NAMES = re.compile(r"(\w+)(?: = [^,;]+|\{[^}]*\})?(?=[,;])")


def described(text):
    """Class (or ""), name and description of each declaration of a header."""
    found, scope, comment, declaration, last = [], "", [], "", []
    for line in text.splitlines():
        bare = line.strip()
        depth = len(line) - len(line.lstrip())
        if bare.startswith("///<") and last:  # goes on
            for entry in last:
                entry[2] += " " + bare[4:].strip()
            continue
        if bare.startswith("///"):
            comment.append(bare[3:].strip())
            last = []
            continue
        if not scope and SCOPE.match(line):
            scope = SCOPE.match(line)[1]
            found.append([scope, "", " ".join(comment)])
            comment, declaration = [], ""
            continue
        if line.startswith("};"):
            scope, comment, declaration, last = "", [], "", []
            continue
        code, _, behind = line.partition("///<")
        if depth != (2 if scope else 0) and not declaration or bare.startswith(("//", "#", "TUTTI_OPTION")):
            comment, last = [], []
            continue
        declaration += " " + code.strip()
        if behind:
            comment.append(behind.strip())
        if not re.search(r"[;{}]\s*$", code) and bare:
            continue
        declaration = re.sub(r" = [^,;]*\([^;]*(?=[,;])", "", declaration)  # a value that is a call
        function = FUNCTION.search(declaration)
        names = [function[1]] if function else NAMES.findall(declaration)
        last = [[scope, name, " ".join(comment)] for name in names] if comment else []
        comment, declaration = [], ""
        found += last
    return found


def pythonic(text):
    """The same in the words of Python."""
    text = CPP_ONLY.sub("", text).replace("posterior_by_location", "posteriors")
    text = re.sub(r"\b([Tt])hrows\b", lambda m: ("R" if m[1] == "T" else "r") + "aises", text)
    text = re.sub(r"\bthrow\b", "raise", text)
    text = re.sub(r"(?<!tutti\.)\bInputError\b", "tutti.InputError", text)
    text = re.sub(r"\bk([A-Z]\w*)", lambda m: '"' + m[1].lower() + '"', text)
    text = re.sub(r"\b(?!cv::)(\w+)::(\w+)", lambda m: m[1] + "." + snake(m[2]), text)
    text = re.sub(r"\b(?!Sim\()([A-Z][a-z]\w*)\(", lambda m: snake(m[1]) + "(", text)
    text = text.replace("(Finish)", "(finish)").replace("(null)", "(None)")
    return re.sub(r"(?<=[a-z,] )(Detect|Locate|Load|Save|Track|Finish|ReadTrajectory)\b", lambda m: snake(m[1]), text)


def snake(name):
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower() if name[:1].isupper() and name != name.upper() else name


def main():
    output, *headers = sys.argv[1:]
    constants = {}
    for header in headers:
        entries = described(pathlib.Path(header).read_text())
        for scope, name, text in entries:
            if text.strip() and (not name or re.fullmatch(r"\w+", name)):
                constants.setdefault("_".join(filter(None, (scope, name))), pythonic(text.strip()))
    lines = [f'inline constexpr char {name}[] = R"doc({text})doc";' for name, text in sorted(constants.items())]
    pathlib.Path(output).write_text("// Made by header_docs.py of the public headers.\n#pragma once\n\n"
                                    "namespace tutti::python::doc {\n" + "\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
