#!/usr/bin/env python3
"""No two .cc files of a target define the same name in an unnamed namespace: unity builds compile them as one file.

usage: anonymous_names_test.py TARGETS     one line per target: its name, then its sources, all separated by ';'
       anonymous_names_test.py --self-test
"""
import collections
import pathlib
import re
import sys
import tempfile

NOISE = re.compile(r'//[^\n]*|/\*.*?\*/|R"(?P<end>[^(]*)\(.*?\)(?P=end)"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])+\'|^[ \t]*#(?:\\\n|[^\n])*',
                   re.S | re.M)
TYPE = re.compile(r"\b(?:class|struct|union|enum(?: class| struct)?)\s+(?:alignas\([^)]*\)\s*)?(\w+)")
USING = re.compile(r"\busing\s+(?:\w+::)*(\w+)\s*(?:=.*)?$", re.S)
ALIAS = re.compile(r"\bnamespace\s+(\w+)\s*=")


def statements(text):
    """What stands directly in unnamed namespaces: each declaration up to its body, initialiser or semicolon."""
    text = NOISE.sub(lambda found: '""' if '"' in found.group(0)[:3] else " ", text)
    scopes, begin, head = [], 0, ""
    for mark in re.finditer(r"[{};]", text):
        part = text[begin:mark.start()]
        begin = mark.end()
        here = bool(scopes) and all(kind == "namespace" for kind, _ in scopes) and any(name == "" for _, name in scopes)
        if mark.group() == "{":
            space = re.fullmatch(r"\s*(?:inline\s+)?namespace\s*([\w:]*)\s*", part)
            if space:
                scopes.append(("namespace", space.group(1)))
                continue
            if here:
                yield part
            scopes.append(("body", ""))
        elif mark.group() == "}":
            if scopes and scopes.pop()[0] == "body":
                head = "after a body"
                continue
        elif here and head != "after a body" and part.strip():
            yield part
        elif here and part.strip() and re.match(r"\s*\w+\s*$", part):
            yield part  # struct {...} name;
        head = ""


def name_of(statement):
    """The name that a declaration declares; None for what declares none, and for tests, whose names GTest checks."""
    statement = re.sub(r"\[\[.*?\]\]", " ", statement, flags=re.S).strip()
    statement = re.sub(r"^[A-Z][A-Z_]+_CLONES\s*\([^)]*\)", " ", statement).strip()  # an attribute
    previous = None
    while previous != statement:  # templates' parameters and arguments
        previous, statement = statement, re.sub(r"<[^<>;]*>", " ", statement)
    statement = re.sub(r"^\s*template\s+", "", statement)
    if not statement or re.match(r"(?:TEST|TEST_F|TEST_P|INSTANTIATE_TEST_SUITE_P|TYPED_TEST\w*|static_assert)\b", statement):
        return None
    for pattern in (ALIAS, USING):
        found = pattern.match(statement)
        if found:
            return found.group(1)
    found = TYPE.match(statement)
    if found and "(" not in statement[:found.end()]:
        return found.group(1)
    operator = re.search(r"\boperator\s*\S+?\s*(?=\()", statement)
    if operator:
        return None  # chosen by its arguments
    before = re.split(r"\(|=(?!=)|\[", statement, maxsplit=1)[0]
    found = re.search(r"(~?[\w:]+)\s*$", before)
    return None if not found or "::" in found.group(1) else found.group(1)


def further_names(statement):
    """Those after the first one that a declaration of constants declares: constexpr int a = 1, b = F(2, 3)."""
    if not re.match(r"\s*(?:static|constexpr|const|inline)\s", statement):
        return []
    previous = None
    while previous != statement:  # arguments, whose commas part no declarations
        previous, statement = statement, re.sub(r"\([^()]*\)|\[[^\[\]]*\]|<[^<>;]*>", " ", statement)
    first, *others = statement.split(",")
    found = [re.match(r"[\s*&]*(\w+)\s*(?:=|$)", part) for part in others] if "=" in first else []
    return [name.group(1) for name in found if name]


def each(statement):
    """A using-declaration of several names, as one of each."""
    several = re.fullmatch(r"\s*using\s+([^=]*,[^=]*)", statement)
    return ["using " + name.strip() for name in several.group(1).split(",")] if several else [statement]


