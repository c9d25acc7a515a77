//! The virtual joint driven over the bus alone, in simulated time: SDO, PDO, NMT, and images from upload to flash and
//! back.

mod master;

use bus::client::sdo::{Failure, Method, Settings, Transfer};
use bus::client::{Abort, Command, NmtState, Object};
use friction_compensation::parameters::authentication::Key;
use joint_firmware::joint::state_machine::State;
use master::{ID, Master};
use node::{SampleImage, SlotImages, Storage};

#[test]
fn a_node_boots_says_who_it_is_and_takes_no_set_point_before_it_is_started() {
    let mut master = Master::new();
    assert_eq!(master.heard.first().map(|frame| (frame.id(), frame.data().to_vec())), Some((0x705, vec![0])));
    assert_eq!(master.node.state(), NmtState::PreOperational);
    assert_eq!((master.number(0x1000, 0), master.number(0x1018, 4)), (0x0002_0192, 12));
    assert!(String::from_utf8(master.upload(0x1008, 0)).unwrap().starts_with("virtual joint"));
    for controlword in [6, 7, 15] {
        master.drive(controlword, 500, 50);
    }
    assert_eq!(master.state(), State::SwitchOnDisabled);
}

#[test]
fn a_velocity_by_rpdo_is_followed_and_told_by_tpdo_and_silence_ends_in_a_fault() {
    let mut master = Master::new();
    master.enabled();
    master.drive(15, 500, 600);
    master.heard.clear();
    master.send(0x080, &[]);
    let told = |id: u16| master.heard.iter().find(|frame| frame.id() == id).unwrap().eight().copied().unwrap();
    let (first, second) = (told(0x185), told(0x285));
    assert_eq!(u16::from_le_bytes([first[0], first[1]]) & 0x6F, 0x27, "operation enabled");
    let velocity = i32::from_le_bytes([second[0], second[1], second[2], second[3]]);
    assert!((480..=520).contains(&velocity), "{velocity} mrad/s");

    // The command deadline is 0.1 s, then the joint brakes.
    master.wait(1_000);
    assert_eq!(master.state(), State::Fault);
    assert!(master.emergencies().contains(&0x8100), "{:04x?}", master.emergencies());
    assert!(master.node.joint().actuator().state().joint.velocity.abs() < 0.05);
    assert_eq!(master.number(0x603F, 0), 0x8100);
    // Without a reset the fault stays, with one and fresh set-points the joint runs again.
    master.drive(15, 500, 50);
    assert_eq!(master.state(), State::Fault);
    for controlword in [0x80, 6, 7, 15] {
        master.drive(controlword, 0, 20);
    }
    assert_eq!(master.state(), State::OperationEnabled);
}

#[test]
fn a_velocity_whose_pdo_has_died_is_late_whatever_else_still_comes() {
    let mut master = Master::new();
    // RPDO 4 is the controlword alone.
    for (index, sub_index, value) in
        [(0x1603, 0, &[0][..]), (0x1603, 1, &0x6040_0010u32.to_le_bytes()), (0x1603, 0, &[1])]
    {
        master.download(index, sub_index, value).unwrap();
    }
    master.download(0x1403, 1, &(0x500 + u32::from(ID)).to_le_bytes()).unwrap();
    master.enabled();
    master.drive(15, 500, 600);
    let others = |master: &mut Master, controlword: u8, milliseconds: u32| {
        for _ in 0..milliseconds / 5 {
            master.send(0x500 + u16::from(ID), &[controlword, 0]);
            // RPDO 1, whose torque and position are no set-points of this mode.
            master.send(0x200 + u16::from(ID), &[controlword, 0, 0, 0, 0, 0, 0, 0]);
            master.wait(5);
        }
    };
    others(&mut master, 15, 85);
    assert_eq!(master.state(), State::OperationEnabled);
    others(&mut master, 15, 1_000);
    assert_eq!((master.state(), master.number(0x603F, 0)), (State::Fault, 0x8100));
    assert!(master.node.joint().actuator().state().joint.velocity.abs() < 0.02);
    // The controlword alone, too, has the joint out of its fault.
    others(&mut master, 0x80, 20);
    assert_eq!(master.state(), State::SwitchOnDisabled);
    for controlword in [6, 7, 15] {
        others(&mut master, controlword, 300);
    }
    // And into operation, where it holds until the velocity comes again.
    assert_eq!(master.state(), State::OperationEnabled);
    master.drive(15, 500, 600);
    assert!((master.node.joint().actuator().state().joint.velocity - 0.5).abs() < 0.05);
}

