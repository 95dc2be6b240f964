"""Places of a TOML text: every key and value that tomllib reads, where it is written."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.laboratory.toml_places import line_and_column, places

TEXT = '''\
# a remark with [brackets] and a = "b"
name = "x" # and = here
a."b.c".'d e' = [1, [2, "]"], {q = "}", w.z=3 }, """mul " ti, ]
""", ] # end
date = 1979-05-27 07:32:00 # a blank inside
[ sensor ]
range.sigma = "30 m"
range.bias = '''
TEXT += "'''a\n'b'''' # quotes\n"
TEXT += """\
[[filter]]
name = 'a'
[filter.motion]
kind = 1
[[filter.inner]]
x = 1
[[filter.inner]]
x = 2
[[filter]]
name = ""
e = \"\"\"\"a\\\\\"\"\"\"
"ключ \\u0041" = true
"""


def every(value, path=()):
    """Paths and values of everything in what tomllib reads."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    for key, each in inner:
        yield (*path, key), each
        if isinstance(each, dict | list):
            yield from every(each, (*path, key))


def check(text):
    """Every path is found, nothing else, and what stands there reads as the key and the value."""
    raw, found = tomllib.loads(text), places(text)
    expected = dict(every(raw))
    assert found.keys() == expected.keys()
    for path, value in expected.items():
        place = found[path]
        if isinstance(path[-1], str):
            key = text[slice(*place.key)]
            assert tomllib.loads(f"{key} = 0") == {path[-1]: 0}
        if not isinstance(value, dict | list) or place.key != place.value:
            written = text[slice(*place.value)]
            assert tomllib.loads(f"v = {written}")["v"] == value


def test_a_file_with_everything_toml_has():
    check(TEXT)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\n\n# only remarks",
        "a = 1",
        "a = []\nb = {}\nc = [[], [{}]]",
        'a = ""\n"" = \'\'',
        "a = [\n1, # one\n2 # two\n]\n",
        "a.b.c = 1\na.b.d = 2\n[a.e]\nf = 3",
        "[a]\n[a.b]\nc=1\n[d]\n",
        "[[a]]\n[[a]]\nb=1\n[a.c]\nd = 2\n[[a]]\n",
        'a = "\\"#\\\\"\nb = \'\\\'\n',
        "x = +1.5e-3\ny = -inf\nz = 0xff\nt = 07:32:00\n",
    ],
)
def test_odd_texts(text):
    check(text)


KEYS = st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=6)
TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=12)
SCALARS = st.integers(-9, 10**6) | st.floats(allow_nan=False) | st.booleans() | TEXTS
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3)
)


@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_whatever_a_library_writes(content):
    import tomli_w

    check(tomli_w.dumps(content))
    check(tomli_w.dumps(content, multiline_strings=True).replace("\r\n", "\n").replace("\r", ""))


def test_lines_and_columns_count_from_one():
    assert line_and_column("ab\ncd", 0) == (1, 1)
    assert line_and_column("ab\ncd", 1) == (1, 2)
    assert line_and_column("ab\ncd", 3) == (2, 1)
    assert line_and_column("ab\ncd", 4) == (2, 2)