def definitions(path):
    """{name: its text where it is another name for something, which may be said twice in the same words}."""
    found = {}
    for statement in (one for several in statements(path.read_text()) for one in each(several)):
        name = name_of(statement)
        if name:
            words = " ".join(statement.replace(" tutti::", " ").split())
            found[name] = words if ALIAS.match(words) or USING.match(words) else ""
        found.update(dict.fromkeys(further_names(statement), ""))
    return found


def repeated(sources):
    """{name: files} of the names that more than one file defines."""
    files = collections.defaultdict(dict)
    for source in sources:
        for name, words in definitions(source).items():
            files[name][source] = words
    return {name: sorted(where) for name, where in files.items()
            if len(where) > 1 and (len(set(where.values())) > 1 or "" in where.values())}


def report(targets):
    count, bad = 0, []
    for line in pathlib.Path(targets).read_text().splitlines():
        target, *sources = line.split(";")
        sources = [pathlib.Path(source) for source in sources if source.endswith(".cc")]
        count += len(sources)
        bad += [f"{target}: '{name}' is defined in {' and '.join(map(str, where))}: rename it in one, or move it into "
                "a header" for name, where in sorted(repeated(sources).items())]
    print("\n".join(bad) or f"{count} files, no name stands twice in a target")
    return 1 if bad or not count else 0


# What the check must find (the name) and what it must leave alone (None): in one file, and in the other.
CASES = [
    ("Number", "std::string Number(double value) { return {}; }", "int Number(const char* word, int line);"),
    ("kHalf", "constexpr int kHalf = 3;  // [px]", "constexpr double kHalf = 0.5, kOther = 1;"),
    ("kLeast", "constexpr int kMost = F(2, 3), kLeast = 5;", "constexpr std::size_t kLeast = 3;"),
    ("Town", "struct Town { int Size() const { return 1; } };", "cv::Mat Town(int frame) { return {}; }"),
    ("Kind", "enum class Kind : int { kOne };", "class Kind : public Base<int> {};"),
    ("Pick", "template <typename T, int N>\nconst T* Pick(const std::vector<T>& all) { return nullptr; }",
     "std::array<int, 2> Pick(int) { return {1, 2}; }"),
    ("Row", "using Row = std::vector<int>;", "using Row = std::vector<double>;"),
    ("At", "Pose At(double x, double turn = 0.0) { return Pose({x, 0, 0}); }", "double At(int i) { return i; }"),
    ("After", "struct First {};\nint After() { return 1; }", "void After() {}"),
    ("Ice", "using testing::Snow, testing::Ice;", "int Ice() { return 0; }"),
    (None, "namespace fs = std::filesystem;\nusing testing::Snow;", "namespace fs = std::filesystem;\nusing tutti::testing::Snow;"),
    (None, "// int Same() {}\nconst char* one = \"int Same() {\";", "/* struct Same {}; */ const char* two = R\"(void Same() {})\";"),
    (None, "struct One { int Same() { return 1; } };", "struct Two { int Same() { return 2; } };"),
    (None, "void One() { int same = 1; { same = 2; } }", "void Two() { int same = 1; }"),
    (None, "TEST(Loop, IsFound) { EXPECT_EQ(1, 1); }", "TEST(Loop, IsRefused) { EXPECT_EQ(1, 1); }"),
    (None, "}\nint Public(int a) { return a; }\nnamespace {", "}\nint Public(char a) { return a; }\nnamespace {"),
]


def self_test():
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        files = [pathlib.Path(folder) / name for name in ("a.cc", "b.cc")]
        for expected, *texts in CASES:
            for file, text in zip(files, texts):
                file.write_text(f"#include <x>\nnamespace tutti {{\nnamespace {{\n{text}\n}}  // namespace\n}}  // namespace tutti\n")
            found = sorted(repeated(files))
            if found != ([expected] if expected else []):
                wrong.append(f"{texts}: wanted {expected}, found {found}")
        targets = pathlib.Path(folder) / "targets"
        files[0].write_text("namespace { int Twice() { return 1; } }")
        files[1].write_text("namespace { int Twice() { return 2; } }")
        for text, status in (("t;" + ";".join(map(str, files)), 1), (f"t;{files[0]}\nu;{files[1]}", 0), ("", 1)):
            targets.write_text(text)
            if report(targets) != status:
                wrong.append(f"{text}: the status should be {status}")
    print("\n".join(wrong) or f"{len(CASES)} cases are as they should be")
    return 1 if wrong else 0


def main():
    return self_test() if sys.argv[1] == "--self-test" else report(sys.argv[1])


if __name__ == "__main__":
    sys.exit(main())
