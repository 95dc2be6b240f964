"""The house stands as drawn: doors, names, sizes, sources; floors are import-linter's to check."""

import ast
import json
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import boresight
from boresight import catalogue

SOURCE = Path(boresight.__file__).parent
FILES = sorted(SOURCE.rglob("*.py"))
MODULES = sorted(
    ".".join(("boresight", *f.relative_to(SOURCE).with_suffix("").parts)).removesuffix(".__init__")
    for f in FILES
    if f.name != "__main__.py"
)
HEAVY = ("numpy", "scipy", "polars", "llvmlite", "plotly", "pydantic", "pyproj", "cyclopts", "rich")
LONGEST_FILE, LONGEST_FUNCTION = 320, 60


def run(code, *arguments, timeout=120):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=timeout,
    )


LOADED = "import sys, json; print(json.dumps([m for m in sys.argv[1:] if m in sys.modules]))"


@pytest.mark.parametrize(
    ("module", "allowed"),
    [
        ("boresight", set()),
        ("boresight.__main__", set()),
        ("boresight.errors", set()),
        ("boresight.lanes", {"numpy"}),
        ("boresight.maths.frames", {"numpy"}),
        ("boresight.models.sensors", {"numpy"}),
        ("boresight.catalogue", {"numpy"}),
        ("boresight.interfaces.python", {"numpy"}),
    ],
)
def test_an_import_loads_nothing_heavy_that_it_does_not_need(module, allowed):
    done = run(f"import {module}\n{LOADED}", *HEAVY)
    assert done.returncode == 0, done.stderr
    assert set(json.loads(done.stdout)) <= allowed


EACH_ALONE = """
import os, sys
import numpy, polars, pydantic, cyclopts, rich, scipy.stats, pyproj, plotly.graph_objects  # once
from importlib import import_module
failed = []
for name in sys.argv[1:]:
    child = os.fork()
    if child == 0:
        try:
            import_module(name)
        except BaseException as error:
            print(name, repr(error), file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        failed.append(name)
sys.exit(bool(failed))
"""


@pytest.mark.slow  # a minute: every module with all that it imports, in a process of its own
@pytest.mark.skipif(sys.platform == "win32", reason="needs fork")
def test_every_module_can_be_the_first_to_be_imported():
    """A cycle shows itself only to whoever enters it at the wrong place."""
    done = run(EACH_ALONE, *MODULES, timeout=600)
    assert done.returncode == 0, done.stderr


def at_import(statements):
    """The statements that run when a module is imported: no function's, none for types alone."""
    for each in statements:
        if isinstance(each, ast.FunctionDef) or "TYPE_CHECKING" in ast.dump(each)[:80]:
            continue
        yield each
        for name in ("body", "orelse", "finalbody"):
            yield from at_import(getattr(each, name, []))


def needs(module):
    """Modules of ours that this one imports when it is imported."""
    file = SOURCE.joinpath(*module.split(".")[1:])
    file = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
    for each in at_import(ast.parse(file.read_text(encoding="utf-8")).body):
        if isinstance(each, ast.Import):
            yield from (alias.name for alias in each.names if alias.name in MODULES)
        elif isinstance(each, ast.ImportFrom) and each.module in MODULES:
            inside = {f"{each.module}.{alias.name}" for alias in each.names} & set(MODULES)
            yield from inside or [each.module]


def test_no_import_goes_round_in_a_circle():
    """What has no circle can be imported in any order."""
    TopologicalSorter({module: set(needs(module)) for module in MODULES}).prepare()


def test_a_circle_is_found(monkeypatch, tmp_path):
    (tmp_path / "a.py").write_text("from boresight import b\n")
    (tmp_path / "b.py").write_text("import math\n\nfrom boresight.a import x\n")
    monkeypatch.setitem(globals(), "SOURCE", tmp_path)
    monkeypatch.setitem(globals(), "MODULES", ["boresight", "boresight.a", "boresight.b"])
    with pytest.raises(CycleError):
        TopologicalSorter({each: set(needs(each)) for each in MODULES[1:]}).prepare()


@pytest.mark.parametrize("name", catalogue.names())
def test_every_filter_says_where_it_comes_from_and_how_it_differs(name):
    cited = catalogue.cite(name)
    assert cited["key"] in cited["bibtex"]
    assert re.search(r"title\s*=", cited["bibtex"])
    assert re.search(r"author\s*=", cited["bibtex"])
    assert len(cited["differs"].split()) >= 5


def definitions(tree):
    """Functions, methods and classes with the names they are reached by."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node
        if isinstance(node, ast.ClassDef):
            for name, inner in definitions(node):
                yield f"{node.name}.{name}", inner


def is_public(name):
    return not any(part.startswith("_") for part in name.split("."))


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(SOURCE)))
def test_a_file_is_short_and_says_what_it_holds(path):
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert ast.get_docstring(tree), "the module says nothing of itself"
    silent = [n for n, node in definitions(tree) if is_public(n) and not ast.get_docstring(node)]
    assert not silent
    assert len(text.splitlines()) <= LONGEST_FILE
    long = {
        name: node.end_lineno - node.lineno + 1
        for name, node in definitions(tree)
        if not isinstance(node, ast.ClassDef) and node.end_lineno - node.lineno >= LONGEST_FUNCTION
    }
    assert not long


@pytest.mark.parametrize("name", sorted(boresight._NAMES))
def test_every_public_name_resolves(name):
    module = f"boresight.{boresight._NAMES[name]}"
    if find_spec(module) is None:
        pytest.skip(f"{module} is not built yet")
    value = getattr(boresight, name)
    assert value is getattr(import_module(module), name)
    assert value.__doc__


def test_unknown_names_are_refused_as_python_does():
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        boresight.nonsense  # noqa: B018 - looking it up is the test
    assert dir(boresight) == boresight.__all__


def test_the_stub_and_the_lazy_table_are_the_same_list():
    stub = ast.parse((SOURCE / "__init__.pyi").read_text(encoding="utf-8"))
    stated = {
        alias.asname: node.module.removeprefix("boresight.")
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name  # `import x as x`: re-exported on purpose
    }
    built = {n: m for n, m in boresight._NAMES.items() if find_spec(f"boresight.{m}")}
    built |= dict.fromkeys(boresight._MODULES, "boresight")
    assert stated == built
    (version,) = (n.target.id for n in stub.body if isinstance(n, ast.AnnAssign))
    assert version == "__version__"
    assert isinstance(boresight.__version__, str)
