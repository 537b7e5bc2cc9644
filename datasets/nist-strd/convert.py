"""Converts NIST's Statistical Reference Datasets for nonlinear regression into TOML, one file per problem.

Usage: python convert.py <folder with the .dat files> <output folder>

The .dat files are works of the United States government (public domain); the source distribution of lmfit carries them in NIST_STRD/.
Numbers are copied digit for digit, never through a float.
"""
import re
import sys
from pathlib import Path


def lines_of(text, what):
    """The 1-based inclusive range the file's own header gives for `what`."""
    first, last = re.search(what + r"\s+\(lines\s+(\d+)\s+to\s+(\d+)\)", text).groups()
    return int(first), int(last)


def number(word):
    """NIST's spelling as a TOML float: '15.00E0', '1E0', '.5' and '-.4' all occur."""
    mantissa, _, exponent = word.upper().partition("E")
    sign = "-" if mantissa.startswith("-") else ""
    mantissa = mantissa.lstrip("+-")
    whole, _, part = mantissa.partition(".")
    whole = whole.lstrip("0") or "0"
    out = f"{sign}{whole}.{part or '0'}"
    if exponent and int(exponent):
        out += f"e{int(exponent)}"
    assert float(out) == float(word), (word, out)
    return out


def convert(path):
    text = path.read_text()
    lines = text.splitlines()
    first, last = lines_of(text, "Starting Values")
    rows = [re.split(r"[=\s]+", line.strip()) for line in lines[first - 1:last]]
    assert all(row[0] == f"b{i + 1}" for i, row in enumerate(rows)), rows
    first, last = lines_of(text, "Data")
    data = [line.split() for line in lines[first - 1:last] if line.strip()]
    labelled = lambda label: re.search(label + r":\s+(\S+)", text).group(1)
    assert len(data) == int(labelled("Number of Observations")), path
    difficulty = re.search(r"(Lower|Average|Higher) Level of Difficulty", text).group(1).lower()
    out = [
        f"# NIST StRD nonlinear regression: {path.stem} (public domain; converted by convert.py)",
        f'name = "{path.stem}"',
        f'difficulty = "{difficulty}"',
        f"starts = [[{', '.join(number(r[1]) for r in rows)}], [{', '.join(number(r[2]) for r in rows)}]]",
        f"certified = [{', '.join(number(r[3]) for r in rows)}]",
        f"certified_std = [{', '.join(number(r[4]) for r in rows)}]",
        f"certified_rss = {number(labelled('Residual Sum of Squares'))}",
        f"y = [{', '.join(number(r[0]) for r in data)}]",
        "# one list per predictor",
        f"x = [{', '.join('[' + ', '.join(number(r[c]) for r in data) + ']' for c in range(1, len(data[0])))}]",
    ]
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:3])
    for path in sorted(source.glob("*.dat")):
        (target / f"{path.stem}.toml").write_text(convert(path))
