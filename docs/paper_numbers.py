"""Write `docs/paper.md` from `docs/paper_template.md`: every number as the reports say it.

A number is what a group of a regular expression finds on a page of the reports; pages follow from
data, as tests hold. `python docs/paper_numbers.py` writes the page. Where a page no longer says a
number, a line names it, and the exit code is 1.
"""

import re
import sys
from pathlib import Path
from string import Template
from textwrap import fill

from polhode.models.catalogue import FORMS
from polhode.solvers.catalogue import SOLVERS

ROOT = Path(__file__).parents[1]
TEMPLATE = ROOT / "docs" / "paper_template.md"
PAPER = ROOT / "docs" / "paper.md"
# Columns of the page.
WIDTH = 120
# By page: what it says, with a named group for each number.
SAYINGS = {
    "reports/hybrid/README.md": (
        r"At St = 1e6, .*? it was (?P<hybrid_spheroids>\S+) times as fast in the median of "
        r"(?P<hybrid_spheroid_count>\d+) spheroids",
        r"At St = 1e6, .*?; (?P<hybrid_ellipsoids>\S+) times as fast in the median of "
        r"(?P<hybrid_ellipsoid_count>\d+) triaxial bodies",
        r"- There it was (?P<hybrid_splitting>\S+) times as fast as `splitting`",
        r"The tables of a triaxial shape took (?P<hybrid_tables>\d+ \S+) in the median",
    ),
    "README.md": (
        r"the fastest explicit one takes (?P<explicit_slow>\S+) times as long as the fastest implicit",
    ),
    "reports/regimes/README.md": (
        r"The ellipsoid, slow variables: implicit solvers win (?P<implicit_cells>\d+) cells from "
        r"St = (?P<implicit_from>\S+) to (?P<implicit_to>\S+) ",
        r"The ellipsoid, slow variables: .*?explicit solvers win (?P<explicit_cells>\d+) cells from "
        r"St = (?P<explicit_from>\S+) to (?P<explicit_to>\S+) \(by (?P<explicit_lead>\S+) × ",
    ),
    "reports/accuracy/README.md": (
        r"an error of L and E below (?P<prolate_half>\S+) in half of \d+ bodies of kind prolate",
        r"an error of L and E below (?P<oblate_half>\S+) in half of \d+ bodies of kind oblate",
    ),
    "reports/solvers/README.md": (
        r"\| 100 +\| dop853 +\|.*\| +(?P<dop853_python>\S+) \| +\S+ \|\n",
        r"\| 100 +\| radau +\|.*\| +(?P<radau_python>\S+) \| +\S+ \|\n",
        r"One right-hand side alone takes (?P<rhs_alone>[\d.]+ \S+) \(alone\), "
        r"(?P<rhs_called>[\d.]+ \S+) \(compiled, called from Python\), "
        r"(?P<rhs_python>[\d.]+ \S+) \(plain Python\)",
        r"CyRK, without the interpreter, is the fastest at (?P<cyrk_first>\d+) of (?P<places>\d+) ",
        r"heyoka, without the interpreter, is the fastest at (?P<heyoka_first>\d+) of ",
        r"SUNDIALS, without the interpreter, is the fastest at (?P<sundials_first>\d+) of ",
    ),
    "reports/stiff/README.md": (
        r"called back through Python the same run takes × (?P<called_back>\S+) as long",
    ),
    "reports/problems/README.md": (
        r"of (?P<problems>\d+) problems that some method solves\. (?P<problems_robust>[^.]+?) "
        r"reach(?:es)? the error most often, on (?P<problems_share>\S+) %.*?The error is 1e-6",
    ),
    "reports/pick/stated.md": (r"- (?P<stated>\d+) of (?P<stated_runs>\d+) runs state an error",),
    "docs/false-successes.md": (
        r"- Runs: (?P<success_runs>\d+),",
        r"Off by more than 0.1 of I_max and 1 % of the largest L or E: (?P<doubtful>\d+) before",
        r"Caught: (?P<caught>\d+) by the run's own error estimate",
        r"Still called a success: 0, ",
        r"it is exceeded in (?P<exceeded>\S+) %",
    ),
    "reports/pick/README.md": (
        r"The first choice met the error on (?P<pick_met>\d+) of (?P<pick_scenes>\d+) scenes",
        r"Asking and running take (?P<pick_total>\S+) times as long as plain practice",
        r"(?P<pick_median>\S+) times in the median of these scenes",
        r"From runs of (?P<break_even>\S+ \S+) on asking pays .*?: (?P<paying>\d+) of (?P<longer>\d+) scenes",
        r"Best run below 10 ms: the first choice is within 1.5 times the best on (?P<near_short>\S+) %",
        r"Best run 10 ms to 1 s: the first choice is within 1.5 times the best on (?P<near_long>\S+) %",
    ),
    "reports/hard-cases/README.md": (
        r"none of the (?P<solver_count>\d+) that take most of the cases got through all of them\. "
        r"(?P<hard_best>[^.]+) comes? nearest, with (?P<hard_through>\d+) of (?P<hard_runs>\d+)",
    ),
    "reports/second-order/README.md": (
        r"Spheroids, (?P<order_starts>\d+) starts: the error of L and E falls like "
        r"St\^-(?P<order_from>\S+) to St\^-(?P<order_to>\S+), where second order predicts St\^-2",
        r"L² = 2EI₂, (?P<triaxial_starts>\d+) starts: the error of L and E falls like "
        r"St\^-(?P<triaxial_from>\S+) to St\^-(?P<triaxial_to>\S+), where second order",
    ),
    "reports/flows/README.md": (
        r"- (?P<flow_orbits>\d+) orbits in planar flows close after the period of theory to "
        r"(?P<flow_closes>\S+);",
        r"Of (?P<flow_runs>\d+) random runs, .*?, (?P<flow_share>[\d.]+)\s?% stay within",
    ),
    "reports/paper/README.md": (
        r"(?P<items>\d+) items: (?P<confirmed>\d+) confirmed, (?P<sharpened>\d+) sharpened, "
        r"(?P<corrected>\d+) corrected, (?P<measured>\d+) measured, (?P<undecided>\d+) undecided",
    ),
}