#[test]
fn nmt_stop_in_motion_brakes_the_joint_and_set_points_no_longer_count() {
    let mut master = Master::new();
    master.enabled();
    master.drive(15, 500, 600);
    master.command(Command::Stop);
    assert_eq!(master.node.state(), NmtState::Stopped);
    master.drive(15, 500, 600);
    assert!(master.node.joint().actuator().state().joint.velocity.abs() < 0.05);
    assert_ne!(master.state(), State::OperationEnabled);
}

#[test]
fn an_image_goes_from_upload_by_way_of_a_trial_to_flash_and_back() {
    let mut master = Master::new();
    let (first, second) = (SampleImage::constant(1, 0.25), SampleImage::constant(2, 0.5));
    master.download(0x2210, 0, &first).unwrap();
    master.image(1).unwrap();
    assert_eq!((master.number(0x2212, 2), master.number(0x2212, 3)), (2, 0));
    master.image(3).unwrap();
    assert_eq!((master.number(0x2212, 2), master.number(0x2213, 1)), (7, 1));
    assert_eq!(master.upload(0x2211, 0), first);

    // In motion the second one is tried; it acts, and reverts by itself.
    master.download(0x2200, 3, &1f32.to_le_bytes()).unwrap();
    master.download(0x2200, 1, &[1]).unwrap();
    master.enabled();
    master.drive(15, 300, 500);
    let acts = |master: &Master| master.node.joint().joint().telemetry().compensated.torque;
    assert!((acts(&master) - 0.25).abs() < 1e-3, "{}", acts(&master));
    master.download(0x2210, 0, &second).unwrap();
    master.image(1).unwrap();
    master.download(0x2212, 7, &200u32.to_le_bytes()).unwrap();
    master.image(2).unwrap();
    master.drive(15, 300, 100);
    assert!((acts(&master) - 0.5).abs() < 1e-3, "{}", acts(&master));
    master.drive(15, 300, 300);
    assert_eq!((master.number(0x2212, 2), master.number(0x2212, 8)), (2, 1));
    assert!((acts(&master) - 0.25).abs() < 1e-3, "{}", acts(&master));

    // One bank of flash: not under current.
    assert_eq!(master.image(3), Err(Failure::Aborted(Abort::DEVICE_STATE)));
    assert_eq!(master.state(), State::OperationEnabled);
    master.drive(0, 0, 50);
    master.image(3).unwrap();
    assert_eq!((master.number(0x2213, 1), master.number(0x2214, 1)), (2, 1));

    // Images that a loss of power leaves.
    let images = SlotImages::open(master.node.flash()).unwrap();
    let mut master = Master::with(images);
    assert_eq!((master.number(0x2213, 1), master.number(0x2214, 1)), (2, 1));
    assert_eq!(master.upload(0x2211, 0), second);
    master.image(4).unwrap();
    assert_eq!((master.number(0x2213, 1), master.upload(0x2211, 0)), (1, first));
}

