//! Recordings that do not fit their robot: errors name file, joint and remedy.

use crate::record;
use std::f64::consts::{PI, SQRT_2, TAU};
use std::path::PathBuf;

/// Frequency of joint motions, rad/s: four periods in six seconds.
const OMEGA: f64 = TAU * 4.0 / 6.0;
const HEAD: &str =
    "name = 'x'\nrobot = 'robot.toml'\n[source]\nfiles = ['log.csv']\n[columns]\ntime = { column = 't' }\n";
const ROBOT: &str = "urdf = 'two.urdf'\n[joint.one]\n[joint.two]\n";

/// A robot of two joints in a folder of its own.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        let inertial =
            "<inertial><mass value='2'/><inertia ixx='.02' ixy='0' ixz='0' iyy='.02' iyz='0' izz='.01'/></inertial>";
        let urdf = format!(
            "<robot name='two'><link name='base'/><link name='a'>{inertial}</link><link name='b'>{inertial}</link>\
             <joint name='one' type='revolute'><parent link='base'/><child link='a'/><limit lower='-1' upper='1' velocity='0'/></joint>\
             <joint name='two' type='revolute'><parent link='a'/><child link='b'/></joint></robot>"
        );
        folder.write("two.urdf", &urdf);
        folder.write("robot.toml", ROBOT);
        folder.record(|t| [(OMEGA * t).sin(), 0.5 * (OMEGA * t).cos()]);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Six seconds of positions.
    fn record(&self, positions: impl Fn(f64) -> [f64; 2]) {
        let row = |i: i32| {
            let t = 0.01 * f64::from(i);
            let [one, two] = positions(t);
            format!("{t},{one},{two},{},{}\n", t.cos(), (2.0 * t).sin())
        };
        let rows: String = (0..600).map(row).collect();
        self.write("log.csv", &format!("t,q1,q2,i1,i2\n{rows}"));
    }

    /// The error of a description, or nothing.
    fn error(&self, text: &str) -> String {
        self.write("recording.toml", text);
        let found = record(&self.path("recording.toml"), &|_| None);
        found.err().map_or(String::new(), |error| error.to_string())
    }
}

fn joint(name: &str, i: usize) -> String {
    format!("[joints.{name}]\nposition = {{ column = 'q{i}' }}\neffort = {{ column = 'i{i}', unit = 'A' }}\n")
}

fn both() -> String {
    [HEAD, &joint("one", 1), &joint("two", 2)].concat()
}

#[test]
fn a_description_that_does_not_fit_its_robot_is_refused_with_file_joint_and_remedy() {
    let folder = Folder::new();
    assert_eq!(folder.error(&both()), "");
    for (text, expected) in [
        (both().replace("robot =", "robots ="), "the key `robot` is missing"),
        (HEAD.to_owned(), "there is no [joints.NAME]"),
        ([HEAD, &joint("one", 1)].concat(), "has no [joints.two]: name its columns, or list it under `locked`"),
        (both() + &joint("three", 1), "[joints.three] is no moving joint"),
        (both().replace("'q1'", "'q9'"), "joint one: "),
        (both().replace("{ column = 'q2' }", "{ column = 'q2', unit = 'm' }"), "joint two is Revolute in the URDF"),
        (both().replace("robot.toml", "nothing.toml"), "cannot read"),
    ] {
        let found = folder.error(&text);
        assert!(found.contains(expected), "{found:?}, expected {expected}");
        assert!(found.contains(".toml"), "{found:?} names no file");
    }
}

#[test]
fn a_joint_that_stood_still_is_told_to_be_locked_whether_its_column_is_constant_or_noise() {
    let folder = Folder::new();
    let still = "recording.toml: joint two stood still";
    let remedy = "record a motion of it, or list it under `locked`";
    // RMS speeds just below and just above a thousandth of a rad/s.
    for (speed, is_refused) in [(0.0, true), (1e-7, true), (0.99e-3, true), (1.01e-3, false)] {
        folder.record(|t| [(OMEGA * t).sin(), SQRT_2 * speed / OMEGA * (OMEGA * t).sin()]);
        let found = folder.error(&both());
        assert_eq!(found.contains(still) && found.contains(remedy), is_refused, "{speed}: {found}");
        assert_eq!(found.is_empty(), !is_refused, "{speed}: {found}");
    }
}

#[test]
fn positions_in_degrees_are_told_by_the_limits_of_the_joint() {
    let folder = Folder::new();
    folder.record(|t| [60.0 * (OMEGA * t).sin(), 0.5 * (OMEGA * t).cos()]);
    let found = folder.error(&both());
    for expected in ["recording.toml", "joint one: positions are -59.9868 to 59.9868 rad", "is -1.0000 to 1.0000 rad"] {
        assert!(found.contains(expected), "{found}");
    }
    assert!(found.contains(&format!("write `scale = {}` beside it", PI / 180.0)), "{found}");
    // The remedy is one: with that scale the recording is taken.
    let remedied = both().replace("{ column = 'q1' }", &format!("{{ column = 'q1', scale = {} }}", PI / 180.0));
    assert!(!folder.error(&remedied).contains("positions are"), "{}", folder.error(&remedied));
}

#[test]
fn positions_may_be_a_twentieth_of_the_travel_beyond_its_ends_and_whole_turns_away() {
    let folder = Folder::new();
    for (amplitude, offset, is_refused) in [
        (1.099, 0.0, false),
        (1.101, 0.0, true),
        (1.0, 0.099, false),
        (1.0, 0.101, true),
        (1.0, TAU, false),
        (1.0, -2.0 * TAU, false),
        (1.0, PI, true),
    ] {
        folder.record(|t| [offset + amplitude * (OMEGA * t).sin(), 0.5 * (OMEGA * t).cos()]);
        let found = folder.error(&both());
        assert_eq!(found.contains("joint one: positions are"), is_refused, "{amplitude} {offset}: {found}");
    }
}

#[test]
fn a_joint_without_ends_of_travel_is_told_by_its_speed() {
    let folder = Folder::new();
    // RMS speed of joint two: 0.5 * OMEGA / sqrt 2.
    let speed = 0.5 * OMEGA / SQRT_2;
    for (limit, is_refused) in [(0.99 * speed, true), (1.01 * speed, false)] {
        folder.write("robot.toml", &format!("{ROBOT}velocity = {limit}\n"));
        let found = folder.error(&both());
        assert_eq!(found.contains("recording.toml: joint two: the RMS speed is"), is_refused, "{limit}: {found}");
        assert_eq!(found.contains("if column \"q2\" is in degrees"), is_refused, "{found}");
    }
}
