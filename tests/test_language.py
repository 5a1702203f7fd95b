"""Plain English: heads of docstrings are no fragments, and errors say what must be."""

import ast
import re
from pathlib import Path

import chilopod

SOURCES = Path(chilopod.__file__).parent
ROOT = Path(__file__).resolve().parent.parent
HEAD = re.compile(r"(Of|That|Whose|What|Whether|Which)\b")
FRAGMENT = re.compile(r"(Of|That|Whose|What|Whether|Which|Where|When|Why|Who|How)\b")
ERRORS = re.compile(r"(Parameter|Analysis|RobotFile|Output|Thread|Unit|Cluster|Unsound|Extra)Error|require")
WORDS = re.compile(r"\b(problem|allowed|reason)\b")
RIDDLE = re.compile(
    r" (is|are) (no|none)\b| there (is|are) (no|none)\b| says otherwise| has none\b|^ (That|What|Who|Which)\b"
)
TERM = re.compile(r"[\w*`]+(, [\w*`]+)*")


def descriptions(docstring):
    """First lines of the descriptions of parameters, attributes and results of a docstring of numpydoc's form."""
    lines = docstring.split("\n")
    for term, line in zip(lines, lines[1:], strict=False):
        deeper = len(line) - len(line.lstrip()) > len(term) - len(term.lstrip())
        if deeper and TERM.fullmatch(term.strip()):
            yield line.strip()


def fragments(source):
    """First lines of docstrings, and of the descriptions in them, that begin with a fragment."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            text = node.value.value
            yield from (line for line in text.split("\n")[:1] if HEAD.match(line))
            yield from (line for line in descriptions(text) if FRAGMENT.match(line))


def test_descriptions_begin_with_a_noun():
    found = {str(path): list(fragments(path.read_text(encoding="utf-8"))) for path in SOURCES.rglob("*.py")}
    assert {name: lines for name, lines in found.items() if lines} == {}


def test_a_fragment_is_found():
    source = 'def f(x):\n    """Do it.\n\n    Parameters\n    ----------\n    x\n        That of chilopod.\n    """\n'
    assert list(fragments(source)) == ["That of chilopod."]
    assert list(fragments(source.replace("Do it.", "Whether it is done."))) == [
        "Whether it is done.",
        "That of chilopod.",
    ]


def riddles(source):
    """Texts of errors that say what something is not, where an error says what it must be."""
    for node in ast.walk(ast.parse(source)):
        call = isinstance(node, ast.Call) and ERRORS.fullmatch(ast.unparse(node.func).rpartition(".")[2])
        words = isinstance(node, ast.Assign) and WORDS.search(ast.unparse(node.targets[0]))
        if call or words:
            texts = (each.value for each in ast.walk(node) if isinstance(each, ast.Constant))
            yield from (text for text in texts if isinstance(text, str) and RIDDLE.search(f" {text.lstrip()}"))


def test_errors_say_what_must_be():
    found = {str(path): list(riddles(path.read_text(encoding="utf-8"))) for path in SOURCES.rglob("*.py")}
    assert {name: texts for name, texts in found.items() if texts} == {}


def test_a_riddle_is_found():
    assert list(riddles('raise ParameterError("is no number", value=1)')) == ["is no number"]
    assert list(riddles('problem, value = "is none", 1')) == ["is none"]
    assert list(riddles('errors.AnalysisError(f"{name}: there are none")')) == [": there are none"]
    assert list(riddles('ParameterError("must be a number", field="there is no"), ValueError("is none")')) == [
        "there is no"
    ]


def long_lines(page):
    """Numbers of the lines of prose that have more than 120 characters; tables, code and pictures may."""
    code = False
    for number, line in enumerate(page.split("\n"), 1):
        code ^= line.lstrip().startswith("```")
        if len(line) > 120 and not (code or line.lstrip().startswith(("|", "![", "<!--")) or line.startswith("     ")):
            yield number


def test_lines_of_pages_are_short():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]  # `make bench` writes its page
    found = {str(path): list(long_lines(path.read_text(encoding="utf-8"))) for path in pages}
    assert {name: lines for name, lines in found.items() if lines} == {}


def test_a_long_line_is_found():
    assert list(long_lines(f"short\n{'long ' * 25}\n| {'cell ' * 25} |\n```\n{'code ' * 25}\n```\n")) == [2]
