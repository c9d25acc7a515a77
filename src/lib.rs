//! Joint actuator firmware that learns the friction of the joint it runs on and cancels it.
#![cfg_attr(not(test), no_std)]
#![deny(unsafe_code)]

pub mod canopen;
pub mod compensation;
pub mod default_configuration;
#[allow(unsafe_code)]
pub mod dsp;

pub mod exchange;
pub mod friction;
pub mod hardware;
pub mod joint;
pub mod motor;
pub mod objects;
pub mod parameters;
pub mod quantity;
pub mod reset_record;
pub mod sensors;
pub mod sine;
