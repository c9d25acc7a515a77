//! The program as a user meets it: exit codes, messages, files.

#[path = "../figure/mod.rs"]
mod figure;
#[path = "../json/mod.rs"]
mod json;
#[path = "../tables/mod.rs"]
mod tables;
mod words;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::TempDir;

fn jointctl(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_jointctl")).current_dir(folder).args(arguments).output().expect("jointctl starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A small demo: few samples and one network, for the tests' sake.
fn demo(folder: &Path, out: &str) -> Output {
    jointctl(folder, &["demo", "--out", out, "--samples", "2000", "--restarts", "2", "--patience", "10"])
}

/// A folder of a test's own with that demo in `demo`, which runs once for all tests.
fn with_demo() -> TempDir {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli");
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let output = demo(&folder, "demo");
        assert!(output.status.success(), "{}", stderr(&output));
        folder.join("demo")
    });
    let folder = tempfile::tempdir().unwrap();
    copy(made, &folder.path().join("demo"));
    folder
}

/// Copies a folder with all that is in it.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let (path, to) = (entry.as_ref().unwrap().path(), to.join(entry.as_ref().unwrap().file_name()));
        if path.is_dir() {
            copy(&path, &to);
        } else {
            std::fs::copy(path, to).unwrap();
        }
    }
}

#[test]
fn the_demo_writes_an_image_and_a_report_the_same_choices_give_the_same_bytes_and_readme_shows_the_joint() {
    let folder = with_demo();
    let output = demo(folder.path(), "second");
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for row in ["nothing", "coulomb-viscous", "image, fixed point"] {
        assert!(text.contains(row), "{text}");
    }
    for file in ["friction.img", "friction.toml", "log.csv", "report.html"] {
        let read = |out: &str| std::fs::read(folder.path().join(out).join(file)).unwrap();
        assert!(!read("demo").is_empty());
        assert!(read("demo") == read("second"), "{file} differs between two runs");
    }
    let sim = ["sim", "--image", "demo/friction.img", "--scenario", "slow-reversal", "--out", "sim", "--json"];
    let moved = jointctl(folder.path(), &sim);
    assert!(moved.status.success(), "{}", stderr(&moved));
    figure::is_shown_by_readme(&folder.path().join("sim"), &serde_json::from_slice(&moved.stdout).unwrap());
}