#[test]
fn a_shadow_is_computed_and_has_no_effect() {
    let mut master = Master::new();
    master.download(0x2210, 0, &SampleImage::constant(1, 0.5)).unwrap();
    master.image(1).unwrap();
    master.download(0x2212, 7, &60_000u32.to_le_bytes()).unwrap();
    master.image(6).unwrap();
    master.enabled();
    master.drive(15, 300, 3_000);
    assert_eq!(master.node.joint().joint().telemetry().compensated.torque, 0.0);
    let rms = f32::from_bits(master.number(0x2200, 7) as u32);
    assert!((0.4..=0.5).contains(&rms), "{rms} Nm");
    // From a trial back to the shadow: what is stored acts again, here nothing.
    let acts = |master: &mut Master| {
        master.drive(15, 300, 1_000);
        master.node.joint().joint().telemetry().compensated.torque
    };
    master.download(0x2200, 1, &[2]).unwrap();
    master.download(0x2200, 3, &1f32.to_le_bytes()).unwrap();
    master.image(2).unwrap();
    assert!((0.4..=0.5).contains(&acts(&mut master)));
    master.image(6).unwrap();
    assert_eq!(acts(&mut master), 0.0);
    master.image(5).unwrap();
    assert_eq!(master.number(0x2212, 2), 0);
}

#[test]
fn a_damaged_an_old_and_an_unsigned_image_are_refused_and_nothing_changes() {
    let mut master = Master::new();
    let good = SampleImage::constant(3, 0.25);
    master.download(0x2210, 0, &good).unwrap();
    master.image(1).unwrap();
    master.image(3).unwrap();
    let mut damaged = SampleImage::constant(4, 0.5);
    damaged[60] ^= 4;
    let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
    let refused = |master: &mut Master, upload: &[u8]| {
        master.download(0x2210, 0, upload).unwrap();
        assert!(master.image(1).is_err());
        assert!(master.image(3).is_err(), "what is not verified is not stored");
        assert_eq!((master.number(0x2213, 1), master.upload(0x2211, 0)), (3, good.clone()));
        master.download(0x2210, 0, upload).unwrap();
        assert!(master.image(1).is_err());
        master.number(0x2212, 3)
    };
    let signed = |image: Vec<u8>| [&image[..], &key.sign(&image)].concat();
    let stores = |master: &mut Master, upload: &[u8]| {
        master.download(0x2210, 0, upload).unwrap();
        master.image(1).unwrap();
        master.image(3).unwrap();
        master.number(0x2213, 1)
    };
    let damaged = refused(&mut master, &damaged);
    master.download(0x2215, 6, &key.to_bytes()).unwrap();
    let unsigned = refused(&mut master, &SampleImage::constant(4, 0.5));
    // With its tag the image in use is what no older one may replace.
    let left = master.number(0x2304, 2);
    assert_eq!((stores(&mut master, &signed(good.clone())), master.number(0x2215, 3)), (3, 3));
    assert_eq!((master.number(0x2304, 2), master.number(0x2214, 1)), (left, 0), "it was not written again");
    let old = refused(&mut master, &signed(SampleImage::constant(2, 0.5)));
    assert!(damaged != 0 && old != 0 && unsigned != 0 && damaged != old && old != unsigned);
    assert_eq!(stores(&mut master, &signed(SampleImage::constant(4, 0.5))), 4);
    // A key is written once.
    assert!(master.download(0x2215, 6, &[7; 32]).is_err());
}

