"""No code runs because of what a log or a file says, and nothing is offered to other machines unasked.

What cannot be told from the code's own words is tried: templates escape, YAML makes no objects.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.discovery import load_yaml
from rose2_logs.outputs.report import page

PACKAGE = Path(__file__).parents[1] / "rose2_logs"
FILES = sorted(PACKAGE.rglob("*.py"))
TEMPLATES = sorted((PACKAGE / "outputs" / "report" / "templates").iterdir())

MODULES = (
    *("pickle", "_pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"),
    *("multiprocessing.managers", "xmlrpc", "socketserver", "http.server"),
    *("xml.etree", "xml.dom", "lxml"),
)
"""They make objects of bytes, serve, or read XML with all its entities."""
ALLOWED = {
    # Between a run and its own workers, over pipes and files that only they can open: nobody else's bytes.
    "system/shared_memory.py": ("imports pickle",),
    # Of pictures that were drawn here, see the next tests.
    "outputs/report/page.py": ("markupsafe.Markup",),
    # One file, at an address that nobody can guess, to the viewer's page on this machine.
    "outputs/rerun/viewer.py": (
        "imports http.server.BaseHTTPRequestHandler",
        "imports http.server.ThreadingHTTPServer",
    ),
    # Of an empty text, see the next tests.
    "cli/main.py": ("exec",),
}
CALLS = (
    *("eval", "exec", "compile", "__import__", "os.system", "os.popen"),
    *("subprocess.getoutput", "subprocess.getstatusoutput", "asyncio.create_subprocess_shell"),
    *("yaml.unsafe_load", "yaml.unsafe_load_all", "yaml.full_load", "yaml.full_load_all", "yaml.load_all"),
    *("multiprocessing.connection.Listener", "multiprocessing.connection.Client"),
    *("pandas.read_pickle", "tempfile.mktemp", "markupsafe.Markup"),
)
OPTIONS = {"shell": "False", "allow_pickle": "False", "autoescape": "True"}
"""What they may be set to, if at all."""
SAFE_LOADERS = ("SafeLoader", "CSafeLoader")
EVERY_ADDRESS = "0.0.0.0"


def imports(tree: ast.Module) -> dict[str, str]:
    """Names that a file gives to what it imports, and what that is in full."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for each in node.names:
                found[each.asname or each.name] = each.name
        elif isinstance(node, ast.ImportFrom):
            found |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
    return found


def breaches(code: str, name: str = "a.py") -> list[str]:
    """Tell what a file does that it must not."""
    tree = ast.parse(code)
    known = imports(tree)
    found = [
        f"imports {module}"
        for module in known.values()
        if any(f"{module}.".startswith(f"{each}.") for each in MODULES)
    ]
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            found += _breaches_of_call(node, known)
        elif isinstance(node, ast.Attribute) and known.get(ast.unparse(node.value)) == "yaml":
            is_loader = node.attr.endswith("Loader")
            found += [f"yaml.{node.attr}"] if is_loader and node.attr not in SAFE_LOADERS else []
        elif isinstance(node, ast.Constant) and node.value == EVERY_ADDRESS:
            found.append(EVERY_ADDRESS)
    return [each for each in found if each not in ALLOWED.get(name, ())]


def _breaches_of_call(call: ast.Call, known: dict[str, str]) -> Iterator[str]:
    name, dot, rest = ast.unparse(call.func).partition(".")
    called = known.get(name, name) + dot + rest
    options = {each.arg: ast.unparse(each.value) for each in call.keywords}
    yield from (
        f"{name}={options[name]}" for name, only in OPTIONS.items() if options.get(name, only) != only
    )
    if called in CALLS:
        yield called
    elif called == "yaml.load" and len(call.args) + len(call.keywords) < 2:
        yield "yaml.load without a loader"
    elif called == "jinja2.Environment" and "autoescape" not in options:
        yield "jinja2.Environment without autoescape"
    elif called.endswith((".bind", "HTTPServer")) and ast.unparse(call.args[0]).startswith("('',"):
        yield "binds to every address"


def test_no_file_does_what_it_must_not():
    """Neither pickle, eval, a shell, unsafe YAML nor markup of its own, and it serves this machine alone."""
    names = {path.relative_to(PACKAGE).as_posix(): path.read_text(encoding="utf-8") for path in FILES}
    assert {name: found for name, code in names.items() if (found := breaches(code, name))} == {}
    assert set(ALLOWED) <= set(names), "what is allowed to a file that is no longer there"


