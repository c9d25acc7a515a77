//! A joint over a bus: the virtual joint served in real time on buses within this process, driven through the library as the commands
//! do it. What goes wrong goes wrong in one line, and leaves nothing half done.

mod calibration;
mod commands;
mod configuration;
mod images;
mod motion;
mod refused;
mod retrain;
mod served;
mod telemetry;
