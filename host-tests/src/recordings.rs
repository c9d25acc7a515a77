//! Recorded joints of others, which are no part of this repository.
//!
//! The environment variable `JOINT_DATA` names the folder that holds them, one folder for each data set. Where it is
//! unset the tests that need them report themselves as ignored, by name. Where it is set they fail if something is
//! missing.

use std::path::{Path, PathBuf};

/// Name of the environment variable.
const VARIABLE: &str = "JOINT_DATA";

/// Folder of the recordings. None: `JOINT_DATA` is unset or empty.
pub fn folder() -> Option<PathBuf> {
    std::env::var_os(VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from)
}

/// Environment for the shipped descriptions: `JOINT_DATA` alone, as an absolute path.
///
/// # Errors
/// The folder does not exist.
pub fn environment(folder: &Path) -> Result<impl Fn(&str) -> Option<String>, String> {
    let failed = |error| format!("{VARIABLE}: {}: {error}", folder.display());
    let absolute = folder.canonicalize().map_err(failed)?.to_string_lossy().into_owned();
    Ok(move |name: &str| (name == VARIABLE).then(|| absolute.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_environment_has_one_variable_and_wants_a_folder_that_exists() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let environment = environment(here).unwrap();
        assert_eq!(environment(VARIABLE), Some(here.to_string_lossy().into_owned()));
        assert_eq!(environment("HOME"), None);
        let missing = here.join("no such folder");
        let error = super::environment(&missing).err().unwrap();
        assert!(error.contains("JOINT_DATA") && error.contains("no such folder"), "{error}");
    }
}
