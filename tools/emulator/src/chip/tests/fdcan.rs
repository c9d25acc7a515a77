//! FDCAN: RM0440, chapter 44.

use super::super::fdcan::line::CanFrame;
use super::super::variant;
use super::*;

const CAN: u32 = 0x4000_6400;
const RAM: u32 = 0x4000_a400;
const CCCR: u32 = CAN + 0x18;
const PSR: u32 = CAN + 0x44;
const IR: u32 = CAN + 0x50;
const RXGFC: u32 = CAN + 0x80;
const TXBAR: u32 = CAN + 0xcc;

fn frame(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::standard(id, data).unwrap()
}

/// Controller as the firmware has it: 1 Mbit/s from 170 MHz, frames that match no filter into FIFO 0, a transmit FIFO,
/// interrupts on line 0.
fn bench() -> Bench {
    let mut bench = stopped();
    configure(&mut bench);
    bench.set(RXGFC, 2 << 2 | 3 | 28 << 16 | 8 << 24);
    bench.set(CAN + 0x54, 1 | 1 << 2 | 1 << 7 | 1 << 19);
    bench.set(CAN + 0x5c, 3);
    bench.set(CAN + 0xdc, 7);
    // 10 times 17 quanta: 1 + 14 + 2.
    bench.set(CAN + 0x1c, 9 << 16 | 13 << 8 | 1);
    bench.set(CAN + 0x20, 1);
    bench.set(CCCR, 0);
    bench.pass_us(12);
    bench
}

/// CCE can be set once INIT is (44.3.2).
fn configure(bench: &mut Bench) {
    bench.set(CCCR, 1);
    bench.set(CCCR, 3);
}

/// Controller with its clock, empty message RAM, not started.
fn stopped() -> Bench {
    let mut bench = Bench::new(&variant::STM32G474CE);
    bench.speed_up();
    bench.set(RCC + 0x0c, 1 << 24 | 1 << 20 | 85 << 8 | 3 << 4 | 2);
    bench.set(RCC + 0x88, 1 << 24);
    bench.set(RCC + 0x58, 1 << 28 | 1 << 25);
    for word in 0..212 {
        bench.set(RAM + 4 * word, 0);
    }
    bench
}

fn send(bench: &mut Bench, frame: CanFrame) {
    let now = bench.chip.instant(bench.now);
    bench.board().can.send(now, frame);
    bench.chip.wiring_changed();
}

/// Puts a frame into a transmit buffer and requests it.
fn request(bench: &mut Bench, buffer: u32, frame: CanFrame) {
    let place = RAM + 0x278 + 72 * buffer;
    let data = u64::from_le_bytes(frame.data);
    let words = [frame.id << 18, u32::from(frame.length) << 16, data as u32, (data >> 32) as u32];
    for (word, offset) in words.into_iter().zip(0..) {
        bench.set(place + 4 * offset, word);
    }
    bench.set(TXBAR, 1 << buffer);
}

fn sent(bench: &mut Bench) -> Vec<CanFrame> {
    std::iter::from_fn(|| bench.board().can.receive()).map(|(_, frame)| frame).collect()
}

#[test]
fn after_reset_it_is_initialised_and_says_what_it_is() {
    let mut bench = stopped();
    assert_eq!(bench.get(CAN), 0x3214_1218);
    assert_eq!(bench.get(CAN + 0x04), 0x8765_4321);
    assert_eq!(bench.get(CCCR), 1);
    assert_eq!(bench.get(PSR), 0x707);
    send(&mut bench, frame(1, &[]));
    bench.pass_us(1_000);
    assert_eq!(bench.get(CAN + 0x90), 0, "and receives nothing");
}

#[test]
fn the_configuration_is_protected() {
    let mut bench = stopped();
    bench.set(CAN + 0x1c, 0x1234);
    assert_eq!(bench.get(CAN + 0x1c), 0x0600_0a03, "INIT alone is not enough (44.3.2)");
    configure(&mut bench);
    bench.set(CAN + 0x1c, 0x1234);
    assert_eq!(bench.get(CAN + 0x1c), 0x1234);
    bench.set(CCCR, 0);
    assert_eq!(bench.get(CCCR), 0, "CCE goes with INIT");
    bench.set(RXGFC, 0x3f);
    assert_eq!(bench.get(RXGFC), 0);
}

