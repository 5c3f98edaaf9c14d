# SPDX-License-Identifier: MIT
"""`itr fit`: coefficients of a law of rubber from several tests at once. Asks the command for the response of the law, writes
fit.json (the material of a scene) and fit.svg, and warns where the law softens. The first argument is the command `itr`."""

import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np
from laws import LAWS
from scipy.optimize import least_squares, nnls

# Powers of the first stretch by test, all without change of volume.
PATHS = {"uniaxial": (1, -0.5, -0.5), "biaxial": (1, 1, -2), "planar": (1, 0, -1)}
USUAL_RATIO = 1000  # of bulk to shear modulus, where no test tells it
CHECKED = np.exp(np.linspace(np.log(0.2), np.log(8), 400))  # stretches


def fail(place, found, expected):
    print(f"itr: {place}: found {found}; expected {expected}", file=sys.stderr)
    sys.exit(2)


def read_options(words):
    parser = argparse.ArgumentParser("itr fit", allow_abbrev=False, formatter_class=argparse.RawTextHelpFormatter)
    parser.description, add = "coefficients of a law of rubber from several tests at once", parser.add_argument
    add("law", choices=LAWS, help="type, see docs/theory.md")
    add("--terms", type=int, default=3, help="of Yeoh and Ogden (default: 3)")
    for test in PATHS:
        add(f"--{test}", metavar="FILE", help="CSV with the columns `stretch` (or `strain`, the stretch - 1) and `stress` (nominal)")
    add("--volumetric", metavar="FILE", help="CSV with the columns `J` (volume by that at rest) and `pressure`")
    add("--bulk", type=float, help=f"bulk modulus (default: of the volumetric test, else {USUAL_RATIO} shear moduli)")
    add("-o", "--output", default="fit", help="folder (default: fit); stresses are in the unit of the files")
    options = parser.parse_args(words)
    if options.terms < 1 or options.terms > 6:
        fail("--terms", options.terms, "1 to 6")
    if options.bulk is not None and not options.bulk > 0:
        fail("--bulk", options.bulk, "a number > 0")
    return options


def read_table(path, names):
    """The columns of the first of `names` that the file has, each a pair, and that pair."""
    try:
        lines = [line.split("#")[0].strip() for line in pathlib.Path(path).read_text().splitlines()]
    except OSError as error:
        fail(path, error.strerror, "a CSV file")
    lines = [line for line in lines if line]
    if lines and ";" in lines[0]:  # the other form of CSV, in which a comma is a decimal point
        lines = [line.replace(",", ".").replace(";", ",") for line in lines]
    rows = [[word.strip() for word in line.split(",")] for line in lines]
    header = rows[0] if rows else []
    pair = next((pair for pair in names if set(pair) <= set(header)), None)
    if not pair:
        fail(f"{path}: first line", ", ".join(header) or "nothing", " or ".join(" and ".join(pair) for pair in names))
    columns = [header.index(name) for name in pair]
    values = []
    for number, row in enumerate(rows[1:], start=1):
        try:
            if len(row) > len(header):
                raise ValueError
            values.append([float(row[c]) for c in columns])
        except (ValueError, IndexError):
            fail(f"{path}: row {number} below the first", ", ".join(row), f"numbers of {' and '.join(pair)}")
    if len(values) < 2 or not np.isfinite(values).all():
        fail(path, f"{len(values)} rows", "two or more of finite numbers")
    return np.transpose(values), pair


def read_tests(options):
    tests = {}
    for test in PATHS:
        if path := getattr(options, test):
            (first, stress), pair = read_table(path, [("stretch", "stress"), ("strain", "stress")])
            stretch = first + 1 if pair[0] == "strain" else first
            if stretch.min() <= 0:
                fail(f"{path}: {pair[0]}", f"{first.min():g}", "a stretch > 0")
            if not stress.any():
                fail(f"{path}: stress", "0 in all rows", "a stress that is not 0")
            tests[test] = stretch, stress
    if not tests:
        fail("itr fit", "no test of shear", "one or more of --uniaxial, --biaxial, --planar")
    return tests


