//! Joint actuator firmware that learns the friction of the joint it runs on and cancels it.
//!
//! This library is everything of it that knows no register; `main.rs`, `board` and `tasks` are the program around it. A
//! measurement takes this way: [`sensors`] (what a raw word means), [`joint`] (faults, state machine, motion),
//! [`friction_compensation`] (what friction will take of the torque), [`motor`] (the current loop). Commands and
//! settings come through [`canopen_node`] (the protocol) and [`objects`] (this joint's), images through
//! [`friction_compensation::parameters`].
//!
//! # Where code runs
//!
//! The first sentence of most modules ends in the place in which their code runs:
//!
//! - **control step**: the interrupt of the highest priority, once a PWM period (20 or 40 kHz). Nothing there panics,
//!   allocates, blocks, logs or loops without a bound; `host-tests/tests/linked` reads the linked program for that.
//! - **receive interrupt**: a frame has come from the bus; the control step interrupts it.
//! - **task**: an asynchronous task, which both interrupt. It may take milliseconds.
//! - **thread mode**: the start, and the tasks of the lowest priority.
//! - **host**: a computer, with the standard library.
//! - **any context**: all of them.
//!
//! "001, eq. 5" is an equation of a paper: `docs/bibliography.md`.
#![cfg_attr(not(test), no_std)]
#![deny(unsafe_code)]

pub mod default_configuration;
pub mod exchange;
pub mod hardware;
pub mod joint;
pub mod motor;
pub mod objects;
pub mod reset_record;
pub mod sensors;
