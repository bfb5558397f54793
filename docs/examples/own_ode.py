"""An equation of one's own, benchmarked against every solver: the Brusselator, a chemical clock."""

import matplotlib.pyplot as plt

from polhode.harness.work_precision import WorkPrecision
from polhode.models.problem import Problem


def brusselator(ops):
    """Vector field y' = f(y, p), written once for all kinds of number; time would be one more component, of rate 1."""

    def rhs(y, p):
        reaction = y[0] * y[0] * y[1]
        return p[0] + reaction - (p[1] + 1) * y[0], p[1] * y[0] - reaction

    return rhs


problem = Problem("brusselator", brusselator, start=(1.5, 3.0), end=20.0, parameters=(1.0, 3.0))

if __name__ == "__main__":
    study = WorkPrecision(problem, tolerances=(1e-4, 1e-6, 1e-8, 1e-10), max_seconds=2.0)
    print(study.frame[["solver", "tolerance", "status", "error", "seconds", "rhs_calls"]].to_string(index=False))
    study.plot(plt.figure(figsize=(9, 5)).gca()).legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.01, 1))
    plt.savefig("brusselator.png", dpi=120, bbox_inches="tight")
    print("drawn: brusselator.png")
