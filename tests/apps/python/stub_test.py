"""The type stub says what the module has: names, parameters, defaults; and options are those of the configuration."""
import ast
import inspect

import pytest

import tutti
from tutti import _tutti

OPERATORS = ("__init__", "__len__", "__getitem__", "__iter__", "__next__")
# Whose keywords are a section of the configuration: (class, method): section, and keywords beside it, left out.
OPTIONS = {
    ("LoopDetector", "__init__"): ("loops", {"preset"}, set()),
    ("Camera", "__init__"): ("camera", set(), {"baseline_m", "fov_deg", "readout_s", "depth_delay_s", "T_camera_imu", "right"}),
    ("Dataset", "__init__"): ("dataset", set(), set()),
    ("PoseGraph", "optimize"): ("graph", set(), {"certify"}),
    ("Config", "__init__"): (None, set(), set()),
    ("SlamSystem", "__init__"): (None, set(), set()),
    ("TrajectoryCloser", "__init__"): (None, set(), set()),
}
SECTIONS = {"dataset", "camera", "imu", "odometry", "loops", "graph", "run"}


@pytest.fixture(scope="module")
def stub(source):
    return ast.parse((source / "apps" / "python" / "tutti" / "_tutti.pyi").read_text())


def named(body, kind):
    return {node.name: node for node in body if isinstance(node, kind)}


def public(names):
    return {name for name in names if not name.startswith("_") or name in OPERATORS}


def classes():
    return {name: value for name, value in vars(_tutti).items() if inspect.isclass(value) and name in public([name])}


def functions():
    return {name: value for name, value in vars(_tutti).items() if callable(value) and not inspect.isclass(value)}


def members(cls):
    own = public(vars(cls))
    if not (getattr(cls, "__init__").__doc__ or "").startswith("__init__("):
        own.discard("__init__")  # pybind11's own, which says that there is no constructor
    return own


def signature(function):
    """pybind11 writes it into the first line."""
    line = function.__doc__.splitlines()[0]
    assert "Overloaded" not in function.__doc__
    return ast.parse("def " + line + ": ...").body[0]


def parameters(node):
    """Positional ones, keyword-only ones, defaults of both, and whether there are further keywords."""
    args = node.args
    names = [arg.arg for arg in args.posonlyargs + args.args]
    defaults = dict(zip(reversed(names), reversed(args.defaults)))
    defaults.update({arg.arg: value for arg, value in zip(args.kwonlyargs, args.kw_defaults) if value is not None})
    return (names, [arg.arg for arg in args.kwonlyargs], {name: ast.literal_eval(value) for name, value in defaults.items()},
            args.kwarg is not None)


def test_it_names_what_the_module_has(stub):
    assert set(named(stub.body, ast.ClassDef)) == set(classes())
    assert set(named(stub.body, ast.FunctionDef)) == set(functions())
    assert public(vars(tutti)) - {"annotations"} >= set(classes()) | set(functions())


@pytest.mark.parametrize("name", sorted(classes()))
def test_its_classes_have_the_members(stub, name):
    cls, node = classes()[name], named(stub.body, ast.ClassDef)[name]
    if issubclass(cls, Exception):
        assert [base.id for base in node.bases] == [base.__name__ for base in cls.__bases__]
        return
    written = named(node.body, ast.FunctionDef)
    assert set(written) == members(cls)
    for member, function in written.items():
        decorators = {decorator.id for decorator in function.decorator_list}
        value = vars(cls)[member]
        assert ("property" in decorators) == isinstance(value, property), member
        assert ("staticmethod" in decorators) == isinstance(value, staticmethod), member
        assert inspect.getdoc(value) or member in OPERATORS, f"{member} has no description"
        if not isinstance(value, property):
            check(f"{name}.{member}", function, getattr(cls, member), OPTIONS.get((name, member)))


def check(name, written, function, options):
    names, only, defaults, more = parameters(signature(function))
    stub_names, stub_only, stub_defaults, stub_more = parameters(written)
    assert stub_names == names, name
    assert more == (options is not None) and not stub_more, name
    if options is not None:
        section, beside, without = options
        values = dict.fromkeys(SECTIONS, {}) if section is None else tutti.default_options(section)
        assert set(stub_only) - set(only) == set(values) - without | beside, name
        differing = {"robust", "init", "max_iterations", "function_tolerance"} if section == "graph" else set()
        for option in set(values) - without - differing:
            if not isinstance(values[option], (dict, list)):
                assert stub_defaults[option] == values[option], option
        stub_only = [option for option in stub_only if option in only]
        stub_defaults = {key: value for key, value in stub_defaults.items() if key in defaults}
    assert stub_only == only, name
    assert {key: value for key, value in stub_defaults.items() if value is not ...} == \
        {key: value for key, value in defaults.items() if stub_defaults[key] is not ...}, name


@pytest.mark.parametrize("name", sorted(functions()))
def test_its_functions_have_the_parameters(stub, name):
    check(name, named(stub.body, ast.FunctionDef)[name], functions()[name], None)
    assert len(functions()[name].__doc__.splitlines()) > 2


def test_descriptions_are_in_the_words_of_python():
    texts = [value.__doc__ for value in functions().values()]
    for cls in classes().values():
        texts += [cls.__doc__] + [value.__doc__ for name, value in vars(cls).items() if name in public([name])]
    for text in filter(None, texts):
        for word in ("InputError", "throws", "std::", "::", "CV_8UC"):
            assert word not in text.replace("tutti.InputError", ""), text


def test_every_option_is_described():
    for section in SECTIONS:
        text = tutti.describe(section)
        for name in tutti.default_options(section):
            assert f"{name} = " in text or f"{name}: a dict of" in text


def test_python_knows_the_signatures(stub):
    """inspect.signature says what the first line of the description does."""
    pairs = [(function, name) for name, function in functions().items()]
    for cls in classes().values():
        if not issubclass(cls, Exception):
            pairs += [(getattr(cls, member), f"{cls.__name__}.{member}") for member in members(cls)
                      if not isinstance(vars(cls)[member], property)]
    assert len(pairs) > 60
    for function, name in pairs:
        names, only, defaults, more = parameters(signature(function))
        read = inspect.signature(function).parameters.values()
        assert [p.name for p in read if p.kind == p.POSITIONAL_OR_KEYWORD or p.kind == p.POSITIONAL_ONLY] == names, name
        assert [p.name for p in read if p.kind == p.KEYWORD_ONLY] == only, name
        assert {p.name: p.default for p in read if p.default is not p.empty} == defaults, name
        assert any(p.kind == p.VAR_KEYWORD for p in read) == more, name
    assert list(inspect.signature(tutti.LoopDetector.detect).parameters)[:3] == ["self", "image", "id"]
    assert "external_members" in inspect.signature(tutti.LoopDetector).parameters
