"""Steps of a night, each a process of jointctl on one joint; run by the workers, which need Python's own modules alone.

A step's outcome is a dictionary: what was asked for, or `error`, one line, where another try would end alike. A crash
is an exception. A step that is repeated gives the same files: jointctl writes each beside its place and renames it. Before a step the
halves that a killed process left are removed; a joint has one task at a time.
"""

import glob
import hashlib
import os
import shutil
import socket
import subprocess
import sys

PATIENCE = 3.0
"""Time that jointctl has to end by itself when it is asked to, s."""

LOOK = 0.5
"""Time between two looks for the file that ends a night, s."""

NOTHING_KEPT = 3
"""Exit code of jointctl where it is done and no new image is better."""


class Crashed(Exception):
    """A process that a signal ended, for want of memory for example: Ray tries again."""


class Stopped(Exception):
    """The end of a night by its user: the file `stop` of its options is there."""


def sums(options, joint):
    """Sums of a joint's days; `output` has jointctl's counts."""
    sweep(glob.escape(os.path.join(options["fleet"], "_sums", f"joint={joint}")) + ".partial-*")
    return outcome(options, ["fleet", "sums", options["fleet"], f"--joint={joint}", "--threads=1", "--json"])


def status(options):
    """Findings from the stored sums, and the table of all; `output` is JSON."""
    sweep(os.path.join(glob.escape(os.path.join(options["fleet"], "_sums")), "all.partial-*"))
    arguments = ["fleet", "status", options["fleet"], "--stored", "--threads=1", "--json"]
    if options["page"]:
        sweep(glob.escape(options["page"]) + ".partial-*")
        arguments += [f"--page={options['page']}", "--force"]
    return outcome(options, arguments)


def retrain(options, joint):
    """A joint's new image in `folder`, whose name is the digest of all that it depends on.

    A folder that is there is the outcome of an earlier night that was ended: it is used as it is.
    """
    folder = os.path.join(options["work"], inputs(options, joint))
    if os.path.isdir(folder):
        return {"folder": folder}
    sweep(glob.escape(folder) + ".partial-*")
    arguments = ["fleet", "retrain", options["fleet"], f"--joint={joint}", "--threads=1", f"--out={folder}", "--json"]
    arguments += [f"--preset={name}" for name in options["presets"]] + (["--network"] if options["network"] else [])
    arguments += [f"--{name}={options[name]}" for name in ("images", "key") if options[name]]
    found = outcome(options, arguments)
    # A worker that was taken for dead may have been faster.
    return {"folder": folder} if os.path.isdir(folder) else {"error": found.get("error", f"{folder} was not written")}


def inputs(options, joint):
    """Digest of all that a joint's new image depends on: sums, which have the recordings' digests, image, key, program."""
    digest = hashlib.sha256(repr([joint, options["presets"], options["network"], options["program"]]).encode())
    stored = [os.path.join(options["fleet"], "_sums", f"joint={joint}.parquet")]
    images = [os.path.join(options["images"], joint, "friction.img")] if options["images"] else []
    for path in stored + images + ([options["key"]] if options["key"] else []):
        if os.path.exists(path):
            with open(path, "rb") as file:
                digest.update(os.path.basename(path).encode() + hashlib.sha256(file.read()).digest())
    return digest.hexdigest()[:32]


def outcome(options, arguments):
    """Runs jointctl: `output` and `warnings` are what it printed, `error` is the last line where it failed."""
    try:
        code, output, error = call([options["jointctl"], *arguments], lambda: os.path.exists(options["stop"]))
    except Stopped:
        return {"error": "the night was stopped"}
    except (FileNotFoundError, PermissionError) as problem:
        place = f"{options['jointctl']} on {socket.gethostname()}"
        return {"error": f"{place}: {problem.strerror}; every node needs jointctl at this path"}
    if code not in (0, NOTHING_KEPT):
        lines = error.strip().splitlines()
        return {"error": lines[-1].removeprefix("error: ") if lines else f"jointctl ended with {code}"}
    return {"output": output, "warnings": error}


def call(command, stopped):
    """Runs a program that ends along with this process: exit code, standard output and standard error.

    Raises Stopped, and Crashed where a signal ended the program.
    """
    if stopped():
        raise Stopped
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    pipes = dict(stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace")
    child = subprocess.Popen(command, env=environment, preexec_fn=mortal(), **pipes)
    while True:
        try:
            output, error = child.communicate(timeout=LOOK)
            break
        except subprocess.TimeoutExpired:
            if stopped():
                end(child)
                raise Stopped from None
    if child.returncode < 0:
        raise Crashed(f"{os.path.basename(command[0])} was ended by signal {-child.returncode}")
    return child.returncode, output, error


def end(child):
    """Ends a child: it is asked first, so that it leaves no half of a file."""
    child.terminate()
    try:
        child.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()


def mortal():
    """What a child does first so that it ends with its parent: a worker that is killed leaves nobody who still writes."""
    if sys.platform != "linux":
        return None
    import ctypes
    prctl, parent, set_parent_death_signal, kill = ctypes.CDLL(None).prctl, os.getpid(), 1, 9

    def first():
        prctl(set_parent_death_signal, kill)
        if os.getppid() != parent:
            os._exit(1)

    return first


def sweep(pattern):
    """Removes the halves of files and folders that killed processes left."""
    for path in glob.glob(pattern):
        if os.path.isdir(path):
            shutil.rmtree(path, ignore_errors=True)
        else:
            try:
                os.remove(path)
            except FileNotFoundError:
                pass
