//! Writes docs/bus.md: load and latency of joints on one bus, and what happens when it is full.
//!
//! `cargo bench -p node --bench bus > docs/bus.md`; a few seconds. Simulated time on a modelled wire of 1 Mbit/s
//! ([`node::PacedNodes`]), so the figures do not depend on the machine.

use bus::Frame;
use bus::pacing::Station;
use node::{Options, PacedEvent, PacedNodes, REACTION, SlotImages, TASK, VirtualNode};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::time::Duration;

const MILLISECOND: Duration = Duration::from_millis(1);
/// Distance of two control steps.
const STEP: Duration = Duration::from_micros(50);
/// Measured cycles of the master.
const CYCLES: u32 = 1_000;

/// Joints on a bus, and a master that sends SYNC and then RPDO 1 to each of them in every cycle.
struct Round {
    nodes: PacedNodes,
    master: Station,
    joints: u8,
    /// xorshift32.
    noise: u32,
}

/// Results of one setting.
#[derive(Default)]
struct Measured {
    /// Share of the time for which the wire was taken.
    load: f64,
    /// Time from SYNC's last bit to a TPDO's, us, and the frames on the wire from then on, the TPDO included.
    answers: Vec<(f64, usize)>,
    /// Time from handing an RPDO to the master's controller to its last bit, us, and the frames on the wire in that
    /// time, the RPDO included.
    commands: Vec<(f64, usize)>,
    /// Time from the RPDO's last bit to the control step whose set-point is the new one, us.
    reactions: Vec<f64>,
    /// Time from the beginning of the master's cycle to that control step, us.
    torques: Vec<f64>,
    /// TPDOs that were due, and those that were overwritten.
    due: u64,
    overwritten: u64,
    /// RPDOs that the master left out because the one before was still waiting.
    left_out: u64,
}

impl Round {
    fn new(joints: u8) -> Self {
        let mut nodes = PacedNodes::new(1_000_000);
        let master = nodes.add_station();
        for number in 0..joints {
            let parameters = ActuatorParameters::reference().aligned().without_payload();
            let options = Options { node_id: number + 1, serial: 1, seed: number.into() };
            let images = SlotImages::empty().expect("an erased flash can be written");
            let node = VirtualNode::new(parameters, &Setup::of(&parameters), &options, images).expect("a joint");
            nodes.add(node, STEP * u32::from(number) / u32::from(joints));
        }
        let mut round = Self { nodes, master, joints, noise: 1 };
        round.nodes.wait(200 * MILLISECOND);
        round.send(0, &[1, 0]);
        for controlword in [6, 7, 15] {
            for joint in 0..joints {
                round.command(joint, controlword, 0);
            }
            round.nodes.wait(20 * MILLISECOND);
        }
        round
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        if let Some(frame) = Frame::new(id, data) {
            self.nodes.send(self.master, frame);
        }
    }

    /// RPDO 1: torque in thousandths.
    fn command(&mut self, joint: u8, controlword: u16, torque: i16) {
        let mut data = controlword.to_le_bytes().to_vec();
        data.extend(torque.to_le_bytes());
        data.extend([0; 4]);
        self.send(0x201 + u16::from(joint), &data);
    }

    /// A master's timer wakes up late by up to a control step.
    fn jitter(&mut self) -> Duration {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 17;
        self.noise ^= self.noise << 5;
        Duration::from_nanos(u64::from(self.noise % 50_000))
    }

    fn asked(&self, joint: usize) -> f32 {
        self.nodes.node(joint).map_or(0.0, |node| node.joint().joint().telemetry().wanted.torque)
    }

    /// `CYCLES` cycles of `period`.
    fn measure(&mut self, period: Duration) -> Measured {
        let overwritten = |nodes: &PacedNodes| -> u64 {
            (0..nodes.len()).filter_map(|joint| nodes.node(joint)).map(|node| u64::from(node.overwritten())).sum()
        };
        let before = overwritten(&self.nodes);
        let joints = usize::from(self.joints);
        let mut measured = Measured::default();
        let (mut frames, mut sync_ended, mut sync_frames) = (0usize, None, 0);
        // Of each joint: when its RPDO was handed over with how many frames before, when it was received, the torque
        // before it acted.
        let mut waiting: Vec<Option<(Duration, usize)>> = vec![None; joints];
        let mut received: Vec<Option<(Duration, Duration)>> = vec![None; joints];
        let mut torques: Vec<f32> = (0..joints).map(|joint| self.asked(joint)).collect();
        self.nodes.reset_statistics();
        let began = self.nodes.now();
        for cycle in 0..CYCLES {
            let start = began + cycle * period + self.jitter();
            let end = began + (cycle + 1) * period;
            let mut cycle_begun = false;
            loop {
                let until = if cycle_begun { end } else { start };
                match self.nodes.next(until) {
                    Some(PacedEvent::Delivered(delivery)) => {
                        frames += 1;
                        let id = delivery.frame.id();
                        match id {
                            0x080 => (sync_ended, sync_frames) = (Some(delivery.ended), frames),
                            0x181..=0x1FF | 0x281..=0x2FF => {
                                if let Some(sync) = sync_ended {
                                    let answer = micros(delivery.ended.saturating_sub(sync));
                                    measured.answers.push((answer, frames - sync_frames));
                                }
                            }
                            0x201..=0x27F => {
                                let joint = usize::from(id - 0x201);
                                if let Some((queued, ahead)) = waiting[joint].take() {
                                    measured.commands.push((micros(delivery.ended - queued), frames - ahead));
                                    received[joint] = Some((queued, delivery.ended));
                                }
                            }
                            _ => {}
                        }
                    }
                    Some(PacedEvent::Stepped(joint)) => {
                        let torque = self.asked(joint);
                        if torque != torques[joint]
                            && let Some((queued, ended)) = received[joint].take()
                        {
                            measured.reactions.push(micros(self.nodes.now() - ended));
                            measured.torques.push(micros(self.nodes.now() - queued));
                        }
                        torques[joint] = torque;
                    }
                    None if cycle_begun => break,
                    None => {
                        cycle_begun = true;
                        self.send(0x080, &[]);
                        for joint in 0..self.joints {
                            if waiting[usize::from(joint)].is_some() {
                                measured.left_out += 1;
                                continue;
                            }
                            waiting[usize::from(joint)] = Some((self.nodes.now(), frames));
                            // There and back: on the whole the joint stays where it is.
                            self.command(joint, 15, if cycle % 2 == 0 { 20 } else { -20 });
                        }
                    }
                }
            }
        }
        measured.load = self.nodes.wire().statistics().load(self.nodes.now());
        measured.due = u64::from(CYCLES) * 2 * u64::from(self.joints);
        measured.overwritten = overwritten(&self.nodes) - before;
        measured
    }
}

