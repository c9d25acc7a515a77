//! Object dictionary of this joint: the only place where an index meets a field.
//!
//! # Two contexts, as in [`canopen`](canopen_node)
//!
//!  - [`JointImage`], in the receive interrupt: RPDOs to one [`Demand`](crate::joint::Demand), actual values to TPDOs.
//!  - [`Objects`], in the task below: every object by SDO, storing, the image life cycle, EMCYs.
//!  - [`Shared`], a static, which both borrow.
//!
//! [`table`] declares every object once; the server's entries, `docs/objects.md` and the texts that a host makes (EDS,
//! DBC) come from it. [`field`] is what an object can be about. The rest has one idea a file: [`Observed`] and its
//! scaling, [`settings`] of the configuration, [`Operation`] for the modes, `profile_positions` and `profile_modes` for
//! those in which positions have a hand-shake and an end, [`Images`] for the life cycle, [`Ownership`] for key and
//! sessions, [`Stored`] for what 1010h keeps, [`Start`] for what a joint begins with, [`emergency`] for codes,
//! [`fault_log`] for what outlives the power.
//!
//! ```text
//!  receive interrupt   image.at(now); image.observe(&observed)
//!                      receiver.receive(&frame, now, &mut image, send)      route to the task's queue
//!                      image.follow(node.state()); publish(image.demand()); image.leave_copies()
//!  task                server.receive(&frame, now, &mut objects)            where shared.has_written(): pend the interrupt
//!                      objects.poll(milliseconds, &observed)
//!                      objects.take_emergency() -> server.emergency(..)
//!                      objects.take_action() -> flash or control step -> objects.finished(..)
//!                      server.poll(now, &mut objects) -> send
//! ```
//!
//! A demand that nobody refreshes becomes stale by its deadline. The task has the interrupt run on every
//! [`Event::State`](canopen_node::Event::State), so that a transition of its own reaches the joint without a frame.

mod communication;
mod dictionary;
pub mod emergency;
pub mod fault_log;
pub mod field;
mod friction_statistics;
mod hardware;
mod history;
mod images;
mod interpolation;
mod last_reset;
mod number;
mod observed;
mod open_loop;
mod operation;
pub mod ownership;
mod process_image;
mod profile_modes;
mod profile_positions;
mod program;
mod refused;
mod set_points;
pub mod settings;
mod shared;
mod start;
mod store_budget;
mod stored;
pub mod table;

#[cfg(test)]
mod tests;

pub use communication::default_communication;
pub use dictionary::Objects;
pub use friction_statistics::FrictionStatistics;
pub use history::STEP;
pub use images::{Images, StoredImages};
pub use observed::Observed;
pub use operation::Operation;
pub use ownership::Ownership;
pub use process_image::JointImage;
pub use program::{NotConfigured, Program};
pub use set_points::impedance_frame;
pub use shared::{DEFAULT_RANGES, Shared};
pub use start::Start;
pub use store_budget::STORES;
pub use stored::{Part, RECORD, Stored, Update};