#[test]
fn a_frame_arrives_when_its_bits_have_passed() {
    let mut bench = bench();
    let expected = frame(0x123, &[1, 2, 3, 4, 5, 6, 7]);
    send(&mut bench, expected);
    bench.pass_us(expected.bits() - 1);
    assert!(!bench.line(21));
    bench.pass_us(2);
    assert!(bench.line(21), "FDCAN1_IT0");
    assert_eq!(bench.get(CAN + 0x90), 1 | 1 << 16, "one, at 0, the next at 1");
    let words: Vec<_> = (0..4).map(|word| bench.get(RAM + 0xb0 + 4 * word)).collect();
    assert_eq!(words[0], 0x123 << 18);
    assert_eq!(words[1] & 0xff0f_0000, 1 << 31 | 7 << 16, "matched no filter, seven bytes");
    assert_eq!(words[2..], [0x0403_0201, 0x0007_0605]);
    bench.set(IR, 1);
    assert!(!bench.line(21));
    bench.set(CAN + 0x94, 0);
    assert_eq!(bench.get(CAN + 0x90), 1 << 8 | 1 << 16);
}

#[test]
fn filters_reject_by_mask_and_range_and_choose_the_fifo() {
    let mut bench = bench();
    // Filters as the firmware has them: classic masks that reject; then a range into FIFO 1, two identifiers into FIFO
    // 1.
    bench.set(RAM, 2 << 30 | 3 << 27 | 0x580 << 16 | 0x780);
    bench.set(RAM + 4, 2 << 27 | 0x100 << 16 | 0x10f);
    bench.set(RAM + 8, 1 << 30 | 2 << 27 | 0x200 << 16 | 0x300);
    for id in [0x580, 0x5ff, 0x101, 0x300] {
        send(&mut bench, frame(id, &[]));
    }
    send(&mut bench, frame(0x600, &[]));
    bench.pass_us(1_000);
    assert_eq!(bench.get(CAN + 0x90) & 7, 1, "600h");
    assert_eq!(bench.get(CAN + 0x98) & 7, 2);
    assert_eq!(bench.get(RAM + 0x188), 0x101 << 18, "FIFO 1");
    assert_eq!(bench.get(RAM + 0x188 + 4) >> 24, 1, "by filter 1");
    assert_eq!(bench.get(RAM + 0x188 + 72), 0x300 << 18);
}

#[test]
fn extended_and_remote_frames_are_rejected_where_that_is_asked_for() {
    let mut bench = bench();
    send(&mut bench, CanFrame { extended: true, id: 5, ..frame(0, &[]) });
    send(&mut bench, CanFrame { remote: true, ..frame(5, &[]) });
    bench.pass_us(1_000);
    assert_eq!(bench.get(CAN + 0x90) & 7, 0);
}

#[test]
fn a_full_fifo_loses_what_comes_and_says_so() {
    let mut bench = bench();
    for id in 1..=4 {
        send(&mut bench, frame(id, &[]));
    }
    bench.pass_us(1_000);
    assert_eq!(bench.get(CAN + 0x90) & 0x0300_0007, 3 | 3 << 24, "three, full, lost");
    assert_eq!(bench.get(IR) & 7, 7);
    let ids: Vec<_> = (0..3).map(|element| bench.get(RAM + 0xb0 + 72 * element) >> 18).collect();
    assert_eq!(ids, [1, 2, 3]);
}

#[test]
fn a_fifo_sends_in_the_order_of_requests_and_a_queue_by_identifier() {
    for (queue, expected) in [(false, [0x300, 0x100, 0x200]), (true, [0x300, 0x100, 0x200])] {
        let mut bench = bench();
        if queue {
            configure(&mut bench);
            bench.set(CAN + 0xc0, 1 << 24);
            bench.set(CCCR, 0);
            bench.pass_us(12);
        }
        // The first is on its way when the others come.
        for (buffer, id) in [(0, 0x300), (1, if queue { 0x200 } else { 0x100 }), (2, if queue { 0x100 } else { 0x200 })]
        {
            request(&mut bench, buffer, frame(id, &[9; 8]));
            bench.pass_us(5);
        }
        assert_eq!(bench.get(CAN + 0xc8), 7, "TXBRP");
        assert_ne!(bench.get(CAN + 0xc4) & 1 << 21, 0, "full");
        bench.pass_us(1_000);
        let sent = sent(&mut bench);
        assert_eq!(sent.iter().map(|frame| frame.id).collect::<Vec<_>>(), expected, "queue: {queue}");
        assert!(sent.iter().all(|frame| frame.data == [9; 8]));
        assert_eq!(bench.get(CAN + 0xc8), 0);
        assert_eq!(bench.get(CAN + 0xd4), 7, "TXBTO");
        assert!(bench.line(21), "TC");
    }
}

#[test]
fn a_fifos_indices_go_round() {
    let mut bench = bench();
    for number in 0..7 {
        let status = bench.get(CAN + 0xc4);
        assert_eq!(status & 7, 3, "all free");
        assert_eq!(status >> 16 & 3, number % 3, "the put index");
        request(&mut bench, number % 3, frame(number, &[]));
        assert_eq!(bench.get(CAN + 0xc4) & 7, 2);
        bench.pass_us(200);
    }
    assert_eq!(sent(&mut bench).len(), 7);
    assert!(bench.refused(TXBAR, 1 << 2).contains("out of turn"));
}

