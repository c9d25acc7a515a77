"""The exported table is read as it was written, and one that cannot be used is refused by name."""

import gzip
import json
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import synthetic
from baselines.samples import TableError, read

HEADER = ('run,recording,part,test slow,"test fast, hot",time_s,position_rad,velocity_rad_s,acceleration_rad_s2,effort_Nm,'
          'temperature_C,load_Nm,mass,"predicted full + network, f64",rigid inertia\n')
ROWS = ("0,first.csv,train,0,0,0,1.5,2,3,4,30,5,0.5,4.5,3\n"
        '0,"a, b",test,1,1,0.01,-1.5,-2,-3,-4,31,-5,0.5,-4.5,-3\n'
        "1,second.csv,unused,0,0,0,0,0,0,NaN,0,0,0.5,0,0\n")


class Table(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def written(self, text, name="table.csv"):
        path = os.path.join(self.folder.name, name)
        with (gzip.open if name.endswith(".gz") else open)(path, "wt") as file:
            file.write(text)
        return path

    def test_columns_are_found_by_name_plain_and_compressed(self):
        for name in ("table.csv", "table.csv.gz"):
            samples = read(self.written(HEADER + ROWS, name))
            self.assertEqual(samples.unit, "Nm")
            self.assertEqual(list(samples.part), ["train", "test", "unused"])
            self.assertEqual({name: list(mask) for name, mask in samples.tests.items()},
                             {"slow": [False, True, False], "fast, hot": [False, True, False]})
            np.testing.assert_array_equal(samples.velocity, [2, -2, 0])
            np.testing.assert_array_equal(samples.temperature, [30, 31, 0])
            np.testing.assert_array_equal(samples.rigid["inertia"], [3, -3, 0])
            np.testing.assert_array_equal(samples.predictions["full + network, f64"], [4.5, -4.5, 0])

    def test_what_cannot_be_used_is_refused_by_name(self):
        for text, words in (
            (HEADER.replace("part", "use") + ROWS, "no column part"),
            (HEADER.replace("effort_Nm", "torque_Nm") + ROWS, "0 columns effort_"),
            ((HEADER + ROWS).replace("validation", "x").replace("train", "training"), "part.*training.*expected"),
            ((HEADER + ROWS).replace("-4,31", "NaN,31"), "column effort_Nm has a value that is no number"),
            ("", "no column part"),
        ):
            with self.subTest(words), self.assertRaisesRegex(TableError, words):
                read(self.written(text))

    def test_the_program_writes_json_and_refuses_in_one_line(self):
        samples = synthetic.joint(count=800)
        rows = zip(samples.part, samples.tests["last quarter"], samples.position, samples.velocity, samples.effort,
                   *samples.rigid.values())
        text = "part,test end,position_rad,velocity_rad_s,effort_Nm,rigid inertia,rigid gravity_sine\n"
        text += "".join(f"{part},{int(test)}," + ",".join(map(repr, map(float, more))) + "\n" for part, test, *more in rows)
        table, out = self.written(text), os.path.join(self.folder.name, "errors.json")
        run = lambda *more: subprocess.run([sys.executable, "-m", "baselines", *more], capture_output=True, text=True)
        self.assertEqual(run(table, "--out", out, "--seeds", "1", "--steps", "5").stderr, "")
        with open(out) as file:
            found = json.load(file)
        self.assertEqual([test["name"] for test in found["tests"]], ["end"])
        self.assertLess(found["tests"][0]["baselines"]["a"]["rmse"], 1.2 * synthetic.NOISE)
        for more, words in (([os.path.join(self.folder.name, "none.csv")], "none.csv"),
                            ([table, "--seeds", "0"], "--seeds is 0, must be 1 to 100"),
                            ([table, "--seeds", "101"], "--seeds is 101, must be 1 to 100"),
                            ([table, "--most", "199"], "--most is 199, must be 200 to 1000000")):
            refused = run(*more)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn(words, refused.stderr)
            self.assertNotIn("Traceback", refused.stderr)


if __name__ == "__main__":
    unittest.main()
