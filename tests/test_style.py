"""The style of the house, as far as a program can see it (CONTRIBUTING.md has it in words)."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parent.parent
PACKAGES = ("flows", "tasks", "storage", "dreamfields_core")
LONGEST = 260
"""Lines of a file."""

UNSAFE_MODULES = {"pickle", "cPickle", "_pickle", "cloudpickle", "dill", "joblib", "shelve", "marshal"}
"""Reading what they wrote runs code."""

UNFINISHED = re.compile(r"\b(" + "TO" + "DO|FIX" + r"ME|XXX)\b")


def undocumented(source: str) -> list[str]:
    """The file, and every public function and class at its top, says what it is."""
    tree = ast.parse(source)
    found = [] if ast.get_docstring(tree) or not tree.body else ["the file has no docstring"]
    for node in tree.body:
        public = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and not node.name.startswith("_")
        if public and not ast.get_docstring(node):
            found.append(f"line {node.lineno}: {node.name} has no docstring")
    return found


def late_keys(source: str) -> list[str]:
    """Sources of randomness come first among the parameters; a `key: str` is a name and may stand anywhere."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            positional = [*node.args.posonlyargs, *node.args.args]
            if positional and positional[0].arg in ("self", "cls"):
                positional = positional[1:]
            for parameter in [*positional[1:], *node.args.kwonlyargs]:
                annotation = ast.unparse(parameter.annotation) if parameter.annotation else ""
                if parameter.arg in ("key", "rng") and "str" not in annotation:
                    found.append(f"line {node.lineno}: {node.name} takes {parameter.arg} later than first")
    return found


def too_long(source: str) -> list[str]:
    """A file is one idea."""
    lines = len(source.splitlines())
    return [f"{lines} lines, expected at most {LONGEST}: which two ideas are in it?"] if lines > LONGEST else []


def unfinished(source: str) -> list[str]:
    """What is left to do is an issue, not a comment."""
    return [f"line {number}: {line.strip()}" for number, line in enumerate(source.splitlines(), 1) if UNFINISHED.search(line)]


def unsafe(source: str) -> list[str]:
    """Nothing that runs code is ever loaded from a file."""
    found = []
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        elif (
            isinstance(node, ast.keyword)
            and node.arg == "allow_pickle"
            and not (isinstance(node.value, ast.Constant) and node.value.value is False)
        ):
            found.append(f"line {node.value.lineno}: allow_pickle")
        found += [f"line {node.lineno}: imports {name}" for name in names if name.split(".")[0] in UNSAFE_MODULES]
    return found


RULES: dict[Callable[[str], list[str]], str] = {
    undocumented: "def f(x): return x",
    late_keys: '"""."""\ndef f(size, key): "."',
    too_long: "x = 1\n" * (LONGEST + 1),
    unfinished: "x = 1  # TO" + "DO: better",
    unsafe: "import pickle",
}
"""Each rule, and a fault that it must find."""


def files() -> list[Path]:
    """Every Python file of the four packages."""
    return [path for package in PACKAGES for path in sorted((REPO / package).rglob("*.py"))]


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_style(rule: Callable[[str], list[str]]) -> None:
    found = [f"{path.relative_to(REPO)}: {fault}" for path in files() for fault in rule(path.read_text(encoding="utf-8"))]
    assert found == [], "\n".join(found)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_a_planted_fault_is_found(rule: Callable[[str], list[str]]) -> None:
    assert rule(RULES[rule])


@pytest.mark.parametrize(
    ("rule", "source"),
    [
        (late_keys, "def f(self, key): pass\ndef g(key, *, size): pass\ndef h(store, key: str): pass"),
        (unsafe, "import numpy as np\nnp.load('x', allow_pickle=False)"),
        (undocumented, '"""A file."""\ndef _f(): pass\nclass A:\n    """A."""\n    def method(self): pass'),
    ],
)
def test_good_style_passes(rule: Callable[[str], list[str]], source: str) -> None:
    assert rule(source) == []


def test_constraints_are_plain_pins() -> None:
    lines = (REPO / "constraints.txt").read_text(encoding="utf-8").splitlines()
    odd = [line for line in lines if line and not line.startswith("#") and not re.fullmatch(r"[a-z0-9-]+==[A-Za-z0-9.+]+", line)]
    assert odd == []
