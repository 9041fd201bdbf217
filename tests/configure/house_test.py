#!/usr/bin/env python3
"""How large the house is: lines, small files, public methods of the classes that once did everything. A bound that is passed fails.

usage: house_test.py ROOT
       house_test.py --self-test

LINES and TESTS are ratchets: lower them when lines have left. What comes in pays rent (CONTRIBUTING.md).
"""
import pathlib
import re
import sys

LINES, TESTS = 88800, 49400  # of C++ without tests and bench; of tests
SMALL, SMALL_FILES = 40, 70  # files of fewer lines, at most
METHODS = {  # public ones, at most; constructors, operators and friends apart
    ("frontend/include/tutti/frontend/odometry.h", "Odometry"): 10,
    ("apps/slam/include/tutti/slam/slam_system.h", "SlamSystem"): 14,
    ("apps/slam/loop_closer.h", "LoopCloser"): 12,
    ("loopclosure/include/tutti/loopclosure/detector.h", "LoopDetector"): 18,
}
CLASSES_WITH = {"BeginSession": 3, "Merge": 2}  # a method of this name: a feature that is threaded through classes
DECLARATION = re.compile(r"[\w:<>,&*\s]+?[\s&*](\w+)\s*\(")


def sources(root, folders=("core", "frontend", "loopclosure", "backend", "apps", "data")):
    return sorted(file for folder in folders for file in (root / folder).rglob("*.*") if file.suffix in (".h", ".cc"))


def public_methods(text, name):
    """Names of the public methods of a class, in their order; an overload counts."""
    begin = re.search(rf"\bclass {name}\b[^;{{]*{{", text)
    if begin is None:
        return []
    outside, depth = [], 1
    for character in re.sub(r"//.*", "", text[begin.end():]):
        depth += {"{": 1, "}": -1}.get(character, 0)
        if depth == 0:
            break
        if depth == 1:
            outside.append(";" if character == "}" else character)
    public = "".join(part for part in re.split(r"(?=\b(?:public|private|protected):)", "".join(outside)) if part.startswith("public:"))
    declarations = (" ".join(d.replace("public:", "").split()) for d in public.split(";"))
    found = (DECLARATION.match(d) for d in declarations
             if not d.startswith(("using ", "struct ", "enum ", "template ", "friend ", "static constexpr ")))
    return [m.group(1) for m in found if m and m.group(1) not in (name, "operator") and f"~{name}" not in m.group(0)]


def classes_with(root, method):
    """Headers with a method of this name: none of them has two classes with it."""
    pattern = re.compile(rf"^  (?:void|bool) {method}\(", re.M)
    return [str(f.relative_to(root)) for f in sources(root) if f.suffix == ".h" and pattern.search(f.read_text())]


def check(root):
    lengths = {file: file.read_text().count("\n") for file in sources(root)}
    small = sum(length < SMALL for length in lengths.values())
    tests = sum(file.read_text().count("\n") for file in sources(root, ("tests",)))
    rows = [("lines of C++ without tests and bench", sum(lengths.values()), LINES), ("lines of tests", tests, TESTS),
            (f"files under {SMALL} lines", small, SMALL_FILES)]
    rows += [(f"public methods of {name}", len(public_methods((root / file).read_text(), name)), most)
             for (file, name), most in METHODS.items()]
    rows += [(f"classes with a method {method}", len(classes_with(root, method)), most) for method, most in CLASSES_WITH.items()]
    for what, count, most in rows:
        print(f"{what}: {count}, at most {most}" + ("  <- too many" if count > most else ""))
    return any(count > most for _, count, most in rows)


def self_test():
    text = """class A {  // of one
 public:
  A();
  ~A();
  A& operator=(const A&);
  static int One(int x) { return x; }
  const std::vector<int>& two() const { return two_; }
  void two(int);
  friend void Three(A*);
  struct B { void Four(); };
 private:
  void Five();
};"""
    assert public_methods(text, "A") == ["One", "two", "two"], public_methods(text, "A")
    assert public_methods(text, "C") == []
    print("methods are counted")


if __name__ == "__main__":
    sys.exit(self_test() if sys.argv[1:] == ["--self-test"] else check(pathlib.Path(sys.argv[1])))
