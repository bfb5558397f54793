"""An equation of one's own, benchmarked against every solver: the Brusselator, a chemical clock."""

import matplotlib.pyplot as plt

from polhode import Problem, WorkPrecision, solve_ivp


def brusselator(t, y, feed, rate):
    """Rates of the two concentrations, as SciPy's `solve_ivp` takes them."""
    reaction = y[0] ** 2 * y[1]
    return [feed + reaction - (rate + 1) * y[0], rate * y[0] - reaction]


problem = Problem.from_function(brusselator, y0=[1.5, 3.0], t_end=20.0, parameters=[1.0, 3.0])

if __name__ == "__main__":
    print(
        solve_ivp(
            brusselator, (0, 20), [1.5, 3.0], "cyrk-vern8", [10, 20], args=[1.0, 3.0], rtol=1e-10
        ).y
    )
    study = WorkPrecision(problem, tolerances=(1e-4, 1e-6, 1e-8), max_seconds=2.0)
    print(
        study.frame[["solver", "tolerance", "status", "error", "seconds", "rhs_calls"]].to_string(
            index=False
        )
    )
    study.plot(plt.figure(figsize=(9, 5)).gca()).legend(
        fontsize=7, loc="upper left", bbox_to_anchor=(1.01, 1)
    )
    plt.savefig("brusselator.png", dpi=120, bbox_inches="tight")
    print("drawn: brusselator.png")
