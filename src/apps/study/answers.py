# SPDX-License-Identifier: MIT
"""From rows to sentences: what is doubtful, which run to take for an error, where remeshing pays, what rules, which solver."""

import math
from collections import namedtuple
from functools import cached_property

from plan import ALL_SERIES, REFERENCE
from results import JUDGED, MEASURES, Results

LARGE_ERROR = 0.5  # by the reference's size: beyond it a run is no approximation
HIGHEST_ORDER = 4  # of linear elements, and of steps of remeshing, with room
HIGHEST_QUADRATIC_ORDER = 5  # energies of quadratic elements have 4
RUNGS = 18  # errors in a table, at most
LINEAR, QUADRATIC = ("uniform", "rows"), ("uniform-p2",)  # series of uniform refinement

Point = namedtuple("Point", "row error cost")  # of a run with an error and a cost, both positive


def front(found):
    """Points that no other run beats in both."""
    kept = []
    for point in reversed(found):
        if not kept or point.cost < kept[-1].cost:
            kept.append(point)
    return kept[::-1]


def cost_at(best, error):
    """Cost of an error, by straight lines of a front in logarithms; its first for larger errors; None for smaller ones."""
    if not best or error < best[-1].error:
        return None
    after = next(i for i, point in enumerate(best) if point.error <= error)
    if after == 0:
        return best[0].cost
    a, b = best[after - 1], best[after]
    return a.cost * (b.cost / a.cost) ** (math.log(error / a.error) / math.log(b.error / a.error))


def slope(found):
    """Slope of the logarithm of the error over that of the cost; NaN where all cost the same."""
    u, v = [math.log(point.cost) for point in found], [math.log(point.error) for point in found]
    n, x, xx = len(u), sum(u), sum(a * a for a in u)
    spread = n * xx - x * x
    return (n * sum(a * b for a, b in zip(u, v)) - x * sum(v)) / spread if spread > 1e-12 * n * xx else math.nan


