//! Forty virtual joints over ten days: every change is found and named, bad partitions cost nothing but themselves, and
//! the tables are the same bytes whatever the number of threads and interruptions.

mod fleet_of_joints;

use fleet::finding::{Finding, Kind, findings};
use fleet::night::{Night, NightError, Scope, night};
use fleet_of_joints::{DAYS, JOINTS, day, joint};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The fleet's files, made once.
fn data() -> &'static Path {
    static DATA: OnceLock<PathBuf> = OnceLock::new();
    DATA.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("virtual-fleet");
        let _ = fs::remove_dir_all(&folder);
        fleet_of_joints::write(&folder);
        folder
    })
}

/// The same files in a folder of a test's own.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let mut waiting = vec![data().to_owned()];
    while let Some(from) = waiting.pop() {
        for entry in fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            let to = folder.path().join(path.strip_prefix(data()).unwrap());
            if path.is_dir() {
                fs::create_dir_all(&to).unwrap();
                waiting.push(path);
            } else {
                fs::hard_link(&path, &to).unwrap();
            }
        }
    }
    folder
}

fn whole(folder: &Path, threads: usize) -> Night {
    night(folder, &Scope::default(), threads, &|| true).unwrap()
}

/// Every file of the sums with its bytes.
fn sums(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut waiting = vec![folder.join("_sums")];
    while let Some(from) = waiting.pop() {
        for entry in fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                waiting.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn of(findings: &[Finding], number: usize) -> &Finding {
    findings.iter().find(|finding| finding.joint == joint(number)).unwrap()
}

#[test]
fn every_joint_that_changed_is_found_with_kind_and_day_and_no_other() {
    let folder = copy();
    let findings = findings(&whole(folder.path(), 0).entries);
    for finding in &findings {
        println!("{} {:?} {:?} {} {:?}", finding.joint, finding.kind, finding.since, finding.reason, finding.change);
    }
    let expected = BTreeMap::from([
        (5, Kind::Drifted),
        (11, Kind::Drifted),
        (17, Kind::Drifted),
        (23, Kind::FrictionFell),
        (29, Kind::Broken),
        (35, Kind::WrongConfiguration),
        (37, Kind::WrongConfiguration),
        (39, Kind::NotEnoughMotion),
    ]);
    assert_eq!(findings.len(), JOINTS);
    for number in 0..JOINTS {
        let found = of(&findings, number);
        let kind = expected.get(&number).copied().unwrap_or(Kind::Healthy);
        assert_eq!(found.kind, kind, "{}: {} {:?}", found.joint, found.reason, found.change);
    }
    for number in [11, 23, 29, 35, 37] {
        assert_eq!(of(&findings, number).since.as_deref(), Some(day(5).as_str()), "{}", joint(number));
    }
    assert!(of(&findings, 35).reason.contains("torque constant"));
    assert!(of(&findings, 37).reason.contains("sign"));
    let change = of(&findings, 11).change.unwrap();
    assert!((change.friction - 1.4).abs() < 0.1 && (change.rigid - 1.0).abs() < 0.05, "{change:?}");
    let change = of(&findings, 35).change.unwrap();
    assert!((change.rigid - 0.8).abs() < 0.02 && (change.friction - 0.8).abs() < 0.05, "{change:?}");
    // The worst comes first.
    assert!(findings.windows(2).all(|pair| pair[0].kind <= pair[1].kind));
}

#[test]
fn bad_partitions_are_named_and_the_rest_of_the_joint_is_used() {
    let folder = copy();
    fs::create_dir_all(folder.path().join("lost+found")).unwrap();
    let night = whole(folder.path(), 0);
    let bad: Vec<(&str, &str, &str)> = night
        .entries
        .iter()
        .filter(|entry| !entry.defect.is_empty())
        .map(|entry| (entry.joint.as_str(), entry.day.as_str(), entry.defect.as_str()))
        .collect();
    let parts = [
        (2, 3, "is no Parquet file"),
        (3, 4, "row 1001, column \"torque_Nm\": NaN"),
        (4, 2, "no column \"torque_Nm\"; available: time_s"),
        (6, 5, "row 1501: the clock jumps from"),
        (7, 8, "the same bytes as day=2026-01-08"),
        (8, 6, "log.parquet: the same bytes as log-2.parquet"),
    ];
    assert_eq!(bad.len(), parts.len(), "{bad:?}");
    for ((number, at, part), (name, date, defect)) in parts.into_iter().zip(bad) {
        assert_eq!((name, date), (joint(number).as_str(), day(at).as_str()));
        assert!(defect.contains(part), "{defect}");
        let path = folder.path().to_str().unwrap();
        assert!(!defect.contains(path) || part.contains("same"), "{defect}");
    }
    assert_eq!(night.entries.len(), JOINTS * DAYS);
    assert_eq!(night.misplaced.len(), 1, "{:?}", night.misplaced);
    let findings = findings(&night.entries);
    for (number, ..) in parts {
        assert_eq!((of(&findings, number).bad_days, of(&findings, number).days.len()), (1, DAYS));
    }
}

#[test]
fn one_thread_four_threads_and_an_interrupted_night_give_the_same_bytes() {
    let (one, four, interrupted) = (copy(), copy(), copy());
    assert_eq!(whole(one.path(), 1).read, JOINTS * DAYS);
    whole(four.path(), 4);
    let left = AtomicUsize::new(15);
    let more = || left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok();
    let first = night(interrupted.path(), &Scope::default(), 4, &more).unwrap();
    assert_eq!(first.read, 15 * DAYS);
    assert!(!interrupted.path().join("_sums/all.parquet").exists());
    // A process that was killed while it wrote: half of a table, which is made anew, and a file that is none.
    let half = interrupted.path().join(format!("_sums/joint={}.parquet", joint(0)));
    fs::write(&half, b"PAR1 half").unwrap();
    let second = whole(interrupted.path(), 4);
    let (kept, read) = (second.kept, second.read);
    assert!(kept >= 14 * DAYS && kept + read == JOINTS * DAYS, "{kept} {read}");
    let expected = sums(one.path());
    assert_eq!(expected.len(), JOINTS + 1);
    for folder in [&four, &interrupted] {
        let found = sums(folder.path());
        assert!(found.keys().eq(expected.keys()));
        assert!(found == expected, "the bytes differ");
    }
}

#[test]
fn what_is_unchanged_is_not_read_again_and_what_changed_is() {
    let folder = copy();
    whole(folder.path(), 0);
    let again = whole(folder.path(), 0);
    assert_eq!((again.read, again.kept), (0, JOINTS * DAYS));
    let from = folder.path().join(format!("joint={}/day={}/log.parquet", joint(0), day(1)));
    let to = folder.path().join(format!("joint={}/day={}/log.parquet", joint(1), day(1)));
    fs::remove_file(&to).unwrap();
    fs::copy(from, to).unwrap();
    let changed = whole(folder.path(), 0);
    assert_eq!((changed.read, changed.kept), (1, JOINTS * DAYS - 1));
}

/// A fleet of one joint with so many days, all with the same rows.
fn one_joint(days: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let from = data().join(format!("joint={}/day={}/log.parquet", joint(1), day(0)));
    for number in 0..days {
        let to = folder.path().join(format!("joint=a/day=20{:02}-01-01", number + 10));
        fs::create_dir_all(&to).unwrap();
        fs::copy(&from, to.join("log.parquet")).unwrap();
    }
    folder
}

#[test]
fn a_joint_s_table_is_written_after_each_32_days_and_an_interruption_loses_none_that_is_in_it() {
    let asked = |days: usize| {
        let count = AtomicUsize::new(0);
        let more = || count.fetch_add(1, Ordering::Relaxed) < usize::MAX;
        night(one_joint(days).path(), &Scope::default(), 2, &more).unwrap();
        count.into_inner()
    };
    assert_eq!([1, 32, 33, 64, 65].map(asked), [1, 1, 2, 2, 3]);

    let (folder, expected) = (one_joint(70), one_joint(70));
    whole(expected.path(), 2);
    let pieces = |pieces: usize| {
        let left = AtomicUsize::new(pieces);
        let more = || left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok();
        night(folder.path(), &Scope::default(), 2, &more).unwrap()
    };
    let stored = || night(folder.path(), &Scope { joints: vec![], stored: true }, 1, &|| true).unwrap();
    assert_eq!((pieces(2).read, stored().entries.len()), (64, 64));
    let rest = pieces(3);
    assert_eq!((rest.kept, rest.read), (64, 6));
    assert!(sums(folder.path()) == sums(expected.path()), "the bytes differ");

    // A day of the first piece changes, and the night ends behind it: the days after it are not lost.
    let changed = folder.path().join("joint=a/day=2012-01-01/log.parquet");
    fs::copy(data().join(format!("joint={}/day={}/log.parquet", joint(1), day(1))), changed).unwrap();
    assert_eq!(pieces(1).read, 1);
    let all = stored();
    assert_eq!((all.entries.len(), all.misplaced.len()), (70, 0));
    assert_eq!(pieces(3).read, 0);
}

#[test]
fn a_day_that_is_removed_leaves_the_table_and_one_before_the_others_joins_it() {
    let (folder, expected) = (copy(), copy());
    whole(folder.path(), 0);
    let of = |folder: &Path, at| folder.join(format!("joint={}/day={}", joint(1), day(at)));
    fs::remove_dir_all(of(folder.path(), 4)).unwrap();
    fs::rename(of(folder.path(), 7), of(folder.path(), 7).with_file_name("day=2025-12-31")).unwrap();
    fs::remove_dir_all(of(expected.path(), 4)).unwrap();
    fs::rename(of(expected.path(), 7), of(expected.path(), 7).with_file_name("day=2025-12-31")).unwrap();
    let changed = whole(folder.path(), 0);
    assert_eq!((changed.read, changed.kept), (1, JOINTS * DAYS - 2));
    whole(expected.path(), 0);
    assert!(sums(folder.path()) == sums(expected.path()), "the bytes differ");
    fs::remove_dir_all(of(folder.path(), 2)).unwrap();
    fs::remove_dir_all(of(expected.path(), 2)).unwrap();
    assert_eq!(whole(folder.path(), 0).read, 0);
    fs::remove_dir_all(expected.path().join("_sums")).unwrap();
    whole(expected.path(), 0);
    assert!(sums(folder.path()) == sums(expected.path()), "the bytes differ where a day is gone and none is new");
}

#[test]
fn joints_one_by_one_and_their_stored_sums_give_the_bytes_of_the_whole() {
    let (whole_folder, folder) = (copy(), copy());
    let expected = whole(whole_folder.path(), 0);
    let of = |joints: &[String], stored| night(folder.path(), &Scope { joints: joints.to_vec(), stored }, 1, &|| true);
    for number in 1..JOINTS {
        assert_eq!(of(&[joint(number)], false).unwrap().read, DAYS);
    }
    let all = folder.path().join("_sums/all.parquet");
    let partly = of(&[], true).unwrap();
    assert_eq!((partly.entries.len(), partly.misplaced.len(), partly.read), ((JOINTS - 1) * DAYS, DAYS, 0));
    assert!(partly.misplaced.iter().all(|bad| bad.reason.contains("not summed up") && !all.exists()));
    of(&[joint(0)], false).unwrap();
    assert!(!all.exists());
    let joined = of(&[], true).unwrap();
    assert_eq!((joined.entries.len(), joined.read), (expected.entries.len(), 0));
    assert!(sums(folder.path()) == sums(whole_folder.path()), "the bytes differ");

    // One byte more: these are other files.
    let file = folder.path().join(format!("joint={}/day={}/log.parquet", joint(2), day(3)));
    let mut bytes = fs::read(&file).unwrap();
    bytes.push(0);
    fs::remove_file(&file).unwrap();
    fs::write(&file, bytes).unwrap();
    let changed = of(&[], true).unwrap();
    assert_eq!((changed.entries.len(), changed.misplaced.len()), (JOINTS * DAYS - 1, 1));
    assert!(changed.misplaced[0].reason.contains("changed since"), "{:?}", changed.misplaced);

    let error = of(&[joint(0), "nowhere".into()], false).unwrap_err();
    assert!(matches!(error, NightError::NoJoint { .. }), "{error}");
    assert!(error.to_string().contains("no folder joint=nowhere; --joint takes a name"), "{error}");
}
