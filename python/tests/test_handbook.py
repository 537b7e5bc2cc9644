"""Every block of Python in the handbook's chapter runs, one after the other."""

import re

import pytest

import misfit
from conftest import ROOT


def test_the_chapter_runs(tmp_path, monkeypatch):
    text = (ROOT / "docs/src/python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) >= 8
    misfit.load(ROOT / "studies/08-two-effects").save(tmp_path / "studies/08-two-effects")
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        try:
            exec(compile(block, "python.md", "exec"), names)
        except Exception as e:
            pytest.fail(f"{e!r} in\n{block}")
    assert names["found"].verdict == "missing" and names["done"].success and (tmp_path / "loop.png").is_file()


def test_the_wheel_of_the_chapter_is_the_one_that_is_built():
    named = re.search(r"wheels/(misfit-[\w.-]+\.whl)", (ROOT / "docs/src/python.md").read_text()).group(1)
    assert (ROOT / "target/wheels" / named).is_file(), "python/run-tests builds it"
