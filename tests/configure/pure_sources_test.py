#!/usr/bin/env python3
"""Sources that the thread sanitizer does not look into (tutti_pure) start no thread, and keep nothing but what an
object of their caller holds, which const functions do not change.

usage: pure_sources_test.py SOURCES     a file with one path per line
       pure_sources_test.py --self-test
"""
import pathlib
import re
import sys

NOISE = re.compile(r'//[^\n]*|/\*.*?\*/|R"(?P<end>[^(]*)\(.*?\)(?P=end)"|"(?:\\.|[^"\\\n])*"', re.S)
THREADS = re.compile(r"\b(?:std::(?:j?thread|async|future|promise|(?:\w+_)?mutex|condition_variable|call_once)|thread_local|"
                     r"RunParallel|parallel_for_?|pthread_\w+|volatile|mutable|const_cast)\b")
# A flag that says "stop", given by reference or pointer to const, is read; every other atomic is shared state.
ATOMIC = re.compile(r"(?<!const )\bstd::atomic\b")
# Not a function, whose parameters are followed by its body.
STATIC = re.compile(r"\bstatic\s+(?!const\b|constexpr\b)[^;{}()=]*(?:[;{=]|\((?![^;{]*\)\s*(?:const\s*)?\{))")
NAMESPACE_VARIABLE = re.compile(r"^(?!(?:using|namespace|class|struct|enum|template|typedef|return|const|constexpr|inline|static|static_assert|"
                                r"extern|friend|public|private|case|default)\b)[A-Za-z_][\w:<>,& *]*\s\w+(?:\s*=[^;()]*|\[[^;]*)?;", re.M)


def faults(text):
    """(line, what) of each that a pure source must not have."""
    text = NOISE.sub(lambda found: re.sub(r"[^\n]", " ", found.group(0)), text)
    for pattern, what in ((THREADS, "not for one thread"), (ATOMIC, "an atomic that is not given"), (STATIC, "a static variable"),
                          (NAMESPACE_VARIABLE, "a variable that outlives calls")):
        for found in pattern.finditer(text):
            yield text.count("\n", 0, found.start()) + 1, f"{what}: {' '.join(found.group(0).split())[:60]}"


def self_test():
    refused = ["void F() { std::thread([] {}); }", "static int calls = 0;", "void F() { static cv::Mat kept; }", "std::mutex lock;",
               "int calls = 0;", "std::vector<int> found;", "void F(std::atomic<int>* n) { ++*n; }", "RunParallel(2, 2, work);",
               "static std::map<int, int> known;", "static int calls(5);\nvoid F() {\n}", "void F() { static int known{3}; }",
               "class S {\n  mutable int last_;\n};"]
    allowed = ["static const int kA = 1;", "constexpr int kB = 2;", "const double kC[] = {1, 2};", "static int Twice(int a) { return 2 * a; }",
               "bool Go(const std::atomic<bool>* stop);", "void F() {\n  int local = 0;\n}", "// std::thread\n", "using A = int;",
               "class S {\n  static Reader OfSplit(int first, int odd) {\n    return {};\n  }\n};"]
    wrong = [s for s in refused if not list(faults(s))] + [s for s in allowed if list(faults(s))]
    for source in wrong:
        print(f"judged wrongly: {source} {list(faults(source))}")
    return 1 if wrong else 0


def main():
    if sys.argv[1] == "--self-test":
        return self_test()
    sources = [pathlib.Path(line) for line in pathlib.Path(sys.argv[1]).read_text().splitlines() if line]
    if not sources:
        print(f"{sys.argv[1]}: no sources")
        return 1
    found = [(source, *fault) for source in sources for fault in faults(source.read_text())]
    for source, line, what in found:
        print(f"{source}:{line}: {what}; the thread sanitizer must see this: take the file out of tutti_pure, or the state out of the file")
    print(f"{len(sources)} sources, {len(found)} faults")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
