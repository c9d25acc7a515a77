//! Numbers of random joints: a part of them in the test command, all of them where figures are published.

/// `all` where `JOINT_SAMPLES=all`, else `part`: the first seeds of the same joints, so that the worst of them is never
/// worse than the worst of all.
pub fn count(part: u64, all: u64) -> u64 {
    if every() { all } else { part }
}

/// True where all joints are asked for.
pub fn every() -> bool {
    std::env::var_os("JOINT_SAMPLES").is_some_and(|samples| samples == "all")
}