#[test]
fn an_image_survives_the_way_to_toml_and_back_and_a_damaged_one_is_refused() {
    let folder = with_demo();
    let run = |arguments: &[&str]| jointctl(folder.path(), arguments);
    let read = |file: &str| std::fs::read(folder.path().join(file)).unwrap();

    assert!(run(&["image", "convert", "demo/friction.toml", "again.img"]).status.success());
    assert!(run(&["image", "convert", "again.img", "again.toml"]).status.success());
    assert_eq!(read("again.img"), read("demo/friction.img"));
    assert_eq!(read("again.toml"), read("demo/friction.toml"));
    assert!(run(&["image", "verify", "again.img"]).status.success());
    let evaluated = run(&["evaluate", "again.img", "demo/dataset.toml"]);
    assert!(evaluated.status.success(), "{}", stderr(&evaluated));
    let text = String::from_utf8_lossy(&evaluated.stdout).into_owned();
    for part in
        ["image, compensation", "image, joint's observer", "full, refitted", "Rows \"refitted\" were identified anew"]
    {
        assert!(text.contains(part), "{part} is not in {text}");
    }

    for key in ["joint.key", "other.key"] {
        assert!(run(&["key", "new", key]).status.success());
    }
    assert!(stderr(&run(&["key", "new", "joint.key"])).contains("joint.key exists; a key is never overwritten"));
    assert!(run(&["sign", "again.img", "--key", "joint.key", "--version", "7", "--serial", "12"]).status.success());
    assert_eq!(read("again.signed").len(), read("again.img").len() + 32);
    assert!(run(&["image", "verify", "again.signed", "--key", "joint.key"]).status.success());
    // Through pipes: TOML to a binary image with a tag, to its verification.
    let piped = "$0 image convert again.img - | $0 sign - --key joint.key --version 7 --serial 12 > piped.signed && \
                 $0 image verify - --key joint.key < piped.signed && cat again.img | $0 image convert - piped.toml";
    let mut shell = Command::new("bash");
    shell.args(["-o", "pipefail", "-c", piped, env!("CARGO_BIN_EXE_jointctl")]).current_dir(folder.path());
    let output = shell.output().expect("bash starts");
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(read("piped.signed"), read("again.signed"));
    assert_eq!(read("piped.toml"), read("again.toml"));
    assert!(!folder.path().join("-").exists() && !folder.path().join("-.signed").exists());
    let refused = run(&["image", "verify", "again.signed", "--key", "other.key"]);
    assert!(!refused.status.success() && stderr(&refused).contains("its tag is not of key"), "{}", stderr(&refused));
    let refused = run(&["image", "verify", "again.img", "--key", "joint.key"]);
    assert!(!refused.status.success() && stderr(&refused).contains("no tag behind it"), "{}", stderr(&refused));
    let inspected = run(&["image", "inspect", "again.signed"]);
    let text = String::from_utf8_lossy(&inspected.stdout).into_owned();
    assert!(text.contains("version = 7\n") && text.contains("serial = 12\n"), "{text}");

    let mut damaged = read("again.img");
    damaged[100] ^= 1;
    std::fs::write(folder.path().join("damaged.img"), damaged).unwrap();
    let refused = run(&["image", "verify", "damaged.img"]);
    assert!(!refused.status.success() && stderr(&refused).contains("damaged.img: damaged: checksum"));

    let text = String::from_utf8(read("again.toml")).unwrap();
    let format = text.lines().find(|line| line.starts_with("format = ")).unwrap();
    for (edit, to, expected) in [
        (format, "format = 9", "format is 9, this program reads formats 1 to "),
        ("version = 1", "version = 1\nflavour = 3", "flavour"),
        ("effort = \"Nm\"", "effort = \"lbf\"", "known are Nm, N, A, V"),
    ] {
        std::fs::write(folder.path().join("edited.toml"), text.replacen(edit, to, 1)).unwrap();
        let refused = run(&["image", "convert", "edited.toml", "again.img", "--force"]);
        assert!(!refused.status.success() && stderr(&refused).contains(expected), "{}", stderr(&refused));
    }
    assert_eq!(read("again.img"), read("demo/friction.img"), "a refused conversion left its target as it was");

    // A person changes a coefficient: the golden vectors no longer hold until they are computed anew.
    let edited = text.replacen("margin = 0.5", "margin = 0.25", 1);
    assert_ne!(edited, text);
    let edited = edited.replacen("constant = ", "constant = 0.5 #", 1).replacen("viscous = ", "viscous = 1.0 #", 1);
    std::fs::write(folder.path().join("edited.toml"), edited).unwrap();
    let refused = run(&["image", "convert", "edited.toml", "edited.img"]);
    assert!(!refused.status.success() && stderr(&refused).contains("golden vector 0"), "{}", stderr(&refused));
    assert!(run(&["image", "convert", "edited.toml", "edited.img", "--recompute-golden"]).status.success());
}

/// Named columns of a table that `--export` wrote.
fn exported(path: &Path) -> std::collections::BTreeMap<String, Vec<String>> {
    let bytes = std::fs::read(path).unwrap();
    let mut text = Vec::new();
    match path.extension().is_some_and(|extension| extension == "gz") {
        true => std::io::copy(&mut flate2::read::GzDecoder::new(&bytes[..]), &mut text).map(drop).unwrap(),
        false => text = bytes,
    }
    let mut reader = csv::Reader::from_reader(&text[..]);
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let column = |at: usize| rows.iter().map(|row| row[at].to_owned()).collect();
    names.into_iter().enumerate().map(|(at, name)| (name, column(at))).collect()
}

