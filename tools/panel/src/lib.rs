//! A live page for one joint on a bus, in a browser on this machine; host.
//!
//! ```text
//! page  <-- WebSocket -->  server::session  -- orders -->  owner: one thread a joint  <-- bus -->  joint
//!          held, 50 ms  ->  hold  ------------------------->  stream's source, owner (200 ms)
//! ```
//!
//! - [`server`]: HTTP and WebSocket on 127.0.0.1; [`guard`]: Host, Origin and token; [`assets`]: the files of the page;
//!   [`reports`]: those that it was made
//! - [`message`]: what a page may ask
//! - [`owner`]: the thread that alone talks to a joint: live values, motion, requests in their order
//! - [`hold`]: the dead man's switch; [`motion`]: jog, sine, steps, impedance, frozen as soon as it is not held
//! - [`live`]: signals at full rate, reduced to minima and maxima for a page; [`slow`]: values that are read one by one
//! - [`skeleton`]: a robot as the page draws it; [`scan`]: joints on the bus; [`checklist`]: what a board still misses;
//!   [`history`]: steps before a fault; [`settings`]: objects and joint.toml; [`learning`]: images and compensation

#![forbid(unsafe_code)]

pub mod assets;
pub mod checklist;
pub mod guard;
pub mod history;
pub mod hold;
pub mod learning;
pub mod live;
pub mod message;
pub mod motion;
pub mod owner;
pub mod reports;
pub mod scan;
pub mod server;
pub mod settings;
pub mod skeleton;
pub mod slow;
