//! 2300h to 2305h: what is left of a fault, and of what stopped the program; what the board tells of its hardware.

use super::super::field::{HardwareField as H, LogField, ResetField, StorageField};
use super::*;

room! {
    0x2300 "fault history" {
        0, "fault history", Domain, RO, UNMAPPED, Field::History; "", 1.0, ANY;
            "The control steps before the last fault, oldest first, 36 bytes each: state, 3 reserved, faults (u32), position, velocity, torque, compensation, current d, current q, bus voltage (f32, SI); empty while no fault is latched"
    }
    0x2301 "last reset" {
        1, "reset causes", U8, RO, UNMAPPED, Field::Reset(ResetField::Causes); "", 1.0, ANY;
            "Bits: 0 option bytes, 1 reset pin (also with every other), 2 power, 3 software, 4 watchdog, 5 window watchdog, 6 low-power mode. After a watchdog EMCY 6010h says so, with what this object's 1 and 2 say as its information"
        2, "stop", U8, RO, UNMAPPED, Field::Reset(ResetField::Stop); "", 1.0, ANY;
            "What stopped the program before: 0 nothing, 1 panic, 2 hard fault, 3 non-maskable interrupt, 4 interrupt without a handler. EMCY 6100h says so"
        3, "stop address", U32, RO, UNMAPPED, Field::Reset(ResetField::Address); "", 1.0, ANY;
            "Address of the instruction that it stopped at, 0 where that is not known"
        4, "stop detail", U32, RO, UNMAPPED, Field::Reset(ResetField::Detail); "", 1.0, ANY;
            "Line of a panic, CFSR of a hard fault, flash ECC register of a non-maskable interrupt, number of an interrupt"
        5, "stops in a row", U32, RO, UNMAPPED, Field::Reset(ResetField::Repeats); "", 1.0, ANY;
            "The last included; 0 where nothing stopped the program, or once it has run for 10 s since"
        6, "stop place", Text, RO, UNMAPPED, Field::Reset(ResetField::Place); "", 1.0, ANY;
            "End of the name of a panic's source file"
    }
    0x2302 "gate driver" {
        1, "gate driver status 1", U16, RO, UNMAPPED, Field::Hardware(H::DriverStatus1); "", 1.0, ANY;
            "Of the fault that has not been cleared, 0 without one. Of a DRV8353, bits: 0 to 5 over-current of the transistors low C, high C, low B, high B, low A, high A, 6 thermal shutdown, \
             7 under-voltage lock-out, 8 gate drive, 9 over-current, 10 any fault; 7FFh in both words: it does not answer"
        2, "gate driver status 2", U16, RO, UNMAPPED, Field::Hardware(H::DriverStatus2); "", 1.0, ANY;
            "Bits: 0 to 5 gates of low C, high C, low B, high B, low A, high A, 6 under-voltage of the gates' supply, 7 thermal warning, 8 to 10 over-current of the shunts C, B, A"
        3, "gate driver faults", U16, RO, UNMAPPED, Field::Hardware(H::DriverFaults); "", 1.0, ANY;
            "Since the start; at 65535 it stays"
        4, "gate driver set-up", U8, RO, UNMAPPED, Field::Hardware(H::DriverSetup); "", 1.0, ANY;
            "What is missing before the bridge may switch: 0 nothing, 1 the driver wakes up, 2 it does not answer (no supply, or its bus), 3 it does not keep what is written, \
             4 a fault that is not cleared: by a fault reset, 5 another board than the program is for, 6 a converter of the chip. What can be tried again is, every 2 ms"
        5, "board revision", U8, RO, UNMAPPED, Field::Hardware(H::Revision); "", 1.0, ANY;
            "By the board's pins, 0 where it has none. Of a moteus r4: 0 r4.1 to r4.3, 1 r4.4, 2 r4.5, 3 r4.5b to r4.8, 4 r4.10 and r4.11; bit 7: another family"
    }
    0x2303 "chip options" {
        1, "chip options found", U32, RO, UNMAPPED, Field::Hardware(H::OptionsFound); "", 1.0, ANY;
            "FLASH_OPTR (RM0440), 0 where there is no chip"
        2, "chip options needed", U32, RO, UNMAPPED, Field::Hardware(H::OptionsNeeded); "", 1.0, ANY;
            "The same with SRAM_PE 0, nSWBOOT0 0 and nBOOT0 1"
        3, "chip options wrong", U8, RO, UNMAPPED, Field::Hardware(H::OptionsWrong); "", 1.0, ANY;
            "Bits: 0 SRAM_PE (parity of the SRAM is not checked), 1 nSWBOOT0 (a pin can start the bootloader), 2 nBOOT0"
        4, "set chip options", U32, WO, UNMAPPED, Field::Hardware(H::SetOptions); "", 1.0, ANY;
            "4254504Fh (\"OPTB\") sets them as they are needed and resets the chip; the joint must be switched off"
    }
    0x2304 "stored parameters" {
        1, "damaged", U8, RO, UNMAPPED, Field::Storage(StorageField::Damaged); "", 1.0, ANY;
            "Bits: 0 a friction image: what was stored before it is in use, or none; 1 the configuration, which may also be of another program, or refused: what was stored before, or the defaults are in use, and the joint \
             stays in switch on disabled until 1010h:1 or 3 has stored a configuration or 1011h:1 or 3 restored the defaults; 2 what guards the joint: nothing that needs its owner is taken. EMCY 6310h and bit 7 of 1001h say so"
        2, "stores left", U8, RO, UNMAPPED, Field::Storage(StorageField::StoresLeft); "", 1.0, ANY;
            "How often what 1010h, 1011h, LSS and 2212h:1 (commit, roll back) store may still be written, so that nobody wears the flash out: 32 after power-up, and one more each hour; no reset gives one back. A configuration that is stored already costs none, and is done at once"
    }
    0x2305 "fault log" {
        1, "power-ups", U32, RO, UNMAPPED, Field::Log(LogField::PowerUps); "", 1.0, ANY;
            "Number of power-ups, this one included. One that ends within 10 s without a fault is not counted; resets are none"
        2, "faults not logged", U16, RO, UNMAPPED, Field::Log(LogField::Missed); "", 1.0, ANY;
            "Since the start: those that came too many at a time, so that no storm of faults wears the flash out (two after power-up, and one more a minute; eight more wait), or that the flash refused; at 65535 it stays"
        3, "logged faults", Domain, RO, UNMAPPED, Field::Log(LogField::Faults); "", 1.0, ANY;
            "The newest 16 that were kept, the newest first, 12 bytes each: error code (u16, as in EMCY), number of the fault (0: what stopped the program, or the watchdog), reserved, number of the power-up (u32), time since the program started (u32, s)"
    }
}