#[test]
fn the_exported_table_holds_every_sample_and_gives_the_reported_errors() {
    let folder = with_demo();
    let run = |arguments: &[&str]| jointctl(folder.path(), arguments);
    let fit = ["fit", "demo/dataset.toml", "--out", "out", "--trainer", "none", "--export", "fit.csv.gz"];
    assert!(run(&fit).status.success());
    let evaluate = ["evaluate", "out/friction.img", "demo/dataset.toml", "--json", "--export", "evaluate.csv"];
    let evaluated = run(&evaluate);
    assert!(evaluated.status.success(), "{}", stderr(&evaluated));
    let report = std::fs::read(folder.path().join("out/report.json")).unwrap();
    for (file, json) in [("fit.csv.gz", &report), ("evaluate.csv", &evaluated.stdout)] {
        let json: serde_json::Value = serde_json::from_slice(json).unwrap();
        let table = exported(&folder.path().join(file));
        let number = |name: &str| table[name].iter().map(|text| text.parse::<f64>().unwrap()).collect::<Vec<_>>();
        let set = &json["errors"][0];
        let member = &table[&format!("test {}", set["test_set"].as_str().unwrap())];
        let effort = number("effort_Nm");
        let rows = set["rows"].as_array().unwrap();
        for row in rows {
            let predicted = number(&format!("predicted {}", row["model"].as_str().unwrap()));
            let errors: Vec<f64> =
                (0..effort.len()).filter(|&i| member[i] == "1").map(|i| effort[i] - predicted[i]).collect();
            let rmse = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
            let reported = &row["errors"]["overall"];
            assert_eq!(Some(errors.len() as u64), reported["samples"].as_u64());
            let reported = reported["rmse"].as_f64().unwrap();
            assert!((rmse - reported).abs() <= 1e-9 * reported, "{row}: {rmse}");
        }
        assert!(rows.iter().any(|row| row["model"] == "image, fixed point"));
        for part in ["train", "validation", "test"] {
            let found = table["part"].iter().filter(|text| *text == part).count();
            assert!(found > 300, "{found} samples of {part}");
        }
        // The regressors are those of the very sample.
        let (position, sine) = (number("position_rad"), number("rigid gravity_sine"));
        assert!(position.iter().zip(sine).all(|(position, sine)| position.sin() == sine));
        assert_eq!(number("acceleration_rad_s2"), number("rigid inertia"));
    }
    std::fs::create_dir(folder.path().join("taken.csv")).unwrap();
    let refused = run(&["evaluate", "out/friction.img", "demo/dataset.toml", "--export", "taken.csv"]);
    assert!(!refused.status.success() && stderr(&refused).contains("taken.csv"), "{}", stderr(&refused));
}

#[test]
fn an_image_stays_within_the_torque_limit_of_the_joint_that_it_is_for() {
    let folder = with_demo();
    let fit = |out: &str, limit: &[&str]| {
        let fit = ["fit", "demo/dataset.toml", "--out", out, "--trainer", "none", "--preset", "coulomb-viscous"];
        let output = jointctl(folder.path(), &[&fit[..], limit].concat());
        let report = std::fs::read(folder.path().join(out).join("report.json"));
        let report: serde_json::Value =
            report.map_or_else(|_| "none".into(), |report| serde_json::from_slice(&report).unwrap());
        let friction = &report["certificate"][0];
        (output, friction["value"].as_f64(), friction["limit"].as_f64())
    };
    let (output, reached, _) = fit("free", &[]);
    let reached = reached.unwrap_or_else(|| panic!("{}", stderr(&output)));
    // What it can reach is enough; with a step of the image's numbers less the model counts for slower motion only.
    for (out, limit) in [("enough", reached), ("less", reached - 1.0 / 65_536.0)] {
        let (output, value, told) = fit(out, &["--torque-limit", &limit.to_string()]);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(value.unwrap() <= limit && told == Some(limit), "{value:?} {told:?} {limit}");
        assert_eq!(value == Some(reached), out == "enough", "{value:?} {reached}");
    }
    let (output, ..) = fit("none", &["--torque-limit", "0.01"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("friction can reach"), "{}", stderr(&output));
    for limit in ["0.009", "2000.1", "NaN"] {
        let (output, ..) = fit("wrong", &["--torque-limit", limit]);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains("must be 0.01 to 2000"), "{}", stderr(&output));
    }
}

#[test]
fn a_fit_that_fails_says_why_and_leaves_earlier_results_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("joint");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("friction.img"), b"earlier").unwrap();
    std::fs::write(folder.path().join("joint.toml"), DESCRIPTION).unwrap();
    std::fs::write(folder.path().join("log.csv"), "t,q,tau\n0,0,0\n0.01,0.1,x\n").unwrap();
    let refused = jointctl(folder.path(), &["fit", "joint.toml"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("friction.img exists; --force replaces it"), "{}", stderr(&refused));
    let output = jointctl(folder.path(), &["fit", "joint.toml", "--force"]);
    assert_eq!(output.status.code(), Some(1));
    let text = stderr(&output);
    assert!(
        text.contains("log.csv") && text.contains("line 3") && text.contains("tau") && text.contains('x'),
        "{text}"
    );
    assert_eq!(std::fs::read(out.join("friction.img")).unwrap(), b"earlier");
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1);
}

