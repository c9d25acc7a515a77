//! Meaning of a sensor's raw word: pure functions that the board, the emulator and the tests share.

pub mod analog;
pub mod as5047p;
pub mod incremental;
pub mod rotor_encoder;
pub mod thermistor;
