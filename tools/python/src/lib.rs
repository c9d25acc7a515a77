//! Python with packages of others, for the tests that drive this project's programs from it.

pub mod baselines;

use std::path::{Path, PathBuf};
use std::process::Command;

/// Packages of PyPI, as pip installs and Python imports them.
#[derive(Clone, Copy, Debug)]
pub struct Packages {
    /// Folder of their environment.
    pub folder: &'static str,
    /// Packages that pip installs, with versions.
    pub install: &'static [&'static str],
    /// Modules that must then be found, separated by commas.
    pub import: &'static str,
}

/// python-canopen with its buses.
pub const CANOPEN: Packages = Packages {
    folder: "python-canopen",
    install: &["canopen==2.4.1", "python-can==4.6.1", "msgpack==1.2.4"],
    import: "canopen, can, msgpack",
};

/// Lely's tools, with which ros2_canopen makes its configuration.
pub const DCF_TOOLS: Packages =
    Packages { folder: "python-dcf", install: &["dcf-tools==2.4.2"], import: "dcf, dcfgen" };

/// MCAP's and Apache Arrow's own readers and writers.
pub const LOGS: Packages = Packages {
    folder: "python-logs",
    install: &["mcap==1.6.0", "pyarrow==26.0.1"],
    import: "mcap.reader, mcap.writer, pyarrow.parquet",
};

/// Rerun's importers, which show logs; an environment of its own, as it takes 820 MB.
pub const RERUN: Packages =
    Packages { folder: "python-rerun", install: &["rerun-sdk==0.41.0"], import: "rerun, rerun.chunk" };

/// Ray.
pub const RAY: Packages = Packages { folder: "python-ray", install: &["ray==2.60.0"], import: "ray" };

/// Folder of the package `fleet_on_ray`.
pub const FLEET_ON_RAY: &str = env!("CARGO_MANIFEST_DIR");

impl Packages {
    /// A Python that finds them, in a virtual environment below a test's temporary folder that is made once. None
    /// without Python, without its module `venv`, or where the packages cannot be installed.
    pub fn python(&self, temporary: &str) -> Option<PathBuf> {
        let folder = Path::new(temporary).join(self.folder);
        let python = folder.join("bin/python3");
        let works = || succeeds(Command::new(&python).args(["-c", &format!("import {}", self.import)]));
        if !works() && succeeds(Command::new("python3").args(["-m", "venv"]).arg(&folder)) {
            let pip = ["-m", "pip", "install", "--quiet", "--timeout", "10"];
            succeeds(Command::new(&python).args(pip).args(self.install));
        }
        works().then_some(python)
    }

    /// The same, or why there is none.
    ///
    /// # Errors
    /// There is none.
    pub fn required<'a>(&self, python: Option<&'a Path>) -> Result<&'a Path, String> {
        python.ok_or_else(|| {
            format!("there is no python3 with venv, or {} could not be installed", self.install.join(", "))
        })
    }
}

fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}
