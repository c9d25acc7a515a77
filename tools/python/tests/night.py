"""Arguments, files and steps of fleet_on_ray, without Ray."""

import contextlib
import io
import os
import stat
import tempfile
import threading
import time
import unittest
import unittest.mock

from fleet_on_ray import __main__ as program, files, steps


class Place(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.place = place.name

    def write(self, name, content=b"x"):
        path = os.path.join(self.place, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "wb") as file:
            file.write(content)
        return path

    def read(self, name):
        with open(os.path.join(self.place, name), "rb") as file:
            return file.read()

    def script(self, text):
        """A program that stands for jointctl."""
        path = self.write("program", f"#!/bin/sh\n{text}\n".encode())
        os.chmod(path, stat.S_IRWXU)
        return path

    def options(self, **more):
        plain = dict(fleet=self.place, work=os.path.join(self.place, "new/_joints"), jointctl="/nowhere/jointctl",
                     program="p", presets=[], network=False, images=None, key=None, page=None,
                     stop=os.path.join(self.place, "_stop"))
        return plain | more


class Arguments(unittest.TestCase):
    def test_workers_and_retries_are_taken_up_to_their_limits(self):
        for option, low, high in (("--workers", 1, 4096), ("--retries", 0, 100)):
            for value, taken in ((low - 1, False), (low, True), (high, True), (high + 1, False)):
                with self.subTest(option=option, value=value), contextlib.redirect_stderr(io.StringIO()) as told:
                    try:
                        program.arguments(["fleet", f"{option}={value}"])
                        self.assertTrue(taken)
                    except SystemExit as end:
                        self.assertEqual((end.code, taken), (2, False))
                        self.assertIn(f"{value} is outside {low} to {high}", told.getvalue())


class Files(Place):
    def test_joints_are_folders_named_so(self):
        for name in ("joint=b/x", "joint=a/x", "joint=/x", "robot=c/x", "_sums/joint=d/x", "joint=file"):
            self.write(name)
        self.assertEqual(files.joints(self.place), ["a", "b"])
        with self.assertRaisesRegex(files.NightError, "nowhere: cannot be read"):
            files.joints(os.path.join(self.place, "nowhere"))

    def outcome(self, joint, text, image=b"image"):
        if image:
            self.write(f"_joints/{joint}/{joint}/friction.img", image)
        self.write(f"_joints/{joint}/retrain.json", b'{"joints":[' + text + b"]}")
        return joint, os.path.join(self.place, "_joints", joint)

    def test_outcomes_are_joined_in_their_order_as_the_text_that_they_are(self):
        folders = [self.outcome("b", b'{"error":1e-5}'), self.outcome("a", b'{"error":1.50}', None)]
        files.join(self.place, folders, False)
        self.assertEqual(self.read("retrain.json"), b'{"joints":[{"error":1e-5},{"error":1.50}]}')
        self.assertEqual(self.read("b/friction.img"), b"image")
        self.assertFalse(os.path.exists(os.path.join(self.place, "a")))
        files.join(self.place, [], True)
        self.assertEqual(self.read("retrain.json"), b'{"joints":[]}')

    def test_what_is_there_is_replaced_by_force_alone_and_the_same_is_no_change(self):
        folders = [self.outcome("a", b"{}")]
        files.join(self.place, folders, False)
        files.join(self.place, folders, False)
        self.write("a/friction.img", b"a user's")
        with self.assertRaisesRegex(files.NightError, "a/friction.img exists; --force replaces it"):
            files.join(self.place, folders, False)
        self.assertEqual(self.read("a/friction.img"), b"a user's")
        files.join(self.place, folders, True)
        self.assertEqual(self.read("a/friction.img"), b"image")

    def test_a_report_of_another_form_is_refused_with_its_path(self):
        self.write("x/retrain.json", b'{"joints": []}')
        with self.assertRaisesRegex(files.NightError, "x/retrain.json: expected"):
            files.outcomes(os.path.join(self.place, "x"))

    def test_one_night_at_a_time_works_on_a_folder(self):
        with self.assertRaisesRegex(files.NightError, "nowhere: cannot be read: No such file"):
            files.lock(os.path.join(self.place, "nowhere"))
        locked = files.lock(self.place)
        with self.assertRaisesRegex(files.NightError, "another night is at work there"):
            files.lock(self.place)
        os.close(locked)
        os.close(files.lock(self.place))


class Steps(Place):
    def test_an_error_is_the_last_line_and_a_signal_is_a_crash(self):
        failing = self.script("echo warning >&2; echo 'error: no folder' >&2; exit 2")
        self.assertEqual(steps.sums(self.options(jointctl=failing), "a"), {"error": "no folder"})
        silent = self.script("exit 7")
        self.assertEqual(steps.sums(self.options(jointctl=silent), "a"), {"error": "jointctl ended with 7"})
        with self.assertRaisesRegex(steps.Crashed, "program was ended by signal 9"):
            steps.sums(self.options(jointctl=self.script("kill -9 $$")), "a")
        self.assertIn("/nowhere/jointctl on ", steps.status(self.options())["error"])
        good = self.script('echo "$@"; echo told >&2')
        found = steps.sums(self.options(jointctl=good), "a b")
        self.assertEqual(found["output"], f"fleet sums {self.place} --joint=a b --threads=1 --json\n")
        self.assertEqual(found["warnings"], "told\n")

    def test_halves_of_processes_that_were_killed_are_removed_first_and_nothing_else(self):
        halves = ["_sums/joint=a.partial-7", "_sums/all.partial-7", "page.partial-7"]
        others = ["_sums/joint=a.parquet", "_sums/joint=b.partial-7", "page"]
        for name in halves + others:
            self.write(name)
        options = self.options(jointctl=self.script("true"), page=os.path.join(self.place, "page"))
        steps.sums(options, "a")
        steps.status(options)
        there = [name for name in halves + others if os.path.exists(os.path.join(self.place, name))]
        self.assertEqual(there, others)

    def test_a_step_of_a_night_that_is_stopped_ends_its_program_first(self):
        for text in ("trap 'echo > ended; exit 1' TERM; echo > began; while :; do sleep 0.05; done",
                     "trap '' TERM; echo > began; while :; do sleep 0.05; done"):
            options = self.options(jointctl=self.script(f"cd {self.place}; echo $$ > pid; {text}"))

            def stop():
                while not os.path.exists(os.path.join(self.place, "began")):
                    time.sleep(0.01)
                self.write("_stop")

            thread = threading.Thread(target=stop)
            thread.start()
            with unittest.mock.patch.multiple(steps, PATIENCE=0.5, LOOK=0.01):
                self.assertEqual(steps.sums(options, "a"), {"error": "the night was stopped"})
            thread.join()
            self.assertFalse(os.path.exists(f"/proc/{int(self.read('pid'))}"))
            os.remove(os.path.join(self.place, "began"))
            # What comes after it does not even begin.
            self.assertEqual(steps.sums(options, "a"), {"error": "the night was stopped"})
            self.assertFalse(os.path.exists(os.path.join(self.place, "began")))
            os.remove(options["stop"])
        self.assertTrue(os.path.exists(os.path.join(self.place, "ended")))

    def test_an_outcome_is_used_again_until_something_that_it_depends_on_changes(self):
        self.write("_sums/joint=a.parquet")
        self.write("old/a/friction.img")
        self.write("fleet.key")
        within = lambda name: os.path.join(self.place, name)
        options = self.options(images=within("old"), key=within("fleet.key"), jointctl=self.script(
            'for word in "$@"; do case $word in --out=*) mkdir -p "${word#--out=}"; echo >> ' + within("calls")
            + ";; esac; done"))
        found = steps.retrain(options, "a")
        calls = lambda: len(self.read("calls"))
        self.assertEqual((steps.retrain(options, "a"), calls()), (found, 1))
        changes = [
            lambda: self.write("_sums/joint=a.parquet", b"y"),
            lambda: self.write("old/a/friction.img", b"y"), lambda: self.write("fleet.key", b"y"),
            lambda: options.update(presets=["full"]), lambda: options.update(network=True),
            lambda: options.update(program="q"),
        ]
        for number, change in enumerate(changes, 2):
            change()
            self.assertNotIn(steps.retrain(options, "a"), [found])
            self.assertEqual(calls(), number)
        unwritten = self.options(jointctl=self.script("true"))
        self.assertIn("was not written", steps.retrain(unwritten, "a")["error"])

    def test_where_nothing_better_came_of_it_a_step_is_done_and_else_its_error_is_told(self):
        for code, expected in ((0, None), (3, None), (1, "it failed"), (2, "it failed")):
            options = self.options(jointctl=self.script(f"echo 'error: it failed' >&2; exit {code}"))
            self.assertEqual(steps.outcome(options, []).get("error"), expected, code)


if __name__ == "__main__":
    unittest.main()