/// The cells of a row of a table that is printed.
fn row<'a>(text: &'a str, first: &str, second: &str) -> Vec<&'a str> {
    let cells = |line: &'a str| line.split_whitespace().collect::<Vec<_>>();
    let found = text.lines().map(cells).find(|cells| cells.len() > 2 && cells[0] == first && cells[1] == second);
    found.unwrap_or_else(|| panic!("no row {first} {second} in {text}"))
}

#[test]
fn a_simulation_shows_the_joint_without_and_with_its_image_and_repeats_itself_from_the_files_that_it_wrote() {
    let folder = with_demo();
    let run = |arguments: &[&str]| {
        let output = jointctl(folder.path(), arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let read = |file: &str| std::fs::read(folder.path().join(file)).unwrap();
    let text = run(&["sim", "--image", "demo/friction.img", "--scenario", "sine-sweep", "--scenario", "hot-and-cold"]);
    assert!(text.contains("times faster than real time"), "{text}");
    for scenario in ["sine-sweep", "hot-and-cold/cold", "hot-and-cold/warm"] {
        let number =
            |compensation, column: usize| -> f64 { row(&text, scenario, compensation)[column].parse().unwrap() };
        assert!(number("on", 2) < number("off", 2), "position error of {scenario}: {text}");
        assert!(number("on", 5) < number("off", 5), "torque error of {scenario}: {text}");
    }
    let page = String::from_utf8(read("sim/sim.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("sine-sweep") && !page.contains("stopped after"));
    let log = String::from_utf8(read("sim/hot-and-cold-on.csv")).unwrap();
    assert!(log.contains("\ncold,") && log.contains("\nhot,"));

    run(&[
        "sim",
        "--config",
        "sim/joint.toml",
        "--plant",
        "sim/plant.toml",
        "--scenario",
        "sine-sweep",
        "--out",
        "again",
    ]);
    for file in ["joint.toml", "plant.toml", "sine-sweep-off.csv"] {
        assert!(read(&format!("again/{file}")) == read(&format!("sim/{file}")), "{file} differs");
    }
    assert!(!folder.path().join("again/sine-sweep-on.csv").exists(), "there was no image");

    let good = String::from_utf8(read("sim/joint.toml")).unwrap();
    for (edit, to, expected) in [
        ("stiffness = ", "stifness = ", "unknown field `stifness`"),
        ("command_deadline = ", "# ", "missing field `command_deadline`"),
        ("ratio = 50.0", "ratio = 0.5", "gear ratio's magnitude is 0.5, must lie in 1 to 500"),
    ] {
        std::fs::write(folder.path().join("broken.toml"), good.replacen(edit, to, 1)).unwrap();
        let refused = jointctl(folder.path(), &["sim", "--config", "broken.toml", "--out", "never"]);
        let shown = stderr(&refused);
        assert!(!refused.status.success() && shown.contains("broken.toml") && shown.contains(expected), "{shown}");
    }
    assert!(!folder.path().join("never").exists());
}

#[test]
fn an_excitation_is_found_within_the_limits_passes_its_check_and_fails_that_of_a_slower_joint() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| jointctl(folder.path(), arguments);
    let output = run(&["excite", "--out", "motion.csv"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let last = text.lines().find(|line| line.starts_with("median of")).unwrap();
    let number = |text: &str| -> f64 { text.rsplit(": ").next().unwrap().parse().unwrap() };
    let (random, found) = last.split_once(';').unwrap();
    assert!(number(found) < 0.8 * number(random), "{text}");
    for file in ["motion.csv", "motion.toml"] {
        let checked = run(&["excite", "--check", file]);
        assert!(checked.status.success(), "{}", stderr(&checked));
        let simulated = run(&["sim", "--scenario", "excitation", "--excitation", file, "--force"]);
        assert!(simulated.status.success(), "{}", stderr(&simulated));
        let log = std::fs::read_to_string(folder.path().join("sim/excitation-off.csv")).unwrap();
        // Ten seconds and the move to the middle of the positions, every 4 ms.
        assert_eq!(log.lines().count(), 2626, "{file}");
        let refused = run(&["excite", "--check", file, "--velocity", "0.5"]);
        let shown = stderr(&refused);
        assert!(!refused.status.success() && shown.contains(file) && shown.contains("permitted are 0.5"), "{shown}");
    }
}

/// A robot of two joints.
const ARM: &str = "<robot name='arm'><link name='base'/>
<joint name='one' type='revolute'><parent link='base'/><child link='a'/><axis xyz='0 1 0'/><limit lower='-1' upper='1' velocity='2'/></joint>
<link name='a'><inertial><mass value='2'/><inertia ixx='.02' ixy='0' ixz='0' iyy='.02' iyz='0' izz='.01'/></inertial></link>
<joint name='two' type='revolute'><parent link='a'/><child link='b'/><origin xyz='0 0 .3'/><axis xyz='1 0 0'/>
<limit lower='-1' upper='1' velocity='2'/></joint>
<link name='b'><inertial><origin xyz='0 .1 .1'/><mass value='1'/><inertia ixx='.01' ixy='0' ixz='0' iyy='.01' iyz='0' izz='.01'/></inertial>
</link></robot>";

#[test]
fn a_robot_is_excited_within_its_limits_the_same_way_by_the_same_seed_and_each_table_is_one_of_a_joint() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.urdf"), ARM).unwrap();
    std::fs::write(folder.path().join("robot.toml"), "urdf = 'arm.urdf'\n[joint.one]\n[joint.two]\n").unwrap();
    let run = |arguments: &[&str]| jointctl(folder.path(), arguments);
    let excite = |out: &str, more: &[&str]| {
        let search = ["--draws", "4", "--rounds", "1", "--duration", "8"];
        run(&[&["robot", "excite", "robot.toml", "--out", out], &search[..], more].concat())
    };
    let refused = excite("motion", &[]);
    let shown = stderr(&refused);
    assert!(
        !refused.status.success() && shown.contains("robot.toml: joint one has no limit of its acceleration"),
        "{shown}"
    );
    assert!(!folder.path().join("motion").exists());
    let output = excite("motion", &["--acceleration", "5", "--floor", "-0.1", "--json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(found["condition_number"].as_f64() <= found["random"]["condition_number"].as_f64(), "{found}");
    assert!(found["lowest"]["height"].as_f64().unwrap() >= -0.1, "{found}");
    assert!(excite("again", &["--acceleration", "5", "--floor", "-0.1"]).status.success());
    for file in ["one.csv", "two.csv", "excitation.toml"] {
        let read = |out: &str| std::fs::read(folder.path().join(out).join(file)).unwrap();
        assert!(read("motion") == read("again"), "{file}");
    }
    // 90 % of travel and velocity.
    let limits = ["--low", "-0.9", "--high", "0.9", "--velocity", "1.8", "--acceleration", "5"];
    for file in ["motion/one.csv", "motion/two.csv"] {
        let checked = run(&[&["excite", "--check", file], &limits[..]].concat());
        assert!(checked.status.success(), "{}", stderr(&checked));
    }
}

#[test]
fn nothing_that_exists_is_replaced_without_being_told_to_and_a_path_that_cannot_be_written_is_told_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let run = |arguments: &[&str]| jointctl(folder.path(), arguments);
    for name in ["demo", "sim"] {
        std::fs::create_dir(path(name)).unwrap();
    }
    let files = ["demo/loop.html", "sim/joint.toml", "excitation.toml", "joint.eds", "joint.dbc", "bus.yml"];
    let names = ["demo", "sim", "excite", "eds", "dbc", "bus-yml --node 5"];
    for (file, name) in files.into_iter().zip(names) {
        std::fs::write(path(file), "mine").unwrap();
        let refused = run(&name.split(' ').collect::<Vec<_>>());
        assert_eq!(refused.status.code(), Some(2), "{name}: {}", stderr(&refused));
        let told = format!("{} exists; --force replaces it", Path::new(file).file_name().unwrap().display());
        assert!(stderr(&refused).contains(&told), "{name}: {}", stderr(&refused));
        assert_eq!(std::fs::read(path(file)).unwrap(), b"mine");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), files.len());
    for arguments in
        [&["demo", "--out", "joint.eds/demo"][..], &["eds", "joint.eds/below"], &["excite", "--out", "sim"]]
    {
        let refused = run(&[arguments, &["--force"]].concat());
        let text = stderr(&refused);
        assert!(refused.status.code() == Some(1) && text.contains("cannot "), "{arguments:?}: {text}");
    }
    assert!(run(&["eds", "--force"]).status.success());
    assert_ne!(std::fs::read(path("joint.eds")).unwrap(), b"mine");
}

const DESCRIPTION: &str = r#"
name = "joint"
[source]
files = ["log.csv"]
[columns]
time = { column = "t" }
position = { column = "q" }
effort = { column = "tau", unit = "Nm" }
"#;

#[test]
fn a_virtual_joint_on_a_bus_is_found_and_a_bus_without_one_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let port = bus::free_port().unwrap();
    let (listening, calling) = (format!("slcan:listen://127.0.0.1:{port}"), format!("slcan:tcp://127.0.0.1:{port}"));
    let start = || {
        let mut joint = Command::new(env!("CARGO_BIN_EXE_jointctl"))
            .current_dir(folder.path())
            .args(["sim", "--bus", &listening, "--node", "7", "--duration", "60", "--storage", "kept"])
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut log = std::io::BufReader::new(joint.stderr.take().unwrap());
        std::io::BufRead::read_line(&mut log, &mut line).unwrap();
        assert!(line.starts_with("node 7 on slcan:listen"), "{line}");
        joint
    };
    let mut joint = start();

    let found = jointctl(folder.path(), &["scan", "--bus", &calling]);
    let text = String::from_utf8_lossy(&found.stdout).into_owned();
    assert!(found.status.success() && text.lines().count() == 1, "{text} {}", stderr(&found));
    assert!(text.starts_with("node 7: virtual joint") && text.contains("serial 7"), "{text}");
    let on = |arguments: &[&str]| {
        let output = jointctl(folder.path(), &[arguments, &["--bus", &calling, "--node", "7"]].concat());
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    on(&["set", "command-deadline", "0.25"]);
    on(&["store"]);
    joint.kill().unwrap();
    joint.wait().unwrap();
    let mut joint = start();
    let kept = on(&["get", "command-deadline"]);
    assert!(kept.contains("0.25 s"), "{kept}");
    joint.kill().unwrap();
    joint.wait().unwrap();

    let gone = jointctl(folder.path(), &["scan", "--bus", &calling]);
    assert!(!gone.status.success() && stderr(&gone).contains(&calling), "{}", stderr(&gone));
    let empty = jointctl(folder.path(), &["scan", "--bus", "virtual:empty"]);
    assert!(!empty.status.success() && stderr(&empty).contains("no node answered"), "{}", stderr(&empty));
    for (bus, problem) in [("can0", "a kind and a colon are missing"), ("socketcan:nocan9", "nocan9")] {
        let refused = jointctl(folder.path(), &["sim", "--bus", bus]);
        assert!(!refused.status.success() && stderr(&refused).contains(problem), "{}", stderr(&refused));
    }
    let refused = jointctl(folder.path(), &["sim", "--bus", "virtual:x", "--node", "200"]);
    assert!(!refused.status.success() && stderr(&refused).contains("node id 200"), "{}", stderr(&refused));
}

#[test]
fn an_emulated_board_that_cannot_be_set_up_says_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("no.elf"), b"a letter").unwrap();
    let mut plant = plant::ActuatorParameters::reference();
    plant.sensors.encoder.counts_per_turn = 4_096;
    std::fs::write(path("plant.toml"), toml::to_string(&plant).unwrap()).unwrap();
    let board = ["sim", "--bus", "virtual:elf", "--elf", "no.elf", "--board", "moteus-r4"];
    for (arguments, problem) in [
        (&[][..], "no.elf: "),
        (&["--commands", "missing"][..], "missing: "),
        (&["--plant", "plant.toml"][..], "moteus-r4's encoder: encoder.counts = 4096 is outside 16384..=16384"),
    ] {
        let refused = jointctl(folder.path(), &[&board, arguments].concat());
        assert!(!refused.status.success() && stderr(&refused).contains(problem), "{}", stderr(&refused));
    }
    let refused = jointctl(folder.path(), &["sim", "--bus", "virtual:elf", "--commands", "-"]);
    assert!(!refused.status.success() && stderr(&refused).contains("--elf <ELF>"), "{}", stderr(&refused));
}
