//! Joint actuator firmware that learns the friction of the joint it runs on and cancels it.
#![cfg_attr(not(test), no_std)]
