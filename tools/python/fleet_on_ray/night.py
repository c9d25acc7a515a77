"""A night as Ray tasks: sums of each joint, findings of all, a new image of each joint that has changed.

Ray repeats tasks whose worker or jointctl crashed. A task that fails for another reason, or too often, costs its joint
alone: it is named in the report. Tasks that Ray has are no more than twice the workers, whatever the fleet's size.
"""

import json

import ray

from . import files, steps

CHANGED = ("drifted", "friction-fell")
"""Findings for which jointctl fits a new image."""

ENOUGH = 10.0
"""Longest wait for tasks that are to end, s: jointctl is asked to, then killed; later Ray's own end takes them along."""


class Night:
    """A night on a Ray that is connected. `stopped` is asked five times a second."""

    def __init__(self, options, workers, retries, stopped, say):
        # The workers need no package of ours: the steps travel along with the tasks.
        ray.cloudpickle.register_pickle_by_value(steps)
        self.options, self.workers, self.retries, self.stopped, self.say = options, workers, retries, stopped, say
        self.failed = []

    def run(self):
        """The whole: findings with counts, outcomes of retraining (None without `out`), and joints that failed."""
        joints = files.joints(self.options["fleet"])
        self.say(f"sums of {len(joints)} joints, {self.workers} workers")
        counts = self.each("sums", steps.sums, joints)
        read = [json.loads(outcome["output"]) for outcome in counts.values()]
        self.say("findings")
        found = self.each("status", steps.status, [None]).get(None)
        if found is None:
            raise files.NightError(f"no findings: {self.failed[-1]['reason']}")
        report = json.loads(found["output"])
        for line in found["warnings"].splitlines():
            if line.startswith("warning: "):
                self.say(line)
        report |= {name: sum(count[name] for count in read) for name in ("summed_up", "known")}
        report["changed"] = [joint["joint"] for joint in report["joints"] if joint["kind"] in CHANGED]
        report["retrain"] = self.retrained(report["changed"]) if self.options["out"] else None
        return report | {"failed": self.failed}

    def retrained(self, changed):
        """New images of the joints that have changed, without those whose sums failed: outcomes."""
        lost = {failure["joint"] for failure in self.failed}
        changed = [joint for joint in changed if joint not in lost]
        self.say(f"new images of {len(changed)} joints")
        found = self.each("retrain", steps.retrain, changed)
        out, work = self.options["out"], self.options["work"]
        folders = [(joint, found[joint]["folder"]) for joint in changed if joint in found]
        files.join(out, folders, self.options["force"])
        text = ",".join(filter(None, (files.outcomes(folder) for _, folder in folders)))
        if not self.failed:
            files.remove(work)
        return json.loads(f"[{text}]")

    def each(self, name, step, items):
        """Runs a step for each of the items: outcomes by item, without those that failed."""
        task = ray.remote(max_retries=self.retries, retry_exceptions=True, num_cpus=1)(step).options(name=name)
        start = lambda item: task.remote(*([self.options] if item is None else [self.options, item]))
        done, running, waiting = {}, {}, iter(items)
        while True:
            while len(running) < 2 * self.workers and (item := next(waiting, steps)) is not steps:
                running[start(item)] = item
            if not running:
                return done
            ready, _ = ray.wait(list(running), timeout=0.2)
            if self.stopped():
                self.end(list(running))
                raise files.Interrupted(f"{name}: {len(done)} of {len(items)} were done")
            for reference in ready:
                item = running.pop(reference)
                try:
                    outcome = ray.get(reference)
                except ray.exceptions.RayError as error:
                    outcome = {"error": f"tried {self.retries + 1} times: {reason(error)}"}
                if "error" in outcome:
                    self.failed.append({"joint": item, "step": name, "reason": outcome["error"]})
                    self.say(f"warning: {'' if item is None else f'joint={item}: '}{name}: {outcome['error']}")
                else:
                    done[item] = outcome

    def end(self, references):
        """Ends tasks by a file that each looks for, and ends its jointctl then.

        ray.cancel aborts the driver where a task ends just then ("Tried to complete task that was not pending").
        """
        with open(self.options["stop"], "w"):
            pass
        ray.wait(references, num_returns=len(references), timeout=ENOUGH)


def reason(error):
    """An error of Ray in one line."""
    lines = [line.strip() for line in str(getattr(error, "cause", None) or error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0] if lines else ''}"
