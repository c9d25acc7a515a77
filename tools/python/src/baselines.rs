//! The baselines of `tools/python/baselines`, started from a test.

use crate::Packages;
use std::path::Path;
use std::process::Command;

/// NumPy and SciPy.
pub const PACKAGES: Packages =
    Packages { folder: "python-baselines", install: &["numpy==2.4.6", "scipy==1.17.1"], import: "numpy, scipy" };

/// A Python that finds the baselines, on one core: tests run beside each other. OpenBLAS chooses its kernels by the
/// processor, and the last bit of a sum decides where baseline c's training ends: the kernels named here run on every
/// x86-64 with AVX2 and give the same figures on all of them. Other processors ignore the name.
pub fn command(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.env("PYTHONPATH", env!("CARGO_MANIFEST_DIR")).env("PYTHONDONTWRITEBYTECODE", "1");
    command.envs([("OPENBLAS_NUM_THREADS", "1"), ("OMP_NUM_THREADS", "1"), ("OPENBLAS_CORETYPE", "Haswell")]);
    command
}
