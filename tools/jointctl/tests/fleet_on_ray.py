"""A night on Ray gives the files of one process, whatever is killed meanwhile. Started by fleet_on_ray.rs, which makes
the fleet and the files that are expected."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

JOINTCTL, DATA, EXPECTED = (os.environ[name] for name in ("JOINTCTL", "FLEET", "EXPECTED"))
KILLS = int(os.environ.get("FLEET_KILLS", "4"))
LONG = 300.0
"""Longest time of a night on a busy machine, s."""


def tree(folder):
    """Every file below a folder with its bytes."""
    found = {}
    for place, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(place, name)
            with open(path, "rb") as file:
                found[os.path.relpath(path, folder)] = file.read()
    return found


def children(parent):
    """Processes by parent, with their command lines."""
    found = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat") as file:
                # Behind the name, which may hold blanks: state, parent.
                if int(file.read().rpartition(")")[2].split()[1]) != parent:
                    continue
            with open(f"/proc/{name}/cmdline") as file:
                found.append((int(name), file.read().replace("\0", " ").strip()))
        except (FileNotFoundError, ProcessLookupError):
            pass
    return found


def alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def until(condition, what, seconds=LONG):
    """The first result of `condition` that is true."""
    end = time.monotonic() + seconds
    while not (found := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"not within {seconds} s: {what}")
        time.sleep(0.002)
    return found


class Folder:
    """A fleet of its own, and its nights; `pause`, s, before each jointctl, for who has to come in time."""

    def __init__(self, test, *more, pause=0.0):
        self.root = tempfile.mkdtemp(dir=os.path.dirname(DATA))
        test.addCleanup(shutil.rmtree, self.root)
        self.fleet, self.out = (os.path.join(self.root, name) for name in ("fleet", "new"))
        shutil.copytree(DATA, self.fleet, copy_function=os.link)
        self.test, self.more, self.jointctl = test, more, JOINTCTL
        if pause:
            self.jointctl = os.path.join(self.root, "slow")
            with open(self.jointctl, "w") as file:
                file.write(f'#!/bin/sh\nsleep {pause}\nexec {JOINTCTL} "$@"\n')
            os.chmod(self.jointctl, 0o700)

    def start(self, *more):
        words = [self.fleet, "--out", self.out, "--page", os.path.join(self.root, "fleet.html"), "--preset",
                 "coulomb-viscous", "--key", os.path.join(EXPECTED, "fleet.key"), "--jointctl", self.jointctl, "--json"]
        # In a group of its own, so that Ctrl-C can be sent as a terminal does it.
        night = subprocess.Popen([sys.executable, "-m", "fleet_on_ray", *words, *self.more, *more], text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
        self.test.addCleanup(lambda: night.poll() is None and (night.kill(), night.communicate()))
        return night

    def night(self, *more, code=0):
        return self.end(self.start(*more), code)

    def reach(self, night, condition, what):
        """Waits for a state of a night that is still at work."""
        until(lambda: condition() or night.poll() is not None, what)
        self.test.assertIsNone(night.poll(), f"over before {what}: {night.poll() is None or night.communicate()}")

    def end(self, night, code=0):
        """The report of a night that ends with this exit code."""
        output, error = night.communicate(timeout=LONG)
        self.test.assertEqual(night.returncode, code, error)
        return (json.loads(output) if output else None), error

    def summed(self):
        """Days whose sums are there: a table a joint."""
        tables = [name for name in self.names(self.fleet) if name.startswith("_sums/joint=")]
        return 10 * sum(name.endswith(".parquet") for name in tables)

    def retrained(self):
        """Joints whose outcome is there and not joined yet."""
        return sum(name.startswith("_joints") and name.endswith("/retrain.json") and ".partial" not in name
                   for name in self.names(self.out))

    @staticmethod
    def names(folder):
        return [os.path.relpath(os.path.join(place, name), folder)
                for place, _, names in os.walk(folder) for name in names]

    def no_half(self):
        """Nothing that was begun and not ended is left."""
        left = [name for name in self.names(self.root) if "partial" in name or "_stop" in name]
        self.test.assertEqual(left, [])

    def same(self):
        """All files are those of one process, and each image was registered once."""
        expected = tree(os.path.join(EXPECTED, "fleet", "_sums"))
        self.test.assertEqual(len(expected), 13)
        for place, found, expected in (
            ("sums", tree(os.path.join(self.fleet, "_sums")), expected),
            ("new", tree(self.out), tree(os.path.join(EXPECTED, "new"))),
        ):
            self.test.assertEqual(sorted(found), sorted(expected), place)
            self.test.assertEqual([name for name in found if found[name] != expected[name]], [], place)
        with open(os.path.join(self.root, "fleet.html")) as own, open(os.path.join(EXPECTED, "fleet.html")) as page:
            self.test.assertEqual(own.read(), page.read())
        listed = subprocess.run([JOINTCTL, "fleet", "images", self.fleet, "--json"], capture_output=True, check=True)
        images = [(record["joint"], record["image"]) for record in json.loads(listed.stdout)["images"]]
        self.test.assertTrue(len(images) == len(set(images)) == 3, images)


class OnOneMachine(unittest.TestCase):
    def test_two_and_four_workers_give_the_files_of_one_process(self):
        for workers in ("2", "4"):
            folder = Folder(self, "--workers", workers)
            report, error = folder.night()
            folder.same()
            self.assertEqual((report["partitions"], report["summed_up"], report["known"]), (120, 120, 0))
            self.assertEqual((report["bad_partitions"], report["failed"]), (4, []))
            self.assertIn("joint=j02/day=2026-01-04 is left out: ", error)
            self.assertIn(f"sums of 12 joints, {workers} workers", error)
        # What is there is not replaced, and not computed again.
        self.assertIn("retrain.json exists; --force", folder.night("--page", f"{folder.root}/other.html", code=2)[1])

    def test_ctrl_c_ends_a_night_without_a_half_and_it_goes_on_from_there(self):
        folder = Folder(self, "--workers", "2", pause=0.5)
        night = folder.start()
        folder.reach(night, lambda: folder.summed() >= 20, "sums")
        os.killpg(night.pid, signal.SIGINT)
        _, error = folder.end(night, 130)
        self.assertRegex(error, "interrupted: sums: [0-9]+ of 12 were done; the same command goes on from there")
        self.assertFalse(os.path.exists(os.path.join(folder.fleet, "_sums", "all.parquet")))
        folder.no_half()
        night = folder.start()
        folder.reach(night, lambda: folder.retrained() >= 1, "an outcome")
        os.killpg(night.pid, signal.SIGINT)
        _, error = folder.end(night, 130)
        self.assertIn("interrupted: retrain: ", error)
        folder.no_half()
        report, _ = folder.night("--force")
        self.assertEqual((report["summed_up"], report["known"]), (0, 120))
        folder.same()


class Cluster(unittest.TestCase):
    """Nights on a Ray that is there before and after them."""

    @classmethod
    def setUpClass(cls):
        import ray
        cls.ray = ray
        started = ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR",
                           object_store_memory=128 << 20)
        cls.address = started.address_info["gcs_address"]
        cls.raylet = next(pid for pid, line in children(os.getpid()) if "/raylet " in line)

    @classmethod
    def tearDownClass(cls):
        cls.ray.shutdown()

    def folder(self):
        return Folder(self, "--address", self.address, pause=0.3)

    def at_work(self, step):
        """A worker that runs jointctl in this step, and that jointctl."""
        for worker, line in children(self.raylet):
            if line.startswith(f"ray::{step}"):
                for child, _ in children(worker):
                    return worker, child
        return None

    def kill_a_worker(self, night, step, ready=lambda: True, pause=0.0):
        """Kills a worker in a step; False where the night was over before."""
        until(lambda: night.poll() is not None or ready() and self.at_work(step), f"a worker at {step}")
        time.sleep(pause)
        found = until(lambda: night.poll() is not None or self.at_work(step), f"a worker at {step}")
        if found is True:
            return False
        worker, child = found
        os.kill(worker, signal.SIGKILL)
        until(lambda: not alive(child), "the end of the jointctl of a worker that was killed")
        return True

    def test_a_worker_that_is_killed_costs_nothing_but_its_task(self):
        # Instants: days that are summed up, or outcomes that are there, before the kill, and a time after that, s.
        # With 80 of 120 days four joints are left, which take longer than the time after that.
        sums = [("sums", days, pause) for days in (0, 20, 40, 60, 80) for pause in (0.0, 0.32)]
        retrain = [("retrain", joints, pause) for joints in (0, 1) for pause in (0.0, 0.1, 0.2, 0.35, 0.5)]
        instants = [instant for pair in zip(sums, retrain) for instant in pair]
        for step, least, pause in instants[:: max(1, len(instants) // KILLS)][:KILLS]:
            with self.subTest(step=step, least=least, pause=pause):
                for _ in range(5):
                    folder = self.folder()
                    night = folder.start()
                    done = folder.summed if step == "sums" else folder.retrained
                    killed = self.kill_a_worker(night, step, lambda: done() >= least, pause)
                    report, _ = folder.end(night)
                    folder.same()
                    self.assertEqual((report["failed"], report["summed_up"] + report["known"]), ([], 120))
                    if killed:
                        break
                self.assertTrue(killed, "the night was over before the kill, five times")

    def test_a_joint_that_fails_too_often_is_named_and_costs_the_others_nothing(self):
        folder = self.folder()
        night = folder.start("--retries", "0")
        self.assertTrue(self.kill_a_worker(night, "retrain"))
        report, error = folder.end(night, 1)
        failed = [failure["joint"] for failure in report["failed"]]
        self.assertTrue(len(failed) == 1 and f"warning: joint={failed[0]}: retrain: tried 1 times: " in error, error)
        self.assertEqual(len(report["retrain"]), len(report["changed"]) - 1)
        report, _ = folder.night("--force")
        self.assertEqual(report["failed"], [])
        folder.same()

    def test_a_driver_that_is_killed_and_started_again_does_nothing_twice(self):
        folder = self.folder()
        night = folder.start()
        folder.reach(night, lambda: folder.summed() >= 30, "sums")
        # Two nights at once are one too many.
        self.assertIn("another night is at work there", folder.night(code=1)[1])
        night.kill()
        night.communicate()
        night = folder.start()
        folder.reach(night, lambda: folder.retrained() >= 1, "an outcome")
        night.kill()
        night.communicate()
        report, _ = folder.night("--force")
        self.assertEqual((report["failed"], report["summed_up"], report["known"]), ([], 0, 120))
        folder.same()


if __name__ == "__main__":
    unittest.main()
