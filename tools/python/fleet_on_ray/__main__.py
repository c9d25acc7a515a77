"""The night of a fleet on several machines: sums, findings, and with --out new images.

    python -m fleet_on_ray /data/fleet --out new --workers 2
    python -m fleet_on_ray /data/fleet --out new --address head:6379

Ctrl-C ends it, the same command goes on from there. Exit code: 0 done, 1 failed or some joints did (they are named),
2 wrong arguments, 130 interrupted.
"""

import argparse
import glob
import json
import os
import shutil
import signal
import sys

from . import files, steps

WORKERS = (1, 4096)
RETRIES = (0, 100)
STORE = 128 << 20
"""Memory for Ray's objects on this machine, bytes: outcomes are some kilobytes each."""


def between(low, high):
    """A parser of integers within limits."""
    def parse(text):
        number = int(text)
        if not low <= number <= high:
            raise argparse.ArgumentTypeError(f"{number} is outside {low} to {high}")
        return number
    parse.__name__ = "number"
    return parse


def arguments(words=None):
    """The arguments of a night."""
    parser = argparse.ArgumentParser(prog="fleet_on_ray", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("fleet", help="folder of joint=NAME/day=YYYY-MM-DD/*.parquet, at the same path on every node")
    parser.add_argument("--out", metavar="DIR", help="folder for new images and retrain.json; without it none are fitted")
    parser.add_argument("--images", metavar="DIR", help="folder with JOINT/friction.img that the joints have")
    parser.add_argument("--key", metavar="FILE", help="key to sign new images with")
    parser.add_argument("--preset", metavar="NAME", action="append", default=[], help="as of `jointctl fleet retrain`")
    parser.add_argument("--network", action="store_true", help="as of `jointctl fleet retrain`")
    parser.add_argument("--page", metavar="FILE", help="page with a map of all joints and days")
    parser.add_argument("--workers", metavar="N", type=between(*WORKERS), help="tasks at once, 1 to 4096 [one a CPU]")
    parser.add_argument("--retries", metavar="N", type=between(*RETRIES), default=3,
                        help="repetitions of a task that crashed, 0 to 100 [3]")
    parser.add_argument("--address", default=os.environ.get("RAY_ADDRESS") or "local",
                        help="a cluster, as of ray.init [RAY_ADDRESS, or a Ray of its own on this machine]")
    parser.add_argument("--jointctl", metavar="FILE", default="jointctl", help="the program, at this path on every node")
    parser.add_argument("--force", action="store_true", help="replace files that exist")
    parser.add_argument("--json", action="store_true", help="print findings, outcomes and counts as JSON")
    return parser.parse_args(words)


def options(given):
    """What the steps need: absolute paths, because workers have folders of their own. Raises UsageError."""
    program = shutil.which(given.jointctl)
    if program is None:
        raise files.UsageError(f"{given.jointctl}: no such program; --jointctl names it")
    absolute = {name: getattr(given, name) and os.path.abspath(getattr(given, name))
                for name in ("fleet", "out", "images", "key", "page")}
    written = [absolute["page"], absolute["out"] and os.path.join(absolute["out"], "retrain.json")]
    for path in filter(None, written):
        if os.path.exists(path) and not given.force:
            raise files.UsageError(f"{path} exists; --force replaces it")
    for name in ("images", "key"):
        if absolute[name] and not os.path.exists(absolute[name]):
            raise files.UsageError(f"{absolute[name]}: no such file or folder; --{name} names it")
    return absolute | {
        "work": absolute["out"] and os.path.join(absolute["out"], "_joints"),
        "stop": os.path.join(absolute["fleet"], f"_stop-{os.urandom(8).hex()}"),
        "jointctl": os.path.abspath(program), "program": files.digest(program),
        "presets": given.preset, "network": given.network, "force": given.force,
    }


def connect(given):
    """Starts or finds a Ray: tasks at once."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError as error:
        raise files.NightError(f"Ray cannot be imported: {error}; pip install ray") from error
    workers = given.workers or os.cpu_count() or 1
    alone = dict(num_cpus=workers, include_dashboard=False, object_store_memory=STORE) if given.address == "local" else {}
    try:
        ray.init(given.address, log_to_driver=False, logging_level="ERROR", **alone)
    except Exception as error:
        # Ray has no class of its own for this.
        raise files.NightError(f"Ray at {given.address} does not start or answer: {error}") from error
    if alone:
        return workers
    there = max(1, int(ray.cluster_resources().get("CPU", 1)))
    return min(there, given.workers or there)


def report(found):
    """The report's lines."""
    misplaced = len(found["misplaced"])
    yield (f"{found['partitions']} partitions: {found['summed_up']} summed up, {found['known']} known, "
           f"{found['bad_partitions']} bad; {misplaced} misplaced")
    for joint in found["joints"]:
        if joint["kind"] != "healthy":
            yield f"{joint['joint']}: {joint['kind'].replace('-', ' ')} since {joint['since'] or '-'}: {joint['reason']}"
    for joint in found["retrain"] or []:
        yield f"{joint['joint']}: {'new image' if joint['kept'] else 'no new image'}: {joint['reason']}"
    if found["retrain"] is not None:
        kept = sum(joint["kept"] for joint in found["retrain"])
        yield f"{kept} new images of {len(found['retrain'])} joints that have changed. Nothing is uploaded."
    if found["failed"]:
        yield f"{len(found['failed'])} joints failed: " + ", ".join(str(failure["joint"]) for failure in found["failed"])


def run(given):
    """A night from start to end: the report."""
    chosen = options(given)
    stop = []
    catch = lambda: [signal.signal(number, lambda *_: stop.append(True)) for number in (signal.SIGINT, signal.SIGTERM)]
    catch()
    locked = files.lock(chosen["fleet"])
    stops = os.path.join(glob.escape(chosen["fleet"]), "_stop-*")
    # Of a driver that was killed while it ended.
    steps.sweep(stops)
    try:
        workers = connect(given)
        # Ray has handlers of its own, which end the process.
        catch()
        from . import night
        say = lambda line: print(line, file=sys.stderr, flush=True)
        return night.Night(chosen, workers, given.retries, lambda: bool(stop), say).run()
    finally:
        if "ray" in sys.modules:
            sys.modules["ray"].shutdown()
        steps.sweep(stops)
        os.close(locked)


def main():
    given = arguments()
    # Ray writes messages to standard output, which is for the report alone.
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    try:
        found = run(given)
    except files.UsageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except files.Interrupted as error:
        print(f"interrupted: {error}; the same command goes on from there", file=sys.stderr)
        return 130
    except (files.NightError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(json.dumps(found) if given.json else "\n".join(report(found)), file=output, flush=True)
    return 1 if found["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