class Responses:
    """The law as the command evaluates it, in a process of its own."""

    def __init__(self, itr):
        self.process = subprocess.Popen([itr, "respond"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def at(self, material, strains):
        """W, three Kirchhoff stresses and the upper triangle of their derivatives, a row for each row of strains."""
        question = {"material": material, "strains": np.asarray(strains).tolist()}
        self.process.stdin.write(json.dumps(question) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit(self.process.wait() or 3)
        return np.array([[np.nan if value is None else value for value in row] for row in json.loads(line)])

    def stress(self, material, test, stretch):
        """Nominal stress of an incompressible body that is free of stress across."""
        rows = self.at(material, np.outer(np.log(stretch), PATHS[test]))
        return (rows[:, 1] - rows[:, 3]) / stretch


class Fit:
    """Least squares of stresses, each test relative to the root mean square of its stresses. Coefficients that stresses are
    linear in are solved for at each value of the others, from several starts."""

    def __init__(self, responses, law, tests, terms):
        self.responses, self.law, self.tests, self.terms = responses, law, tests, terms
        self.scales = {test: np.linalg.norm(stress) for test, (_, stress) in tests.items()}
        self.target = np.concatenate([stress / self.scales[test] for test, (_, stress) in tests.items()])

    def model(self, linear, others):
        material = {"type": self.law.type, "K": 1, **self.law.coefficients(list(linear), list(others))}
        return np.concatenate([self.responses.stress(material, test, stretch) / self.scales[test]
                               for test, (stretch, _) in self.tests.items()])

    def solve_linear(self, others):
        """The linear coefficients that fit best, and what they leave."""
        count = self.law.num_linear(self.terms)
        columns = np.array([self.model(row, others) for row in np.eye(count)]).T
        if not np.isfinite(columns).all():
            return np.ones(count), np.full(len(self.target), 1e3)
        # A little of the coefficients' size is added, so that columns that hardly differ do not cancel.
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1
        padded = np.vstack([columns / size, 1e-6 * np.eye(count)]), np.concatenate([self.target, np.zeros(count)])
        scaled = nnls(*padded)[0] if self.law.is_positive else np.linalg.lstsq(*padded, rcond=None)[0]
        return scaled / size, columns @ (scaled / size) - self.target

    def best(self):
        found = []
        for start in self.law.starts(self.terms):
            if not len(start):
                found.append((0, np.array(start)))
                continue
            low, high = self.law.bounds(self.terms)
            result = least_squares(lambda others: self.solve_linear(others)[1], start, bounds=(low, high), x_scale=1 + np.abs(start))
            found.append((result.cost, result.x))
        others = min(found, key=lambda pair: pair[0])[1]
        linear, rest = self.solve_linear(others)
        return self.law.coefficients(list(linear), list(others)), np.linalg.norm(rest) / np.sqrt(len(self.tests))


def bulk_modulus(options, shear):
    """The bulk modulus and where it is from; pressures are K/2 (1/J - J)."""
    if options.bulk:
        return options.bulk, "--bulk"
    if not options.volumetric:
        return USUAL_RATIO * shear, f"{USUAL_RATIO} shear moduli: no test tells it"
    (J, pressure), _ = read_table(options.volumetric, [("J", "pressure")])
    if J.min() <= 0:
        fail(f"{options.volumetric}: J", f"{J.min():g}", "a number > 0")
    form = (1 / J - J) / 2
    K = form @ pressure / (form @ form) if form.any() else 0
    if not K > 0:
        fail(options.volumetric, f"a bulk modulus of {K:g}", "pressures that grow as J falls")
    left = np.linalg.norm(K * form - pressure) / np.linalg.norm(pressure)
    return K, f"the volumetric test, which it fits to {100 * left:.2g} %"


def softening(responses, material):
    """By test the stretches, tension apart from compression, at which the law is not stable by Drucker's postulate: somewhere
    stress does no work on a strain that keeps the volume."""
    keep = np.array([[1, 0], [0, 1], [-1, -1]]) @ np.linalg.inv(np.linalg.cholesky([[2, 1], [1, 2]])).T
    found = {}
    for test, powers in PATHS.items():
        rows = responses.at(material, np.outer(np.log(CHECKED), powers))
        C = rows[:, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(-1, 3, 3)
        least = np.linalg.eigvalsh(keep.T @ C @ keep)[:, 0]
        for word, side in (("tension", CHECKED >= 1), ("compression", CHECKED < 1)):
            bad = CHECKED[side & ~(least > 0)]
            if len(bad):
                found[f"{test} {word}"] = (float(bad.min()), float(bad.max()))
    return found


def words_of(place, low, high):
    if place.endswith("tension") and high >= CHECKED[-1]:
        return f"in {place} from a stretch of {low:.3g} on"
    if place.endswith("compression") and low <= CHECKED[0]:
        return f"in {place} below a stretch of {high:.3g}"
    return f"in {place} at stretches of {low:.3g} to {high:.3g}"


def draw(path, responses, material, tests, soft):
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "itr", "font.size": 8})
    figure = Figure(figsize=(3.4 * len(tests), 3), layout="constrained")
    for place, (test, (stretch, stress)) in enumerate(tests.items(), start=1):
        axes = figure.add_subplot(1, len(tests), place)
        shown = np.linspace(min(1, stretch.min()), max(1, stretch.max()), 200)
        axes.plot(stretch, stress, "o", color="#0072b2", markersize=3, label="test")
        axes.plot(shown, responses.stress(material, test, shown), color="#d55e00", label=material["type"])
        for name, (low, high) in soft.items():
            if name.startswith(test):
                axes.axvspan(max(low, shown[0]), max(min(high, shown[-1]), shown[0]), color="#999999", alpha=0.3, label="not stable")
        axes.set(xlabel="stretch", ylabel="nominal stress", title=test)
        axes.set_xlim(shown[0], shown[-1])
        axes.legend()
    figure.savefig(path, metadata={"Date": None})


def main(itr, words):
    options = read_options(words)
    tests, responses, law = read_tests(options), Responses(itr), LAWS[options.law]
    coefficients, error = Fit(responses, law, tests, options.terms).best()
    free = {"type": law.type, **coefficients, "K": 1}
    rest = responses.at(free, [[0, 0, 0]])[0]
    shear = (rest[4] - rest[5]) / 2
    if not shear > 0:
        fail("itr fit", f"a shear modulus of {shear:g} at rest", "tests of a law that is stable at rest; fewer --terms may help")
    K, source = bulk_modulus(options, shear)
    material = {"type": law.type, **coefficients, "K": K}
    soft = softening(responses, material)
    folder = pathlib.Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "fit.json").write_text(json.dumps(material, indent=1) + "\n")
    draw(folder / "fit.svg", responses, material, tests, soft)
    print(json.dumps(material))
    print(f"shear modulus {shear:.4g}, K {K:.4g} ({source})")
    print(f"stresses differ by {100 * error:.2g} % (root mean square, by that of each test)")
    for test, (stretch, stress) in tests.items():
        left = np.linalg.norm(responses.stress(material, test, stretch) - stress) / np.linalg.norm(stress)
        print(f"  {test}: {100 * left:.2g} %, stretches {stretch.min():.3g} to {stretch.max():.3g}")
    for place, (low, high) in soft.items():
        print(f"itr: warning: the law softens {words_of(place, low, high)}", file=sys.stderr)
    print(f"The material is in {folder / 'fit.json'}, the curves are in {folder / 'fit.svg'}")


main(sys.argv[1], sys.argv[2:])