fn micros(time: Duration) -> f64 {
    1e6 * time.as_secs_f64()
}

/// Least, median, most.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    match values[..] {
        [] => "none".into(),
        [least, .., most] => format!("{least:.0} / {:.0} / {most:.0}", values[values.len() / 2]),
        [only] => format!("{only:.0}"),
    }
}

fn both(values: &[(f64, usize)]) -> (String, String) {
    let (times, frames): (Vec<f64>, Vec<f64>) = values.iter().map(|(time, frames)| (*time, *frames as f64)).unzip();
    (spread(times), spread(frames))
}

fn main() {
    let rounds: Vec<(u8, u32, Measured)> = [(1, [1, 2, 4]), (4, [1, 2, 4]), (8, [2, 4, 8])]
        .into_iter()
        .flat_map(|(joints, periods)| periods.map(|period| (joints, period)))
        .map(|(joints, period)| (joints, period, Round::new(joints).measure(period * MILLISECOND)))
        .collect();
    println!(
        "# On the bus\n\nLoad and latency are written by `cargo bench -p node --bench bus`: simulation, no hardware. Classic CAN at 1 Mbit/s with every \
         bit of every\nframe, stuff bits and arbitration ([`bus::pacing`](../tools/bus/src/pacing/mod.rs)); the joints are whole virtual joints \
         with the firmware's\nserver, objects and control step. Assumed, because no board has been measured: the receive interrupt has done its work \
         {} us after a\nframe's last bit, the task gets to a request {} us later, three transmit buffers.\n",
        REACTION.as_micros(),
        TASK.as_micros()
    );
    println!(
        "## Load and latency\n\nIn every cycle the master sends SYNC, which every joint answers with TPDO 1 and TPDO 2 as they are mapped at first, and \
         RPDO 1 to every\njoint; {CYCLES} cycles, least / median / most over all joints. A cycle begins up to a control step late, as timers do. In the \
         last\ncolumns: TPDOs overwritten by newer ones, RPDOs that the master left out because the one before still waited.\n"
    );
    println!(
        "| joints | cycle, ms | load, % | SYNC to TPDO, us | frames | RPDO to its last bit, us | frames | last bit to torque, us | RPDO to torque, us | TPDOs lost, % | RPDOs left out, % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (joints, period, measured) in &rounds {
        let (answers, answer_frames) = both(&measured.answers);
        let (commands, command_frames) = both(&measured.commands);
        println!(
            "| {joints} | {period} | {:.1} | {answers} | {answer_frames} | {commands} | {command_frames} | {} | {} | {:.1} | {:.1} |",
            100.0 * measured.load,
            spread(measured.reactions.clone()),
            spread(measured.torques.clone()),
            100.0 * measured.overwritten as f64 / measured.due as f64,
            200.0 * measured.left_out as f64 / measured.due as f64
        );
    }
    let bits = |id, data: &[u8]| Frame::new(id, data).map_or(0, |frame| bus::pacing::bits(&frame));
    println!(
        "\n\"RPDO to torque\" ends with the first control step whose set-point is the new one; what that step computes the bridge applies one \
         period (50 us)\nlater. RPDOs that wait when SYNC ends go before the TPDOs that answer it, {} us later: a master that wants the answers first \
         sends its\nRPDOs after them. A SYNC takes {} bits of the bus, a PDO of eight bytes {} to 135 by its content: at 1 kHz a joint with both TPDOs and \
         one RPDO costs\n{:.0} % of the bus, SYNC {:.0} %.",
        REACTION.as_micros(),
        bits(0x080, &[]),
        bits(0x2AA, &[0x55; 8]),
        100.0 * rounds[0].2.load - f64::from(bits(0x080, &[])) / 10.0,
        f64::from(bits(0x080, &[])) / 10.0
    );
    print!("{}", include_str!("bus.md"));
}
