//! Storage of a joint: damaged records, stores in a loop, faults that outlive the power. Simulated time; the files of
//! `--storage`.

mod master;

use bus::client::sdo::Failure;
use bus::client::{Abort, Command};
use friction_compensation::parameters::fault_log::LoggedFault;
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::STORES;
use joint_firmware::objects::fault_log::decode;
use master::Master;
use node::{SampleImage, Storage};
use std::path::Path;

const DAMAGED: (u16, u8) = (0x2304, 1);
const LEFT: (u16, u8) = (0x2304, 2);
/// A page of two, in which the first of two stored contents lies.
const PAGE: usize = 2048;

fn start(folder: &Path) -> Master {
    Master::powered(Storage::open(folder).unwrap())
}

/// A byte of a file's content of so many stores, as it is kept: the header's length.
fn damage(folder: &Path, file: &str, stores: usize) {
    let path = folder.join(file);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[(stores - 1) % 2 * PAGE] ^= 0x40;
    std::fs::write(path, bytes).unwrap();
}

fn stiffness(master: &mut Master, value: f32) {
    master.download(0x2104, 3, &value.to_le_bytes()).unwrap();
    master.download(0x2100, 1, &[1]).unwrap();
    master.wait(2);
}

fn store(master: &mut Master) -> Result<(), Failure> {
    master.download(0x1010, 1, b"save")
}

fn staged(master: &mut Master) -> f32 {
    f32::from_bits(master.number(0x2104, 3) as u32)
}

/// Asks for all of the way to "operation enabled".
fn tries_to_enable(master: &mut Master) -> State {
    master.command(Command::Start);
    for controlword in [0x80, 6, 7, 15] {
        master.drive(controlword, 0, 20);
    }
    master.state()
}

#[test]
fn a_joint_whose_configuration_is_damaged_says_so_at_every_start_and_is_not_enabled_before_one_is_stored() {
    for stores in [1, 2] {
        let folder = tempfile::tempdir().unwrap();
        let mut master = start(folder.path());
        let defaults = staged(&mut master);
        for value in [50.0, 60.0].into_iter().take(stores) {
            stiffness(&mut master, value);
            store(&mut master).unwrap();
        }
        drop(master);
        assert_eq!(tries_to_enable(&mut start(folder.path())), State::OperationEnabled);
        damage(folder.path(), "configuration.bin", stores);
        for _ in 0..2 {
            let mut master = start(folder.path());
            assert!(master.emergencies().contains(&0x6310), "{:04x?}", master.emergencies());
            assert_eq!((master.number(0x1001, 0), master.number(DAMAGED.0, DAMAGED.1)), (0x81, 2));
            // Settings stored before, or the defaults.
            assert_eq!(staged(&mut master), if stores == 2 { 50.0 } else { defaults });
            assert_eq!(tries_to_enable(&mut master), State::SwitchOnDisabled);
        }
        // A master that goes on asking does not set it in motion by that.
        let mut master = start(folder.path());
        master.command(Command::Start);
        master.drive(15, 500, 50);
        store(&mut master).unwrap();
        master.drive(15, 500, 50);
        assert_eq!((master.state(), master.number(DAMAGED.0, DAMAGED.1)), (State::SwitchOnDisabled, 0));
        assert_eq!(tries_to_enable(&mut master), State::OperationEnabled);
        drop(master);
        let mut master = start(folder.path());
        assert_eq!((master.number(0x1001, 0), tries_to_enable(&mut master)), (0, State::OperationEnabled));
    }
}

#[test]
fn a_damaged_image_is_told_at_every_start_and_the_joint_goes_on_without_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut storage = Storage::open(folder.path()).unwrap();
    for version in [1, 2] {
        storage.store_image(&SampleImage::constant(version, 0.25)).unwrap();
    }
    damage(folder.path(), "images.bin", 2);
    for _ in 0..2 {
        let mut master = start(folder.path());
        assert!(master.emergencies().contains(&0x6310), "{:04x?}", master.emergencies());
        assert_eq!((master.number(0x1001, 0), master.number(DAMAGED.0, DAMAGED.1)), (0x81, 1));
        assert_eq!(master.number(0x2213, 1), 1, "the image before");
        // Less is compensated, which is no danger.
        assert_eq!(tries_to_enable(&mut master), State::OperationEnabled);
    }
}

#[test]
fn who_stores_in_a_loop_is_stopped_before_the_flash_is_worn_out_and_a_reset_of_the_node_gives_nothing_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut master = start(folder.path());
    let mut stored = 0;
    for number in 0..3 * u16::from(STORES) {
        master.download(0x1017, 0, &(1_000 + number).to_le_bytes()).unwrap();
        match store(&mut master) {
            Ok(()) => stored += 1,
            refused => assert_eq!(refused, Err(Failure::Aborted(Abort::DEVICE_STATE))),
        }
        if number % 10 == 0 {
            master.command(Command::ResetNode);
            master.wait(10);
        }
    }
    assert_eq!((stored, master.number(LEFT.0, LEFT.1)), (u16::from(STORES), 0));
    // Somebody switches it off and on.
    drop(master);
    let mut master = start(folder.path());
    assert_eq!(master.number(0x1017, 0), 999 + i64::from(STORES));
    assert_eq!(master.number(LEFT.0, LEFT.1), i64::from(STORES));
}

/// A master that falls silent in motion, and its fault acknowledged; the log afterwards.
fn fails(master: &mut Master) -> Vec<LoggedFault> {
    assert_eq!(tries_to_enable(master), State::OperationEnabled);
    master.wait(3_000);
    assert_eq!(master.state(), State::Fault);
    logged(master)
}

fn logged(master: &mut Master) -> Vec<LoggedFault> {
    decode(&master.upload(0x2305, 3)).collect()
}

#[test]
fn faults_outlive_the_power_with_the_number_of_the_power_up_and_the_time_since_the_start() {
    let folder = tempfile::tempdir().unwrap();
    for power_up in 1..=6 {
        let mut master = start(folder.path());
        assert_eq!(master.number(0x2305, 1), power_up);
        let before = logged(&mut master);
        assert_eq!(before.len() as i64, 2 * ((power_up - 1) / 2));
        // Every other time nothing fails, and the joint runs for as long as it takes to be counted.
        if power_up % 2 == 1 {
            master.wait(10_100);
            continue;
        }
        let once = fails(&mut master);
        assert_eq!(once[1..], before);
        let twice = fails(&mut master);
        assert_eq!(twice[1..], once);
        for fault in &twice[..2] {
            assert_eq!((fault.code, fault.fault, i64::from(fault.power_up)), (0x8100, 14, power_up));
        }
        let [first, second] = [once[0].time, twice[0].time];
        assert!(first <= 1 && (second - first).abs_diff(3) <= 1, "{first} s, {second} s");
        assert_eq!(master.number(0x2305, 2), 0);
    }
}
