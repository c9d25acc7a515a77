//! Parts on the boards that the chip talks to over SPI.

pub mod as5047p;
pub mod drv8353;
pub mod rotor_encoder;
