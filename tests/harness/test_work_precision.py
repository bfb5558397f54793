"""Work-precision studies of a problem and solvers of one's own: every failure comes with its reason."""

from polhode.harness.work_precision import WorkPrecision
from polhode.models.problem import Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status


def decay(ops):
    return lambda y, p: (-p[0] * y[0],)


class Idle(Solver):
    """Claims success without a step."""

    name = "idle"
    summary = accepts = ""
    library = package = "numpy"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        def integrate(record: Record) -> Outcome:
            return Status.REACHED_END, ""

        return integrate


def test_failures_stand_beside_successes_with_their_reasons():
    problem = Problem("decay", decay, start=(1.0,), end=3.0, parameters=(2.0,))
    frame = WorkPrecision(problem, solvers=["taylor", Idle()], tolerances=(1e-6,), samples=4).frame
    good, bad = frame.to_dict("records")
    assert (good["solver"], good["status"], good["error"] < 1e-5) == ("taylor", "reached_end", True)
    assert (bad["solver"], bad["status"]) == ("idle", "false_success")
    assert bad["message"] == "the library stopped at t = 0.0, expected 3.0"
