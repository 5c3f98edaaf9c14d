#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""`itr fit` on tests that known laws make. Argument: the command."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

ITR = sys.argv.pop()
UNIAXIAL, BIAXIAL, PLANAR = (1, -0.5, -0.5), (1, 1, -2), (1, 0, -1)
STRETCHES = np.linspace(0.7, 3, 24)


def stress_of(slope, powers, stretch):
    """Nominal stress of an incompressible body, of s dW/ds = slope(s)."""
    return (slope(stretch ** powers[0], stretch, powers) - slope(stretch ** powers[2], stretch, powers)) / stretch


def ogden(mus, alphas):
    return lambda s, *_: sum(m * s**a for m, a in zip(mus, alphas))


def yeoh(C):
    def slope(s, stretch, powers):
        x = sum(stretch ** (2 * p) for p in powers) - 3
        return 2 * s**2 * sum((i + 1) * c * x**i for i, c in enumerate(C))
    return slope


class FitTest(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = pathlib.Path(self.temporary.name)

    def write(self, name, header, *columns):
        path = self.folder / name
        path.write_text("\n".join([header, *(",".join(f"{value:.12g}" for value in row) for row in zip(*columns)), ""]))
        return path

    def made_by(self, slope, **paths):
        words = []
        for name, powers in paths.items():
            words += [f"--{name}", self.write(f"{name}.csv", "stretch,stress", STRETCHES, stress_of(slope, powers, STRETCHES))]
        return words

    def fit(self, law, *words, status=0):
        done = subprocess.run([ITR, "fit", law, *map(str, words), "-o", self.folder / "out"], capture_output=True, text=True)
        self.assertEqual(done.returncode, status, done.stderr)
        material = self.folder / "out/fit.json"
        return (json.loads(material.read_text()) if material.exists() else None), done

    def test_semicolons_leave_commas_to_decimals(self):
        words = self.made_by(yeoh([0.4]), uniaxial=UNIAXIAL)
        wanted, _ = self.fit("Yeoh", "--terms", 1, *words)
        words[1].write_text(words[1].read_text().replace(",", ";").replace(".", ","))
        found, _ = self.fit("Yeoh", "--terms", 1, *words)
        self.assertEqual(found, wanted)
        words[1].write_text("stretch,stress\n1,0\n1,5,0,7\n")
        _, done = self.fit("Yeoh", "--terms", 1, *words, status=2)
        self.assertIn("row 2 below the first: found 1, 5, 0, 7", done.stderr)

    def test_yeoh_is_found_from_three_tests_and_its_bulk_modulus_from_a_fourth(self):
        J = np.linspace(0.9, 1, 6)
        squeezed = self.write("volume.csv", "J,pressure", J, 700 / 2 * (1 / J - J))
        words = self.made_by(yeoh([0.4, -0.01, 0.002]), uniaxial=UNIAXIAL, biaxial=BIAXIAL, planar=PLANAR)
        material, done = self.fit("Yeoh", *words, "--volumetric", squeezed)
        np.testing.assert_allclose(material["C"], [0.4, -0.01, 0.002], rtol=1e-6, atol=1e-9)
        self.assertAlmostEqual(material["K"], 700, places=6)
        self.assertEqual(material["type"], "Yeoh")
        self.assertIn("biaxial", (self.folder / "out/fit.svg").read_text())
        self.assertNotIn("warning", done.stderr)

    def test_ogden_has_the_stresses_of_the_law_that_made_the_tests(self):
        slope = ogden([0.63, 0.0012, -0.01], [1.3, 5, -2])
        material, _ = self.fit("Ogden", *self.made_by(slope, uniaxial=UNIAXIAL, biaxial=BIAXIAL), "--terms", 3)
        found = ogden(material["mus"], material["alphas"])
        for powers in (UNIAXIAL, BIAXIAL, PLANAR):  # planar tension is told by the others
            expected = stress_of(slope, powers, STRETCHES)
            left = stress_of(found, powers, STRETCHES) - expected
            self.assertLess(np.linalg.norm(left), 0.005 * np.linalg.norm(expected))
        shear = sum(m * a for m, a in zip(material["mus"], material["alphas"])) / 2
        self.assertAlmostEqual(material["K"] / shear, 1000, places=5)
        self.assertTrue(all(m * a >= 0 for m, a in zip(material["mus"], material["alphas"])))

    def test_strains_and_other_laws(self):
        slope = ogden([2 * 0.3, -2 * 0.1], [2, -2])  # Mooney and Rivlin's
        strained = self.write("strain.csv", "time,strain,stress", STRETCHES, STRETCHES - 1, stress_of(slope, UNIAXIAL, STRETCHES))
        material, _ = self.fit("IsochoricMooneyRivlin", "--uniaxial", strained, "--bulk", 50)
        self.assertAlmostEqual(material["c1"], 0.3, places=6)
        self.assertAlmostEqual(material["c2"], 0.1, places=6)
        self.assertEqual(material["K"], 50)
        chains, _ = self.fit("ArrudaBoyce", *self.made_by(yeoh([0.5, 0.05 / 9, 0.0]), uniaxial=UNIAXIAL))
        self.assertGreater(chains["lambda_m"], 1.01)

    def test_a_law_that_softens_is_warned_of_where_it_does(self):
        _, done = self.fit("Yeoh", *self.made_by(yeoh([0.5, -0.03]), uniaxial=UNIAXIAL), "--terms", 2)
        line = next(line for line in done.stderr.splitlines() if "uniaxial tension" in line)
        start = float(line.split("stretch of ")[1].split()[0])
        # By symmetry the first strain that stress does no work on is that of the test, where the true stress begins to fall.
        s = np.linspace(1, 8, 7001)
        true_stress = s * stress_of(yeoh([0.5, -0.03]), UNIAXIAL, s)
        self.assertAlmostEqual(start, s[np.argmax(np.gradient(true_stress, s) < 0)], delta=0.03)

    def test_wrong_files_are_named(self):
        def refused(text, *parts):
            path = self.folder / "wrong.csv"
            path.write_text(text)
            error = self.fit("Yeoh", "--uniaxial", path, status=2)[1].stderr
            for part in ("wrong.csv", *parts):
                self.assertIn(part, error)

        refused("force,length\n1,2\n", "force, length", "stretch and stress")
        refused("stretch,stress\n1,0\n2,x\n", "row 2", "2, x")
        refused("stretch,stress\n1,0\n2\n", "row 2")
        refused("strain,stress\n0,0\n-1.5,-3\n", "-1.5", "stretch > 0")
        refused("stretch,stress\n1,0\n2,0\n", "stress", "0 in all rows")
        self.assertIn("--uniaxial", self.fit("Yeoh", status=2)[1].stderr)
        self.assertIn("invalid choice", self.fit("SaintVenant", status=2)[1].stderr)
        self.assertIn("no-such.csv", self.fit("Yeoh", "--planar", "no-such.csv", status=2)[1].stderr)


if __name__ == "__main__":
    unittest.main()
