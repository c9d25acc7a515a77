"""Files of a night on the driver: joints of a folder, outcomes that are joined, a lock; no Ray here."""

import fcntl
import hashlib
import os
import shutil

BEFORE, BEHIND = '{"joints":[', "]}"
"""What stands around the outcomes in jointctl's retrain.json. They are joined as text: numbers keep their digits."""


class NightError(Exception):
    """An error that ends a night, in one line."""


class UsageError(NightError):
    """Arguments that are wrong: nothing was done."""


class Interrupted(NightError):
    """End by the user."""


def joints(fleet):
    """Names of a fleet's joints, sorted. Folders with other names are jointctl's to report."""
    try:
        names = os.listdir(fleet)
    except OSError as error:
        raise NightError(f"{fleet}: cannot be read: {error.strerror}") from error
    # Names that are no UTF-8 are surrogates here.
    plain = [name for name in names if name.startswith("joint=") and not any("\ud800" <= c <= "\udfff" for c in name)]
    found = [name.removeprefix("joint=") for name in plain if os.path.isdir(os.path.join(fleet, name))]
    return sorted(name for name in found if name)


def digest(path):
    """SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() if hasattr(hashlib, "file_digest") \
            else hashlib.sha256(file.read()).hexdigest()


def lock(fleet):
    """A lock on a fleet's folder for as long as the returned descriptor is open, also beyond a kill."""
    try:
        descriptor = os.open(fleet, os.O_RDONLY)
    except OSError as error:
        raise NightError(f"{fleet}: cannot be read: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise NightError(f"{fleet}: another night is at work there; wait for its end or stop it") from None
    except OSError:
        pass  # A file system without locks.
    return descriptor


def outcomes(folder):
    """The outcomes in a retrain.json, as text."""
    path = os.path.join(folder, "retrain.json")
    with open(path) as file:
        text = file.read()
    if not (text.startswith(BEFORE) and text.endswith(BEHIND)):
        raise NightError(f"{path}: expected {BEFORE}...{BEHIND}; is jointctl of another version?")
    return text[len(BEFORE):-len(BEHIND)]


def join(out, folders, force):
    """Puts the images of `folders`, joint and folder in the order of the findings, into place, and retrain.json last."""
    parts = []
    for joint, folder in folders:
        parts.append(outcomes(folder))
        made = os.path.join(folder, joint)
        for name in sorted(os.listdir(made)) if os.path.isdir(made) else []:
            with open(os.path.join(made, name), "rb") as file:
                place(os.path.join(out, joint, name), file.read(), force)
    place(os.path.join(out, "retrain.json"), (BEFORE + ",".join(p for p in parts if p) + BEHIND).encode(), force)


def place(path, content, force):
    """Writes a file whole or not at all; the same content again is no change, other content wants `force`."""
    if os.path.exists(path):
        with open(path, "rb") as file:
            if file.read() == content:
                return
        if not force:
            raise NightError(f"{path} exists; --force replaces it, nothing is computed again then")
    os.makedirs(os.path.dirname(path), exist_ok=True)
    partial = f"{path}.partial"
    with open(partial, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)


def remove(folder):
    """Removes a folder and all in it."""
    shutil.rmtree(folder, ignore_errors=True)
