//! Several joints on a modelled wire of 1 Mbit/s, in simulated time: saturation, an upload while the joint moves, two
//! joints that know of each other. What it all measures in regular service is in docs/bus.md.

mod coupled;
mod master;
mod saturation;
mod upload;
