"""Fits baselines a, b and c to an exported table of samples and writes the errors of all models as JSON.

    jointctl fit elbow.toml --export elbow.csv.gz
    PYTHONPATH=tools/python python3 -m baselines elbow.csv.gz
"""

import argparse
import json
import sys

from .network import Corrected
from .physical import Extended, Simple, rms
from .samples import TableError, read

LEAST = 100
"""Fewest samples to fit a to, to validate with, and in a test set."""


def errors(measured, predicted):
    """RMSE, and its percentage of the measured effort's RMS."""
    rmse = rms(measured - predicted)
    return {"rmse": rmse, "percent_of_rms": 100 * rmse / rms(measured)}


def judge(samples, seeds=3, most=12_000, steps=150):
    """Errors of a, b, c and of all exported predictions on each test set, as numbers that JSON can hold. Raises TableError."""
    for part in ("train", "validation"):
        found = int(samples.of_part(part).sum())
        if found < LEAST:
            raise TableError(f"{found} samples for {part}, at least {LEAST} are needed")
    known = samples.where(samples.of_part("train", "validation"))
    simple = Simple.fit(known)
    extended = Extended.fit(known, simple)
    parts = [samples.where(samples.of_part(part)) for part in ("train", "validation")]
    corrected = Corrected.fit(*parts, simple, extended, seeds, most, steps)
    tests = []
    for name, mask in samples.tests.items():
        test = samples.where(mask & samples.of_part("test"))
        if len(test.effort) < LEAST:
            raise TableError(f"test set {name}: {len(test.effort)} samples, at least {LEAST} are needed")
        models = dict(a=simple.predict(test), b=extended.predict(test), c=corrected.predict(test))
        tests.append({
            "name": name, "samples": len(test.effort), "rms": rms(test.effort),
            "baselines": {model: errors(test.effort, predicted) for model, predicted in models.items()},
            "exported": {model: errors(test.effort, predicted) for model, predicted in test.predictions.items()},
        })
    return {
        "unit": samples.unit,
        "samples": {part: int(samples.of_part(part).sum()) for part in ("train", "validation")},
        "a": {"slope_velocity": float(simple.slope), "coefficients": plain(simple.coefficients), "rmse": simple.residual},
        "b": {"slope_velocity": float(extended.slope), "stribeck_velocity": float(extended.stribeck),
              "coefficients": plain(extended.coefficients), "rmse": extended.residual},
        "c": {"validation_rmse": corrected.validation, "inputs": len(corrected.mean)},
        "tests": tests,
    }


def plain(coefficients):
    """The same without NumPy's types."""
    return {name: float(value) for name, value in coefficients.items()}


def main():
    parser = argparse.ArgumentParser(prog="baselines", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("samples", help="table that jointctl wrote with --export, .csv or .csv.gz")
    parser.add_argument("--out", metavar="FILE", help="JSON file; without it standard output")
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="networks, 1 to 100 [3]")
    parser.add_argument("--most", type=int, default=12_000, metavar="N",
                        help="most training samples of a network, 200 to 1000000 [12000]")
    parser.add_argument("--steps", type=int, default=150, metavar="N", help="most training steps, 1 to 10000 [150]")
    arguments = parser.parse_args()
    for name, low, high in (("seeds", 1, 100), ("most", 200, 1_000_000), ("steps", 1, 10_000)):
        value = getattr(arguments, name)
        if not low <= value <= high:
            parser.error(f"--{name} is {value}, must be {low} to {high}")
    try:
        found = judge(read(arguments.samples), arguments.seeds, arguments.most, arguments.steps)
    except (OSError, ValueError) as error:
        sys.exit(f"baselines: {error}")
    text = json.dumps(found, indent=1) + "\n"
    if arguments.out:
        with open(arguments.out, "w") as file:
            file.write(text)
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