class NotSaidError(ValueError):
    """A page does not say a number; the message names both."""


def numbers() -> dict[str, str]:
    """Every number by its name in the template."""
    said = {"forms": str(len(FORMS)), "solvers": str(len(SOLVERS))}
    for page, sayings in SAYINGS.items():
        text = (ROOT / page).read_text(encoding="utf-8")
        for saying in sayings:
            match = re.search(saying, text)
            if match is None:
                raise NotSaidError(f"{page}: does not say any more {saying!r}")
            said |= match.groupdict()
    return said


def filled(paragraph: str) -> str:
    """Lines of a paragraph, each as long as it may be; points of a list are paragraphs of their own."""
    points = re.split(r"\n(?=- |\d+\. )", paragraph)
    lines = []
    for point in points:
        mark = re.match(r"(?:- |\d+\. )?", point)
        indent = " " * len(mark[0]) if mark else ""
        lines.append(
            fill(
                " ".join(point.split()),
                WIDTH,
                subsequent_indent=indent,
                break_long_words=False,
                break_on_hyphens=False,
            )
        )
    return "\n".join(lines)


def paper() -> str:
    """The page, with today's numbers."""
    text = Template(TEMPLATE.read_text(encoding="utf-8")).substitute(numbers())
    return "\n\n".join(map(filled, text.strip().split("\n\n"))) + "\n"


def main() -> int:
    """Write the page."""
    try:
        text = paper()
    except NotSaidError as error:
        print(error, file=sys.stderr)
        return 1
    PAPER.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
