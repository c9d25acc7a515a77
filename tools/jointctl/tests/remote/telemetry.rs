//! Samples of a joint, while it moves and after.

use crate::served::{NODE, Served};
use bus::client::{NmtState, SyncProducer};
use canopen_node::PdoParameters;
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::default_communication;
use joint_firmware::objects::field::Actual;
use jointctl::remote::pdo::{Direction, Pdo, objects};
use jointctl::remote::telemetry::USUAL;
use jointctl::remote::{Stream, Telemetry};
use std::time::{Duration, Instant};

const SECOND: Duration = Duration::from_secs(1);

pub fn samples_come_with_every_sync_in_si_units_and_the_pdos_are_put_back() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let before = Pdo::all(Direction::Transmit).map(|pdo| pdo.read(&joint).unwrap());
    let mut telemetry = Telemetry::begin(&joint, &USUAL).unwrap();
    let units = telemetry.signals().iter().map(|signal| signal.unit).collect::<Vec<_>>();
    assert_eq!(units, ["rad", "rad/s", "", "Nm", "Nm", "Nm", "Nm", "°C"]);

    let stream = Stream::begin(&joint, Mode::Velocity, 100.0, false).unwrap();
    stream.set(Command { mode: Mode::Velocity, velocity: 0.5, ..Command::default() });
    let sync = SyncProducer::new(joint.network(), Duration::from_millis(5));
    let began = Instant::now();
    let mut samples = Vec::new();
    while began.elapsed() < 2 * SECOND {
        samples.extend(telemetry.next(SECOND).unwrap());
    }
    stream.check().unwrap();
    let sent = sync.stop().unwrap().sent;
    stream.end().unwrap();

    assert!(samples.len() > 100 && samples.len() as u64 + telemetry.lost() <= sent, "{sent} SYNCs, {}", samples.len());
    let place = |actual| telemetry.place(actual).unwrap();
    let (position, velocity) = (place(Actual::Position), place(Actual::Velocity));
    let late = samples.iter().rev().take(20).map(|sample| sample.values[velocity]).sum::<f64>() / 20.0;
    assert!((0.45..0.55).contains(&late), "{late} rad/s");
    let [first, last] = [&samples[samples.len() / 2], &samples[samples.len() - 1]];
    let way = last.values[position] - first.values[position];
    assert!(way > 0.1 && samples.is_sorted_by_key(|sample| sample.at), "{way} rad");
    let heat = last.values[place(Actual::GearTemperature)];
    assert!((10.0..60.0).contains(&heat), "{heat} °C");

    telemetry.end().unwrap();
    let same = |a: &PdoParameters, b: &PdoParameters| {
        (a.cob_id, a.transmission, a.inhibit, a.event_timer) == (b.cob_id, b.transmission, b.inhibit, b.event_timer)
            && objects(a).eq(objects(b))
    };
    for (pdo, before) in Pdo::all(Direction::Transmit).into_iter().zip(&before) {
        assert!(same(&pdo.read(&joint).unwrap(), before), "{pdo:?}");
    }
}

pub fn samples_that_a_joint_did_not_send_are_told_of() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let network = joint.network();
    let mut telemetry = Telemetry::begin(&joint, &USUAL).unwrap();
    let mut sent = 0;
    // SYNCs until there are as many samples: one that comes while the joint is late counts as well.
    let mut samples = |telemetry: &mut Telemetry, wanted: u64| {
        let mut came = 0;
        while came < wanted {
            network.sync().unwrap();
            sent += 1;
            came += u64::from(telemetry.next(SECOND / 10).unwrap().is_some());
        }
        sent
    };
    let all = 256;
    let unanswered = samples(&mut telemetry, all) - all;
    assert!(telemetry.lost() <= unanswered, "{} of {unanswered}", telemetry.lost());
    joint.nmt(bus::client::Command::EnterPreOperational, NmtState::PreOperational).unwrap();
    (0..40).for_each(|_| network.sync().unwrap());
    joint.nmt(bus::client::Command::Start, NmtState::Operational).unwrap();
    let unanswered = samples(&mut telemetry, all) - 2 * all;
    assert!((40..=40 + unanswered).contains(&telemetry.lost()), "{} of 40 and {unanswered}", telemetry.lost());
    telemetry.end().unwrap();
}

pub fn the_pdos_of_a_new_joint_are_read_as_the_firmware_declares_them() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let defaults = default_communication(NODE);
    for (direction, declared) in [(Direction::Receive, defaults.receive), (Direction::Transmit, defaults.transmit)] {
        for (pdo, declared) in Pdo::all(direction).into_iter().zip(declared) {
            let read = pdo.read(&joint).unwrap();
            assert_eq!(
                (read.cob_id, read.transmission, read.event_timer),
                (declared.cob_id, declared.transmission, declared.event_timer)
            );
            assert!(objects(&read).eq(objects(&declared)), "{pdo:?}");
        }
    }
}
