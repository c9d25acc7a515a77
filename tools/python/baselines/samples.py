"""The table of samples that `jointctl` exports; its columns are documented in docs/baselines.md."""

import csv
import gzip
from dataclasses import dataclass

import numpy as np

PARTS = ("train", "validation", "test", "unused")


class TableError(ValueError):
    """A table that cannot be used; its text names file, column or part."""


@dataclass
class Samples:
    """Columns of equal length, one row a sample, in the unit of the recording."""

    unit: str
    """Unit of the effort: Nm, N, A or V."""
    part: np.ndarray
    """One of PARTS for each sample."""
    tests: dict
    """Name of each test set: which samples it has, booleans."""
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    temperature: np.ndarray | None
    """Degrees Celsius; None where it was not recorded."""
    rigid: dict
    """Name of each regressor of the rigid body: its values."""
    predictions: dict
    """Name of each model that was exported with the samples: the effort that it predicts."""

    def of_part(self, *parts):
        """Which samples belong to one of the parts."""
        return np.isin(self.part, parts)

    def where(self, mask):
        """The samples for which `mask` holds."""
        pick = lambda columns: {name: values[mask] for name, values in columns.items()}
        temperature = None if self.temperature is None else self.temperature[mask]
        return Samples(self.unit, self.part[mask], pick(self.tests), self.position[mask], self.velocity[mask],
                       self.effort[mask], temperature, pick(self.rigid), pick(self.predictions))


def read(path):
    """The samples of the table at `path`, plain or gzip. Raises TableError."""
    opened = gzip.open if str(path).endswith(".gz") else open
    with opened(path, "rt", newline="") as file:
        names = next(csv.reader(file), [])
        texts = [names.index(name) for name in ("part",) if name in names]
        numbers = [i for i, name in enumerate(names) if name not in ("part", "recording")]
        if not texts or not numbers:
            raise TableError(f"{path}: no column part; is this a table of jointctl's --export?")
        values = np.loadtxt(file, delimiter=",", quotechar='"', usecols=numbers, ndmin=2)
    with opened(path, "rt", newline="") as file:
        part = np.loadtxt(file, delimiter=",", quotechar='"', usecols=texts, ndmin=1, skiprows=1, dtype="U10")
    columns = dict(zip((names[i] for i in numbers), values.T))

    def quantity(name):
        found = [column for column in columns if column.startswith(name + "_")]
        if len(found) != 1:
            raise TableError(f"{path}: {len(found)} columns {name}_..., expected 1")
        return found[0]

    def with_prefix(prefix):
        return {name[len(prefix):]: column for name, column in columns.items() if name.startswith(prefix)}

    unknown = set(np.unique(part)) - set(PARTS)
    if unknown:
        raise TableError(f"{path}: part {sorted(unknown)}, expected one of {PARTS}")
    for name, column in columns.items():
        if not np.all(np.isfinite(column[part != "unused"])):
            raise TableError(f"{path}: column {name} has a value that is no number")
    effort = quantity("effort")
    tests = {name: column != 0 for name, column in with_prefix("test ").items()}
    return Samples(effort.removeprefix("effort_"), part, tests, columns[quantity("position")],
                   columns[quantity("velocity")], columns[effort], columns.get("temperature_C"),
                   with_prefix("rigid "), with_prefix("predicted "))