def rungs_below(value):
    """Numbers ..., 0.1, 0.2, 0.5, 1, ... from the largest not above `value`, downward."""
    top = math.floor(3 * math.log10(value)) + 1
    ladder = ((1, 2, 5)[r % 3] * 10.0 ** (r // 3) for r in range(top, top - RUNGS - 2, -1))
    return [rung for rung in ladder if rung <= value][:RUNGS]


def is_uniform(row):
    return row.run.series.name in LINEAR + QUADRATIC


def is_impossible(order):
    """Whether an order is beyond what meshes can do: then it is not meshes that the errors are of."""
    return order["in_size"] > (HIGHEST_QUADRATIC_ORDER if order["series"] in QUADRATIC else HIGHEST_ORDER)


def in_words(verdict, measure):
    series, show = ALL_SERIES[verdict["series"]], measure.show
    head = f"{measure.label}, `{series.name}` ({series.what}):"
    if not verdict["is_recommended"]:
        return head + " nothing is recommended."
    told = [point for point in verdict["points"] if not point["is_large"]]
    last, finest = told[-1], verdict["finest_uniform"]

    def interval(points, key):
        values = [point[key] for point in points]
        if key == "error":
            first, last = show(values[0]), show(values[-1])
            return f"at {first}" if first == last else f"from {first} to {last}"
        return " to ".join(dict.fromkeys((f"{min(values):.2g}", f"{max(values):.2g}")))

    text = [head]
    if compared := [p for p in told if None not in (p["time_ratio"], p["unknowns_ratio"])]:
        text.append(
            f"{interval(compared, 'time_ratio')} of uniform refinement's time at equal error, with "
            f"{interval(compared, 'unknowns_ratio')} of its unknowns, {interval(compared, 'error')}."
        )
    if quadratic := [p for p in told if p["quadratic_ratio"] is not None]:
        text.append(f"{interval(quadratic, 'quadratic_ratio')} of the time that it takes with quadratic elements.")
    if last["time_ratio"] is None and last["quadratic_ratio"] is None:
        text.append(
            f"{show(last['error'])} takes it {last['seconds']:.3g} s; uniform refinement has come to "
            f"{show(finest['error'])} after {finest['seconds']:.3g} s."
        )
    if beaten := ", ".join(f"`{p['run']}` by `{p['beaten_by']}`" for p in told if p["beaten_by"]):
        text.append(f"Beaten in both error and time: {beaten}.")
    pays, untold, largest = verdict["pays_from"], verdict["untold_from"], told[0]["error"]
    if untold == largest:
        return " ".join([*text, "Whether it pays, a finer uniform level would tell."])
    here = f"It pays {'at all of these errors' if pays == largest else f'from {show(pays)} on'}" if pays else "It does not pay here"
    return " ".join([*text, here + (f"; from {show(untold)} on a finer uniform level would tell." if untold else ".")])


class Uniform:
    """Costs of uniform refinement, by fronts."""

    def __init__(self, answers, measure, with_quadratic=True):
        self.linear = front(answers.points(LINEAR, measure, reached=True))
        self.unknowns = front(answers.points(LINEAR, measure, "unknowns", reached=True))
        self.quadratic = front(answers.points(QUADRATIC, measure, reached=True)) if with_quadratic else []
        last = [best[-1] for best in (self.linear, self.quadratic) if best]
        self.finest = last and {"error": min(p.error for p in last), "seconds": max(p.cost for p in last)}

    def cost_at(self, error):
        costs = cost_at(self.linear, error), cost_at(self.quadratic, error)
        return min((cost for cost in costs if cost), default=None)


class Answers(Results):
    """Says what the rows of a study tell, once all of them are there."""

    def points(self, series, measure, cost="processor_seconds", reached=False):
        """Points of these series (None: of all that vary the mesh), the largest error first, but of the reference, and of runs that
        are not certified or in which a body flies. `reached`: errors that are not told are the reference's own, if not less."""
        found = []
        for row in self.rows:
            of = row.run.series
            if of.name == REFERENCE or not (of.name in series if series else of.varies_mesh):
                continue
            error = row.errors and row.errors[measure.name] if reached else self.told_error(row, measure)
            if reached and self.worth and error is not None:
                error = max(error, self.worth[measure.name] or 0)
            if error and getattr(row, cost) > 0 and row.certified and not self.flies(row):
                found.append(Point(row, error, getattr(row, cost)))
        return sorted(found, key=lambda point: -point.error)

    def is_large(self, row, measure):
        return (self.relative_error(row, measure) or 0) > LARGE_ERROR

    def nearest(self, measure):
        """The least error of a run by the reference's size, or infinity where no run is told of."""
        # A reference without a size cannot be far away.
        return min((self.relative_error(p.row, measure) or 0 for p in self.points(None, measure)), default=math.inf)

    @cached_property
    def orders(self):
        """Orders of series of at least three runs: error = C * size^in_size, error = C * seconds^-in_seconds."""
        found = []
        for name in (name for name, series in ALL_SERIES.items() if series.varies_mesh):
            for measure in MEASURES:
                seconds = self.points((name,), measure)
                if len(seconds) >= 3:
                    in_size = -self.dim * slope(self.points((name,), measure, "unknowns"))
                    order = {"series": name, "measure": measure.name, "in_size": in_size, "in_seconds": -slope(seconds)}
                    found.append(order | {"runs": len(seconds)})
        return found

    def can_recommend(self, measure, series="uniform"):
        """Whether anything is recommended by these errors: some run is near the reference, and the orders of uniform refinement and
        of the series are possible."""
        if self.refused or self.nearest(measure) > LARGE_ERROR:
            return False
        names = ("uniform", series)
        return not any(is_impossible(o) for o in self.orders if o["measure"] == measure.name and o["series"] in names)

    def judge(self, name, measure):
        """Cost of a series against uniform refinement at equal error; None where either has no run. `pays_from`: the largest error
        from which on all of its runs take less time than either uniform refinement. `untold_from`: the largest error at which it
        takes longer than the finest uniform run, whose error is larger still, so that what uniform refinement would take is not
        known."""
        uniform = Uniform(self, measure, name not in QUADRATIC)
        own = self.points((name,), measure)
        if not own or not uniform.finest:
            return None
        best, told, pays_from, untold_from = front(own), [], None, None
        for row, error, seconds in own:
            ratios = {
                "time_ratio": (seconds, cost_at(uniform.linear, error)),
                "quadratic_ratio": (seconds, cost_at(uniform.quadratic, error)),
                "unknowns_ratio": (row.unknowns, cost_at(uniform.unknowns, error)),
            }
            point = {"run": row.run.name, "error": error, "seconds": seconds}
            point |= {key: cost / by if by else None for key, (cost, by) in ratios.items()}
            better = (p.row.run.name for p in best if p.error <= error and p.cost <= seconds and p.row is not row)
            told.append(point | {"beaten_by": next(better, None), "is_large": self.is_large(row, measure)})
            if told[-1]["is_large"]:
                continue
            cost = uniform.cost_at(error)
            if seconds < (cost or uniform.finest["seconds"]):
                pays_from = pays_from or error
            elif cost:
                pays_from = None
            else:
                untold_from = untold_from or error
        is_recommended = self.can_recommend(measure, name) and not all(point["is_large"] for point in told)
        verdict = {"series": name, "measure": measure.name, "points": told, "is_recommended": is_recommended}
        verdict |= {"pays_from": pays_from if is_recommended else None, "untold_from": untold_from}
        return verdict | {"finest_uniform": uniform.finest}

    @cached_property
    def verdicts(self):
        names = [s.name for s in ALL_SERIES.values() if s.kind == "tolerances" or s.name in ("sizing-field", *QUADRATIC)]
        return list(filter(None, (self.judge(name, measure) for measure in JUDGED for name in names)))

    def time_step_answers(self, measure):
        """Compares the runs with dt and dt/2, beside the error of the mesh."""
        measured = [row for row in self.rows if row.errors and row.errors[measure.name] is not None]
        steps = [row for row in measured if row.run.series.kind == "time"][:2]
        # Takes the level with the mesh of these runs, the finest but one.
        levels = [row for row in measured if row.run.series.name == "uniform" and row.vertices == steps[0].vertices] if steps else []
        errors = [row.errors[measure.name] for row in steps + levels[-1:]]
        if len(errors) == 3 and 0 not in errors[:2]:
            whole, half, mesh = map(measure.show, errors)
            yield (
                f"{measure.label}, on the mesh of {levels[-1].run.name}: {steps[0].run.label} is {whole} off dt/4, "
                f"{steps[1].run.label} is {half} off; the mesh's own error is {mesh}. "
                f"So {'the time step' if errors[0] > errors[2] else 'the mesh'} rules."
            )

    def answers(self):
        for measure in JUDGED:
            if self.can_recommend(measure):
                yield from (in_words(verdict, measure) for verdict in self.verdicts if verdict["measure"] == measure.name)
            yield from self.time_step_answers(measure)
        solvers = [row for row in self.rows if row.run.series.kind == "solvers" and not row.reason]
        if solvers:
            solvers.sort(key=lambda row: row.processor_seconds)
            times = ", ".join(f"{row.run.label} {row.processor_seconds:.3g}" for row in solvers)
            errors = [row.errors["h1"] for row in solvers if row.errors]
            agree = f"; their H1 errors agree to {1 - min(errors) / max(errors):.1e} of it" if any(errors) else ""
            yield f"Linear solvers, processor seconds without remeshing: {times}{agree}."
        failed = [row for row in self.rows if row.status != "finished"]
        if failed:
            reasons = (f"{row.run.name}: {row.reason or 'a frame has an intersection or an inversion'}" for row in failed)
            yield f"Failed: {'; '.join(reasons)}."

    def choices(self):
        """For each error of a ladder (measure, error, point, uniform refinement's cost): the cheapest run that reaches it, of those
        that a verdict says to pay at it; where none does, of uniform refinement, if that reaches it."""
        for measure in (measure for measure in JUDGED if self.can_recommend(measure)):
            judged = {v["series"]: v["is_recommended"] for v in self.verdicts if v["measure"] == measure.name}
            uniform = Uniform(self, measure)
            candidates = [
                point
                for point in self.points(None, measure, reached=True)
                if not self.is_large(point.row, measure) and judged.get(point.row.run.series.name, is_uniform(point.row))
            ]
            for target in rungs_below(candidates[0].error) if candidates else ():
                cost = uniform.cost_at(target)
                # Answers compare remeshing's run with a uniform mesh of its error, as this does.
                reach = [p for p in candidates if p.error <= target and (is_uniform(p.row) or not cost or p.cost < cost)]
                if not reach:
                    break
                yield measure, target, min(reach, key=lambda point: point.cost), cost

    def doubts_of_errors(self, measure):
        label, least = measure.label, self.nearest(measure)
        names = [f"`{p.row.run.name}`" for p in self.points(None, measure) if self.is_large(p.row, measure)]
        if LARGE_ERROR < least < math.inf:
            yield (
                f"{label}: no run is nearer to the reference than {100 * least:.3g} % of it. Either it or all runs are elsewhere; "
                "nothing is recommended."
            )
        elif names:
            are, them = ("are", "them") if len(names) > 1 else ("is", "it")
            yield (
                f"{label}: {', '.join(names)} {are} off by {100 * LARGE_ERROR:g} % and more of the reference; nothing is recommended of "
                f"{them}."
            )
        for order in self.orders:
            if order["measure"] == measure.name and is_impossible(order):
                yield (
                    f"{label}, `{order['series']}`: an order of {order['in_size']:.2g}, which no mesh gives; the errors come from "
                    "something else (another branch, a reference as coarse as the runs), and nothing is recommended of them."
                )

    def doubts(self):
        """Mistakes and gaps in reference and runs, the gravest first; the last says what the reference is worth."""
        rows = self.rows
        if self.refused:
            yield f"Nothing is said of errors: {self.reference} is no reference, since {self.refused}."
            return
        if flying := [row for row in rows if not row.reason and self.flies(row)]:
            yield (
                f"A body flies away, by up to {max(row.flight for row in flying):.3g} times the size of the scene, in "
                f"{', '.join(f'`{row.run.name}`' for row in flying)}: nothing seems to hold it. These runs are left out."
            )
        for measure, what in (("energy", "kinetic energy"), ("momentum", "momentum")):
            if any(row.errors and row.errors[measure] is None for row in rows):
                key = f"/output/paraview/options/{what.replace(' ', '_')}"
                yield f"Frames of the reference have no {what} ({key}): of the {measure} no errors are told."
        for measure in JUDGED:
            yield from self.doubts_of_errors(measure)
        if warned := sum(bool(row.warnings) for row in rows):
            yield f"{warned} of {len(rows)} runs gave warnings, listed below."
        reference = self.find(self.reference_run)
        if reference and not self.is_dynamic and not self.has_friction:
            # In equilibrium, of two states the one of lower potential is nearer to the limit.
            others = (row for row in rows if row.certified and row.run.reference == REFERENCE)
            best = min((reference, *others), key=lambda row: row.potential)
            if best is not reference:
                yield (
                    f"`{best.run.name}` ends with a potential lower than the reference's, by "
                    f"{reference.potential - best.potential:.2g} J: it is nearer to the limit, and the better reference "
                    "(`--reference`)."
                )
        if not self.worth:
            yield "What the reference is worth is not known: there is no second one to hold it against (`--second-reference`)."
            return
        own = ((measure, self.worth[measure.name]) for measure in JUDGED)
        text = ", ".join(f"{measure.show(error)} ({measure.name})" for measure, error in own if error is not None)
        by = self.second_reference
        yield f"The reference is worth {text}: by so much {by} differs from it. Smaller errors are not told."