#[test]
fn the_lower_identifier_wins_and_the_loser_follows() {
    let mut bench = bench();
    send(&mut bench, frame(0x50, &[0; 8]));
    bench.pass_us(5);
    request(&mut bench, 0, frame(0x200, &[]));
    send(&mut bench, frame(0x100, &[]));
    bench.pass_us(200);
    assert!(sent(&mut bench).is_empty(), "100h goes first");
    bench.pass_us(100);
    assert_eq!(sent(&mut bench), [frame(0x200, &[])]);
    assert_eq!(bench.get(CAN + 0x90) & 7, 2);
}

#[test]
fn alone_on_the_bus_it_becomes_passive_but_not_bus_off() {
    let mut bench = bench();
    bench.board().can.set_acknowledged(false);
    request(&mut bench, 0, frame(0x10, &[1]));
    bench.pass_us(10_000);
    assert_eq!(bench.get(CAN + 0x40) & 0xff, 128, "TEC");
    let status = bench.get(PSR);
    assert_eq!(status & 0xe7, 1 << 5 | 1 << 6 | 3, "passive, warned, acknowledge error");
    assert_eq!(bench.get(PSR) & 7, 7, "reading sets no change (44.4.13)");
    bench.board().can.set_acknowledged(true);
    bench.pass_us(1_000);
    assert_eq!(sent(&mut bench).len(), 1, "it has kept trying");
    assert_eq!(bench.get(CAN + 0x40) & 0xff, 127);
    assert_eq!(bench.get(PSR) & 1 << 5, 0, "active again");
}

#[test]
fn thirty_two_destroyed_frames_are_bus_off_and_129_times_11_bits_bring_it_back() {
    let mut bench = bench();
    let until = bench.chip.instant(bench.now).after_ns(10_000_000);
    bench.board().can.disturb(until);
    request(&mut bench, 0, frame(0x10, &[1]));
    bench.pass_us(11_000);
    assert_eq!(bench.get(PSR) & 1 << 7, 1 << 7);
    assert_eq!(bench.get(CCCR) & 1, 1, "INIT by hardware (44.3.2)");
    assert!(bench.line(21), "BO");
    bench.set(IR, u32::MAX);
    bench.pass_us(10_000);
    assert_eq!(bench.get(PSR) & 1 << 7, 1 << 7, "not by itself");
    bench.set(CCCR, 0);
    bench.pass_us(129 * 11 - 2);
    assert_eq!(bench.get(PSR) & 1 << 7, 1 << 7);
    bench.pass_us(5);
    assert_eq!(bench.get(PSR) & 0xe0, 0);
    assert_eq!(bench.get(CAN + 0x40), 0, "counters are cleared");
    assert!(bench.line(21), "BO: the state changed");
    bench.pass_us(1_000);
    assert_eq!(sent(&mut bench), [frame(0x10, &[1])], "the request is still there");
}

#[test]
fn another_bit_rate_than_the_bus_destroys_frames() {
    let mut bench = bench();
    configure(&mut bench);
    bench.set(CAN + 0x1c, 19 << 16 | 13 << 8 | 1);
    bench.set(CCCR, 0);
    bench.pass_us(30);
    send(&mut bench, frame(1, &[]));
    bench.pass_us(10_000);
    assert_eq!(bench.get(CAN + 0x90), 0);
    assert!(bench.get(CAN + 0x40) >> 8 & 0x7f > 0, "REC");
}

#[test]
fn a_request_is_cancelled_and_says_so() {
    let mut bench = bench();
    send(&mut bench, frame(0, &[0; 8]));
    bench.pass_us(5);
    request(&mut bench, 0, frame(0x10, &[]));
    bench.set(CAN + 0xd0, 1);
    assert_eq!(bench.get(CAN + 0xd8), 1, "TXBCF");
    bench.pass_us(1_000);
    assert!(sent(&mut bench).is_empty());
}

#[test]
fn what_is_not_modelled_is_refused() {
    let mut bench = bench();
    assert!(bench.refused(CCCR, 1 << 8 | 3).starts_with("FDCAN1_CCCR: bits 0x100"), "CAN FD");
    assert!(bench.refused(CCCR, 1 << 5 | 3).starts_with("FDCAN1_CCCR: bits 0x20"), "monitoring");
    configure(&mut bench);
    bench.set(RAM, 5 << 27);
    assert!(bench.refused(CCCR, 0).contains("a filter that marks priorities"));
    assert!(bench.refused(CAN + 0x100, 1).starts_with("FDCAN1_CKDIV"));
    assert!(bench.unread(RAM + 4 * 212).contains("message RAM of FDCAN2"));
    // Without a clock for its bits.
    bench.set(RCC + 0x88, 0);
    assert!(bench.refused(CCCR, 3).contains("FDCANSEL"));
}