def test_what_must_not_be_done_is_found():
    forbidden = [
        "import pickle",
        "from pickle import loads",
        "import multiprocessing.managers",
        "import xml.etree.ElementTree as ET",
        "eval('1')",
        "import os\nos.system('ls')",
        "from os import system as run\nrun('ls')",
        "import subprocess\nsubprocess.run('ls', shell=True)",
        "import subprocess as sp\nsp.getoutput('ls')",
        "import numpy as np\nnp.load('a', allow_pickle=True)",
        "import yaml\nyaml.load(text)",
        "import yaml\nyaml.load(text, yaml.Loader)",
        "import yaml\nyaml.unsafe_load(text)",
        "import tempfile\ntempfile.mktemp()",
        "import jinja2\njinja2.Environment(loader=None)",
        "from jinja2 import Environment\nEnvironment(autoescape=False)",
        "from markupsafe import Markup\nMarkup(name)",
        "serve(host='0.0.0.0')",
        "sock.bind(('', 80))",
        "ThreadingHTTPServer(('', 80), Handler)",
    ]
    assert [code for code in forbidden if not breaches(code)] == []


def test_what_may_be_done_is_not():
    allowed = [
        "import subprocess\nsubprocess.run(['ls'])",
        "import yaml\nyaml.load(text, yaml.SafeLoader)\nyaml.safe_load(text)\nyaml.safe_dump(1)",
        "from jinja2 import Environment\nEnvironment(autoescape=True)",
        "sock.bind(('127.0.0.1', 80))",
        "ThreadingHTTPServer(('127.0.0.1', 80), Handler)",
        "import re\nre.compile('a')",
        "from xml.sax import saxutils",
    ]
    assert [code for code in allowed if breaches(code)] == []


def test_one_place_makes_markup():
    """It gets what the drawing modules wrote; see the tests with hostile names for what they write."""
    code = (PACKAGE / "outputs" / "report" / "page.py").read_text(encoding="utf-8")
    assert len(re.findall(r"\bMarkup\(", code)) == 1


def test_no_text_is_executed():
    """For how CPython ends upon an interrupt, an empty one is."""
    code = (PACKAGE / "cli" / "main.py").read_text(encoding="utf-8")
    assert re.findall(r"\bexec\(.*?\)", code) == ['exec("")']


UNSAFE_IN_TEMPLATES = {
    "escaping switched off": r"\|\s*(safe|xmlattr|tojson)\b|autoescape|Markup",
    "a value without quotes": r"=\s*\{\{",
    "a program in an attribute": r"\bon\w+\s*=\s*[\"'{]",
    "a script that makes elements of text or loads something": (
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|https?://"
    ),
    "a value in a script or style": r"<(script|style)\b(?:(?!</\1>).)*\{\{",
}


def test_templates_leave_escaping_on():
    """Values in attributes stand in quotes, none in a script, and scripts make no elements of texts."""
    found = [
        f"{path.name}: {what}"
        for path in TEMPLATES
        for what, pattern in UNSAFE_IN_TEMPLATES.items()
        if re.search(pattern, path.read_text(encoding="utf-8"), re.DOTALL)
    ]
    assert found == []


def test_what_is_unsafe_in_a_template_is_found():
    unsafe = [
        *("{{ name | safe }}", "<a href={{ name }}>", '<a onclick="go()">', "node.innerHTML = text"),
        "<script>\nlet name = '{{ name }}'\n</script>",
    ]
    found = [
        [bool(re.search(pattern, text, re.DOTALL)) for pattern in UNSAFE_IN_TEMPLATES.values()]
        for text in unsafe
    ]
    assert [any(each) for each in found] == [True] * len(unsafe)
    assert [any(each) for each in zip(*found, strict=True)] == [True] * len(UNSAFE_IN_TEMPLATES)
    fine = '<script>let a = 1</script><b title="{{ name }}">{{ name }}</b><style>b {}</style>'
    assert not [what for what, pattern in UNSAFE_IN_TEMPLATES.items() if re.search(pattern, fine, re.DOTALL)]


def test_templates_escape(monkeypatch, tmp_path: Path):
    (tmp_path / "a.html.j2").write_text('<b title="{{ name }}">{{ name }}</b>')
    monkeypatch.setattr(page, "TEMPLATES", tmp_path)
    assert (
        page.render("a.html.j2", name="\"'<&>")
        == '<b title="&#34;&#39;&lt;&amp;&gt;">&#34;&#39;&lt;&amp;&gt;</b>'
    )


def test_pages_may_load_nothing():
    """Were a name to become markup after all, the page's own policy lets it fetch and send nothing."""
    text = (PACKAGE / "outputs" / "report" / "templates" / "base.html.j2").read_text(encoding="utf-8")
    assert "Content-Security-Policy\" content=\"default-src 'none'; img-src data:;" in text


@pytest.mark.parametrize("value", ["!!python/object/apply:os.getcwd []", "!!python/name:os.system"])
def test_yaml_makes_no_objects(value: str, tmp_path: Path):
    described = tmp_path / "map.yaml"
    described.write_text(f"image: {value}\n")
    with pytest.raises(InvalidMapError, match="could not determine a constructor"):
        load_yaml(described)
    assert yaml.unsafe_load(described.read_text())["image"] is not None