#[test]
fn an_sdo_of_every_length_goes_both_ways_segmented_and_by_block() {
    let mut master = Master::new();
    let pattern: Vec<u8> = (0..4_096u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let staging = Object { node: ID, index: 0x2210, sub_index: 0 };
    for length in 1..=2_048 {
        let data = &pattern[length..2 * length];
        for method in [Method::Automatic, Method::Segmented, Method::Block] {
            master.transfer(Transfer::download(staging, data, method, Settings::default())).unwrap();
            let back = master.transfer(Transfer::upload(staging, method, Settings::default())).unwrap();
            assert!(back == data, "{length} bytes, {method:?}");
        }
    }
    let whole = Transfer::download(staging, &pattern[..2_049], Method::Block, Settings::default());
    assert_eq!(master.transfer(whole), Err(Failure::Aborted(Abort::TOO_LONG)));
}

const DEADLINE: f32 = 0.25;

/// Sets and takes a command deadline, and stores it with a heartbeat of 70 ms.
fn stored(master: &mut Master) {
    master.download(0x2103, 11, &DEADLINE.to_le_bytes()).unwrap();
    master.download(0x2100, 1, &[1]).unwrap();
    master.download(0x1017, 0, &70u16.to_le_bytes()).unwrap();
    master.download(0x1010, 1, b"save").unwrap();
}

fn settings(master: &mut Master) -> (f32, i64) {
    (f32::from_bits(master.number(0x2103, 11) as u32), master.number(0x1017, 0))
}

#[test]
fn images_configuration_counts_and_key_survive_a_loss_of_power_in_files() {
    let folder = tempfile::tempdir().unwrap();
    let power_on = || Master::powered(Storage::open(folder.path()).unwrap());
    let mut master = power_on();
    assert_eq!(settings(&mut master), (0.1, 0));
    stored(&mut master);
    let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
    master.download(0x2215, 6, &key.to_bytes()).unwrap();
    let mut signed = SampleImage::constant(7, 0.25);
    signed.extend(key.sign(&signed));
    master.download(0x2210, 0, &signed).unwrap();
    master.image(1).unwrap();
    master.image(3).unwrap();
    // A forged one, to have something counted.
    let mut forged = SampleImage::constant(8, 0.25);
    forged.extend([0; 32]);
    master.download(0x2210, 0, &forged).unwrap();
    assert!(master.image(1).is_err());

    let mut master = power_on();
    assert_eq!(settings(&mut master), (DEADLINE, 70));
    assert_eq!((master.number(0x2213, 1), master.number(0x2215, 3), master.number(0x2215, 4)), (7, 7, 1));
    assert_eq!((master.number(0x2215, 1), master.number(0x2215, 2)), (1, key.id().into()));
    // The configuration acts: 0.2 s of silence are no fault now.
    master.enabled();
    master.drive(15, 0, 10);
    master.wait(200);
    assert_eq!(master.state(), State::OperationEnabled);
    master.wait(100);
    assert_ne!(master.state(), State::OperationEnabled);
}

#[test]
fn what_is_not_stored_and_what_is_restored_ends_with_a_reset_of_the_node() {
    let mut master = Master::new();
    stored(&mut master);
    master.download(0x2103, 11, &0.5f32.to_le_bytes()).unwrap();
    master.download(0x2100, 1, &[1]).unwrap();
    master.download(0x2210, 0, &SampleImage::constant(1, 0.25)).unwrap();
    master.image(1).unwrap();
    master.command(Command::ResetNode);
    master.wait(5);
    assert_eq!(settings(&mut master), (DEADLINE, 70));
    assert_eq!(master.number(0x2212, 2), 0, "nothing is staged");
    // Restored defaults come with the next reset, not before.
    master.download(0x1011, 1, b"load").unwrap();
    assert_eq!(settings(&mut master), (DEADLINE, 70));
    master.command(Command::ResetNode);
    master.wait(5);
    assert_eq!(settings(&mut master), (0.1, 0));
}

#[test]
fn a_reset_of_the_node_in_motion_waits_until_the_joint_has_braked() {
    let mut master = Master::new();
    stored(&mut master);
    master.download(0x2103, 11, &0.5f32.to_le_bytes()).unwrap();
    master.download(0x2100, 1, &[1]).unwrap();
    master.enabled();
    master.drive(15, 500, 600);
    master.command(Command::ResetNode);
    master.wait(2);
    assert_eq!(master.state(), State::QuickStopActive);
    assert_eq!(settings(&mut master).0, 0.5);
    master.wait(1_000);
    assert_eq!((master.state(), settings(&mut master).0), (State::SwitchOnDisabled, DEADLINE));
}
