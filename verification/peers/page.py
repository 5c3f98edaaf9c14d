# SPDX-License-Identifier: MIT
"""Tables of README.md and the plot, from results.csv and references.csv."""
import math

from methods import CASES, SAME_REFERENCE, WHY

TITLES = {"sphere": "half sphere, 3D", "sphere_section": "half sphere, section", "ring": "ring", "ironing": "ironing",
          "punch": "punch", "hertz": "cylinder on block", "press_fit": "press fit", "snap_hook": "snap hook", "block": "block pressed, 3D"}
COLOURS = {"ITR": "tab:blue", "CalculiX": "tab:orange", "GetFEM": "tab:green"}


def percent(text):
    return f"{100 * float(text):.3g} %" if text else ""


def runs_table(rows):
    lines = ["| problem | code | elements | level | unknowns | value | error | bar | processor s | iterations | increments | set |",
             "|" + "---|" * 12]
    for r in rows:
        value, seconds = (r["value"], r["processor_seconds"]) if r["value"] else ("no solution", "")
        lines.append(f"| {TITLES[r['case']]} | {r['code']} | {r['elements']} | {r['level']} | {r['unknowns']} | {value} "
                     f"| {percent(r['error'])} | {percent(r['bar'])} | {seconds} | {r['iterations']} | {r['increments']} | {r['settings']} |")
    return "\n".join(lines)


def references_table(references):
    lines = ["| problem | reference | worth | source |", "|---|---|---|---|"]
    for r in references:
        names = [TITLES[case] for case in CASES if SAME_REFERENCE.get(case, case) == r["case"]]
        lines.append(f"| {', '.join(names)} | {r['reference']} | {percent(float(r['worth']) / float(r['reference']))} | {r['source']} |")
    return "\n".join(lines)


def series(rows, case):
    """(code, elements) -> [(seconds, |error|)] by level. An error counts no less than those of finer levels: where errors change
    their sign, one may be small by chance."""
    found = {}
    for r in rows:
        if r["case"] == case and r["error"]:
            found.setdefault((r["code"], r["elements"]), []).append((float(r["processor_seconds"]), max(abs(float(r["error"])), 1e-6)))
    return {key: [(s, max(e for _, e in points[k:])) for k, (s, _) in enumerate(points)] for key, points in found.items()}


def seconds_for(points, error):
    """Between the levels by powers, or of the coarsest where that is good enough; None where no level is."""
    if points[0][1] <= error:
        return points[0][0]
    for (s0, e0), (s1, e1) in zip(points, points[1:]):
        if e1 <= error:
            return s0 * (s1 / s0) ** (math.log(e0 / error) / math.log(e0 / e1))
    return None


def fastest(rows, case, code, error):
    times = [(s, elements) for (c, elements), points in series(rows, case).items() if c == code
             if (s := seconds_for(points, error)) is not None]
    return min(times, default=None)


def equal_errors(rows, references):
    """For each problem the error that all codes reach, and 1 % where that is smaller, but none below ten times what the reference is
    worth: (case, error, code -> (seconds, elements))."""
    worth = {r["case"]: float(r["worth"]) / float(r["reference"]) for r in references}
    for case in CASES:
        own = series(rows, case)
        codes = sorted({code for code, _ in own}, key=list(COLOURS).index)
        if len(codes) < 2:
            continue
        common = max(min(e for (c, _), points in own.items() if c == code for _, e in points) for code in codes)
        least = 10 * worth.get(SAME_REFERENCE.get(case, case), 0)
        common = round_up(max(common, least))
        for error in sorted({common, max(common, 0.01)}, reverse=True):
            yield case, error, {code: fastest(rows, case, code, error) for code in codes}


def round_up(error):
    """To two digits."""
    unit = 10.0 ** (math.floor(math.log10(error)) - 1)
    return math.ceil(error / unit * (1 - 1e-9)) * unit


def equal_table(rows, references):
    lines = ["| problem | error | ITR s | CalculiX s | GetFEM s | first | why ITR is not |", "|" + "---|" * 7]
    for case, error, times in equal_errors(rows, references):
        cells = [f"{times[c][0]:.2g} ({times[c][1]})" if times.get(c) else "" for c in COLOURS]
        first = min((t[0], code) for code, t in times.items() if t)[1]
        why = "" if first == "ITR" else WHY.get(case, "not known")
        lines.append(f"| {TITLES[case]} | {percent(error)} | {' | '.join(cells)} | {first} | {why} |")
    return "\n".join(lines)


def count_first(rows, references):
    """How many rows of the table at equal error, and in how many ITR is first."""
    firsts = [min((t[0], code) for code, t in times.items() if t)[1] for _, _, times in equal_errors(rows, references)]
    return len(firsts), firsts.count("ITR")


def draw(rows, path):
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "peers"
    import matplotlib.pyplot as plt
    cases = [case for case in CASES if series(rows, case)]
    figure, axes = plt.subplots(math.ceil(len(cases) / 3), 3, figsize=(11, 3 * math.ceil(len(cases) / 3)), squeeze=False)
    for place in axes.ravel()[len(cases):]:
        place.axis("off")
    for place, case in zip(axes.ravel(), cases):
        for (code, elements), points in series(rows, case).items():
            place.loglog(*zip(*points), "o-" if elements == "quadratic" else "o--", color=COLOURS[code], markersize=4,
                         mfc=COLOURS[code] if elements == "quadratic" else "white")
        place.set_title(TITLES[case], fontsize=10)
        place.grid(alpha=0.3)
    for place in axes[:, 0]:
        place.set_ylabel("error")
    for place in axes[-1]:
        place.set_xlabel("processor seconds")
    handles = [plt.Line2D([], [], color=colour, marker="o", label=code) for code, colour in COLOURS.items()]
    handles += [plt.Line2D([], [], color="grey", linestyle=s, label=e) for s, e in (("--", "linear"), ("-", "quadratic"))]
    figure.legend(handles=handles, loc="lower center", ncols=5, frameon=False)
    figure.tight_layout(rect=(0, 0.04, 1, 1))
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def referee_table(rows):
    """A row a quantity: what is published, and values with bars by level."""
    by_quantity = {}
    for row in rows:
        by_quantity.setdefault((row["problem"], row["quantity"], row["published"]), {})[int(row["level"])] = row
    lines = ["| problem | quantity | published | level 0 | level 1 | level 2 | largest sources on the finest |", "|---|---|---|---|---|---|---|"]
    for key, levels in by_quantity.items():
        if not key[2] and len(levels) == 1:
            continue
        words = [f"{levels[k]['value']} ± {levels[k]['bar'] or 'no bar'}" if k in levels else "" for k in range(3)]
        lines.append(f"| {' | '.join((*key, *words, levels[max(levels)]['sources']))} |")
    return "\n".join(lines)


def put(text, name, table):
    begin, end = f"<!-- {name} -->\n", f"<!-- end {name} -->"
    before, rest = text.split(begin)
    return before + begin + table + "\n" + end + rest.split(end)[1]


def write(rows, references, folder):
    path = folder / "README.md"
    text = path.read_text()
    total, first = count_first(rows, references)
    text = put(text, "count", f"In {first} of these {total} rows ITR is first.")
    for name, table in (("equal", equal_table(rows, references)), ("references", references_table(references)), ("runs", runs_table(rows))):
        text = put(text, name, table)
    path.write_text(text)
    draw(rows, folder / "error.svg")
