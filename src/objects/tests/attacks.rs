//! `docs/attacks.md`: what was tried against a joint and its owner, and the tests that show what the joint does.

use super::documentation::held_to;
use super::evidence::{Evidence, links};
use std::fmt::Write;

const HEAD: &str = "# Attacks

What was tried against a joint over its bus and against what it stores, what it does then, and the tests that show it. `src/objects/tests/attacks.rs` has the rows and fails where a test is gone;
`UPDATE_DOCS=1 cargo test -p joint-firmware --lib objects` writes this page anew. An *owned* joint has a key; [ownership.md](ownership.md) says how it gets one. Tests below `emulated` run
the program of a board as it is flashed, on an emulated core. Nothing of this has run on hardware.

Not defended, and not meant to be:

- **Commands in real time.** CAN does not say who sent a frame: whoever can send on the bus can enable, move and stop a joint, owned or not, within the limits that its owner set, and can keep others from sending.
- **A session that is open.** It serves whoever sends meanwhile. It ends with the command that opened it, 60 s after what was last written, or 10 minutes after it was opened.
- **A heartbeat or a node id that is forged**: a master that is gone can be impersonated, and a node id can be changed until the next reset.
- **The first key on a bus where somebody listens**: it goes over the bus as it is.
- **The minute after power-up of a board without a button**: until a master starts the node, whatever is on the bus counts as somebody who is at the joint. It may give a joint of nobody's a key, or have an owned one forget its key; the joint tells (2215h:1, `jointctl info`). Start the nodes early, or switch the supply on without strangers on the bus.
- **Who has the board in his hands**: the debug port reads and writes everything where the chip's option bytes let it.
";

struct Attack {
    attack: &'static str,
    joint: &'static str,
    tests: &'static [Evidence],
}

const fn row(attack: &'static str, joint: &'static str, tests: &'static [Evidence]) -> Attack {
    Attack { attack, joint, tests }
}

const OWNERSHIP: &str = "src/objects/tests/ownership.rs";
const IMAGES: &str = "src/objects/tests/images.rs";
const LIFE: &str = "crates/friction-compensation/src/parameters/life_cycle/tests.rs";
const TAGS: &str = "crates/friction-compensation/src/parameters/authentication.rs";
const NODE: &str = "tools/node/tests/attacks.rs";
const SCRIPT: &str = "tools/node/src/hostile/script.rs";
const BOARDS: &str = "host-tests/tests/emulated/ownership.rs";
const POWER: &str = "host-tests/tests/emulated/power_cut.rs";
const STORES: &str = "src/objects/tests/stores.rs";
const STORED: &str = "tools/node/tests/stored.rs";
const REMOTE: &str = "tools/jointctl/tests/remote/owner.rs";

const SECTIONS: [(&str, &[Attack]); 5] = [
    ("Settings and keys", &KEYS),
    ("Sessions", &SESSIONS),
    ("Images", &UPLOADS),
    ("Stored records", &RECORDS),
    ("The bus and a joint that moves", &BUS),
];

const KEYS: [Attack; 10] = [
    row(
        "A setting, an option code, 1010h, 1011h, a roll back or the chip's options without a session",
        "Refused (0800 0021h); nothing is staged or stored. Every setting of the object table is tried",
        &[
            (OWNERSHIP, "an_owned_joint_refuses_whatever_changes_what_it_can_do_until_its_owner_opens_a_session"),
            (OWNERSHIP, "every_setting_of_the_table_is_protected"),
            (REMOTE, "what_the_owner_may_do_takes_a_session_that_ends_with_his_work"),
        ],
    ),
    row(
        "The zero, and the limits with it, moved by homing without a session, again and again",
        "Homing fails (bit 13 of the statusword), nothing moves; method and offset (6098h, 607Ch) are refused. Method 0, which changes nothing, is done",
        &[
            (NODE, "homing_moves_the_zero_of_an_owned_joint_in_its_owners_session_alone"),
            (OWNERSHIP, "an_owned_joint_refuses_whatever_changes_what_it_can_do_until_its_owner_opens_a_session"),
        ],
    ),
    row(
        "More compensation than the owner set",
        "Refused; less, as far as off, is taken from all",
        &[(OWNERSHIP, "compensation_may_be_lowered_below_what_the_owner_set_by_all_and_raised_by_none")],
    ),
    row(
        "A first key by somebody who is not at the joint",
        "Refused: the button has to be pressed, or the supply has come less than 60 s ago and no master has started the node",
        &[
            (
                OWNERSHIP,
                "presence_is_the_minute_after_power_up_before_a_master_starts_the_node_and_cannot_be_made_over_the_bus",
            ),
            (OWNERSHIP, "a_board_with_a_button_wants_it_pressed_whatever_the_time"),
            (BOARDS, "b_g431b_esc1_belongs_to_who_presses_its_button"),
        ],
    ),
    row(
        "Presence made over the bus: NMT resets, a stop and a start, a reset by the watchdog",
        "None: a reset is no power-up, and a node that was started once stays so",
        &[
            (
                OWNERSHIP,
                "presence_is_the_minute_after_power_up_before_a_master_starts_the_node_and_cannot_be_made_over_the_bus",
            ),
            (BOARDS, "moteus_r4_belongs_to_who_has_its_key"),
        ],
    ),
    row(
        "Another key for a joint that has one, also in its minute of presence",
        "Refused without the tag of the key in force over the challenge; the version floor stays",
        &[
            (OWNERSHIP, "a_key_that_is_there_is_replaced_by_a_signed_one_alone"),
            (REMOTE, "a_key_is_replaced_and_taken_back_by_who_has_it"),
        ],
    ),
    row(
        "A masked key of the owner's with a bit flipped on the way",
        "Refused: the tag covers the masked key",
        &[
            (OWNERSHIP, "a_key_that_is_there_is_replaced_by_a_signed_one_alone"),
            (TAGS, "a_response_is_bound_to_purpose_joint_challenge_and_new_key"),
        ],
    ),
    row(
        "The key taken back in a session that somebody else opened, or by nobody at the joint",
        "Refused: it takes a response of its own, or somebody at the joint",
        &[(OWNERSHIP, "a_key_is_taken_back_by_its_owner_or_by_who_is_there")],
    ),
    row(
        "A node id stored by LSS",
        "Refused without a session (LSS error 255, 2): a node id that anybody gave ends with the next reset",
        &[(OWNERSHIP, "a_node_id_is_stored_for_the_owner_alone")],
    ),
    row(
        "A key that is all zeros, or of equal bytes, or too short",
        "Refused",
        &[
            (IMAGES, "a_key_is_given_once_and_from_then_on_tags_count"),
            (TAGS, "a_key_does_not_show_and_is_not_of_equal_bytes"),
        ],
    ),
];

const SESSIONS: [Attack; 9] = [
    row(
        "A response of another key, for another joint, another challenge or another purpose; an image's tag as a response",
        "Refused and counted",
        &[
            (OWNERSHIP, "a_response_opens_once_and_only_its_own_joint"),
            (TAGS, "a_response_is_bound_to_purpose_joint_challenge_and_new_key"),
        ],
    ),
    row(
        "A response sent again, in the same session and after it",
        "Refused: a challenge is drawn anew after each right response, by the chip's random numbers",
        &[
            (OWNERSHIP, "a_response_opens_once_and_only_its_own_joint"),
            (BOARDS, "moteus_r4_belongs_to_who_has_its_key"),
        ],
    ),
    row(
        "A whole session that was recorded, with settings, 1010h and two rotations of the key, sent again",
        "Changes nothing, before and after a restart",
        &[(OWNERSHIP, "a_whole_session_that_was_recorded_and_is_sent_again_changes_nothing")],
    ),
    row(
        "Two owners with the same challenge",
        "The first response wins; the second asks again",
        &[(OWNERSHIP, "of_two_owners_who_race_the_second_one_asks_again")],
    ),
    row(
        "Two rotations of the key whose frames mix on the SDO channel, at every frame",
        "The first that is whole wins; where one breaks into the other neither does, and each can be sent again",
        &[(OWNERSHIP, "of_two_rotations_that_race_one_comes_through_whole_or_none")],
    ),
    row(
        "Wrong tags and responses without end, to lock the owner out or to wear the flash",
        "No right one is kept out; the count is written at powers of two only",
        &[
            (LIFE, "wrong_tags_are_counted_and_a_right_one_is_always_taken"),
            (OWNERSHIP, "a_response_opens_once_and_only_its_own_joint"),
            (IMAGES, "a_key_is_given_once_and_from_then_on_tags_count"),
        ],
    ),
    row(
        "A chip that draws no random numbers",
        "No challenge, no session",
        &[(OWNERSHIP, "without_random_numbers_there_is_no_challenge_and_no_session")],
    ),
    row(
        "A session that its owner left open",
        "Ends 60 s after what was last written, with a restart, and cannot be lengthened by writing its time",
        &[
            (OWNERSHIP, "a_session_lasts_sixty_seconds_after_what_was_written_last"),
            (OWNERSHIP, "a_session_ends_with_the_program"),
        ],
    ),
    row(
        "A session of the owner's kept open by a stranger's writes",
        "Ends 10 minutes after it was opened whatever is written; less compensation, which all may ask for, does not lengthen it",
        &[
            (OWNERSHIP, "a_session_ends_ten_minutes_after_it_was_opened_whatever_is_written_in_it"),
            (OWNERSHIP, "who_lowers_the_compensation_keeps_no_session_open"),
        ],
    ),
];

const UPLOADS: [Attack; 13] = [
    row(
        "An image without a tag, with another key's, with another image's, for another joint",
        "Not verified, so neither run nor stored; the image in use stays",
        &[
            (LIFE, "with_a_key_an_image_needs_its_tag"),
            (LIFE, "images_for_others_are_refused"),
            (SCRIPT, "a_script_can_do_what_an_owner_can_so_that_the_judge_has_something_to_judge"),
        ],
    ),
    row(
        "A bit flipped in an image or in its tag: each one",
        "Not verified",
        &[
            (TAGS, "every_single_bit_of_image_and_tag_matters"),
            (LIFE, "every_changed_bit_of_an_image_is_refused"),
            ("host-tests/tests/image.rs", "every_flipped_bit_is_refused_with_its_reason"),
        ],
    ),
    row(
        "The staged bytes changed behind the verification",
        "Neither run nor stored",
        &[(LIFE, "what_changes_after_verification_is_neither_run_nor_stored")],
    ),
    row(
        "An image that was verified before the joint had a key",
        "Needs its tag after",
        &[(LIFE, "an_image_verified_before_the_key_came_needs_its_tag_after")],
    ),
    row(
        "An image whose tag was right once, of a version below the floor",
        "Refused",
        &[
            (LIFE, "the_floor_rises_with_right_tags_alone"),
            (NODE, "the_version_floor_stays_on_every_path_of_an_image_but_a_commit_which_raises_it"),
        ],
    ),
    row(
        "The image that its owner rolled back from, sent again with its tag: of the floor's version, also out of a trial",
        "Stored in the owner's session alone; tried as long as a trial lasts. A refused commit costs no store",
        &[
            (IMAGES, "an_image_that_is_not_newer_is_its_owners_to_store_and_costs_a_stranger_and_the_flash_nothing"),
            (NODE, "the_version_floor_stays_on_every_path_of_an_image_but_a_commit_which_raises_it"),
        ],
    ),
    row(
        "The image in use committed again and again, to use up the counted stores or the flash",
        "Done at once: nothing is written, nothing counted",
        &[
            (IMAGES, "a_commit_of_the_image_in_use_is_done_at_once_writes_nothing_and_costs_no_store"),
            (LIFE, "the_image_in_use_is_not_stored_again_and_raises_the_floor_all_the_same"),
        ],
    ),
    row(
        "The floor raised to FFFFFFFFh by an image that is not the owner's",
        "Not raised: neither by what is refused, nor by what is verified, in shadow or on trial only, nor by what a joint without a key stores: it has no floor, and takes any version after",
        &[
            (LIFE, "the_floor_rises_with_right_tags_alone"),
            (NODE, "the_version_floor_stays_on_every_path_of_an_image_but_a_commit_which_raises_it"),
            (IMAGES, "without_a_key_an_image_of_the_highest_version_shuts_no_other_out"),
        ],
    ),
    row(
        "The floor lowered by a roll back, a discard, 1011h, a reset, a loss of power",
        "Stays",
        &[
            (NODE, "the_version_floor_stays_on_every_path_of_an_image_but_a_commit_which_raises_it"),
            (LIFE, "rolling_back_goes_past_the_floor_and_leaves_it"),
        ],
    ),
    row(
        "A roll back by a stranger, to an older image or to one from before the key",
        "Refused without a session; its owner's goes to the one stored image before, whatever its version",
        &[
            (OWNERSHIP, "an_owned_joint_refuses_whatever_changes_what_it_can_do_until_its_owner_opens_a_session"),
            (NODE, "the_version_floor_stays_on_every_path_of_an_image_but_a_commit_which_raises_it"),
        ],
    ),
    row(
        "An image that computes otherwise, or more than its certificate or the joint permits",
        "Not verified: golden vectors and certificate are checked on the joint",
        &[
            (LIFE, "golden_vectors_that_come_out_differently_are_refused"),
            (LIFE, "the_certificate_is_held_to_the_images_limits_and_the_joints"),
            ("host-tests/tests/emulated/images.rs", "b_g431b_esc1_refuses_an_image_that_computes_otherwise"),
        ],
    ),
    row(
        "An upload that breaks off, or is longer or shorter than announced",
        "Not verified",
        &[(IMAGES, "an_upload_that_breaks_off_is_not_verified"), (LIFE, "uploads_that_do_not_fit_are_refused")],
    ),
    row(
        "A trial whose client has gone",
        "Ends at its time, or with the lost heartbeat; the stored image comes back",
        &[
            (LIFE, "a_trial_ends_by_itself_at_its_time_or_without_a_heartbeat"),
            (IMAGES, "a_trial_ends_with_a_lost_heartbeat"),
        ],
    ),
];

const RECORDS: [Attack; 8] = [
    row(
        "A bit flipped in what guards the joint (key, floor, count): each one",
        "The record before is used only locked: no image, setting or key is taken before the owner repairs it",
        &[
            (
                "tools/node/src/storage.rs",
                "a_bit_of_what_guards_the_joint_that_flips_changes_nothing_or_locks_and_never_opens",
            ),
            (OWNERSHIP, "what_is_damaged_locks_until_the_owner_repairs_it"),
            (LIFE, "a_damaged_key_takes_nothing_and_leaves_what_there_is"),
        ],
    ),
    row(
        "Other bytes in place of that record",
        "Locked",
        &[("crates/friction-compensation/src/parameters/guard.rs", "bytes_that_are_no_record_lock")],
    ),
    row(
        "A bit flipped in a slot: each one",
        "Reported; the other slot is used from then on",
        &[(
            "crates/friction-compensation/src/parameters/slots/tests/mod.rs",
            "every_rotten_bit_of_the_newest_is_reported_and_the_other_slot_is_used_from_then_on",
        )],
    ),
    row(
        "A byte of the newest stored configuration damaged: each one",
        "Told at every start (EMCY 6310h, 2304h:1); the joint stays in switch on disabled until a configuration is stored or the defaults are restored",
        &[
            (
                STORES,
                "a_configuration_that_is_damaged_at_any_byte_is_told_and_keeps_the_joint_off_at_every_start_until_one_is_stored",
            ),
            (
                STORED,
                "a_joint_whose_configuration_is_damaged_says_so_at_every_start_and_is_not_enabled_before_one_is_stored",
            ),
        ],
    ),
    row(
        "A byte of the newest stored image damaged: each one",
        "Told at every start; the image before is in use, or none",
        &[
            (
                "tools/node/src/storage.rs",
                "an_image_that_is_damaged_at_any_byte_gives_way_to_the_one_before_and_is_told_at_every_start",
            ),
            (STORED, "a_damaged_image_is_told_at_every_start_and_the_joint_goes_on_without_it"),
        ],
    ),
    row(
        "Configuration, node id or images stored, committed or rolled back in a loop, with resets between, to wear the flash out",
        "32 writes after power-up and one more each hour, then refused (0800 0022h), the owner's too. No reset over the bus gives one back; a configuration that is stored already is not written",
        &[
            (STORES, "whoever_stores_in_a_loop_is_stopped_and_no_reset_over_the_bus_gives_anything_back"),
            (IMAGES, "commits_and_roll_backs_are_counted_with_the_other_stores_and_stop_with_the_last"),
            (
                STORED,
                "who_stores_in_a_loop_is_stopped_before_the_flash_is_worn_out_and_a_reset_of_the_node_gives_nothing_back",
            ),
        ],
    ),
    row(
        "A loss of power at each operation of the flash, while an image or a first key is stored",
        "The old content or the new one, whole",
        &[
            (POWER, "an_image_is_the_old_one_or_the_new_one"),
            (POWER, "the_first_key_is_there_or_not"),
            (
                "crates/friction-compensation/src/parameters/slots/tests/power_cuts.rs",
                "two_losses_of_power_anywhere_leave_the_old_content_or_the_new_one_for_good",
            ),
        ],
    ),
    row(
        "A flash that fails between floor and image, or while the owner changes",
        "The floor comes before its image; an image whose floor is not kept is not stored, and an owner who is not kept is none",
        &[
            (IMAGES, "the_floor_is_kept_before_an_image_with_a_tag_is_stored_or_it_is_not_stored"),
            (OWNERSHIP, "a_change_of_the_owner_that_cannot_be_kept_is_none"),
        ],
    ),
];

const BUS: [Attack; 10] = [
    row(
        "NMT frames of another length, for another node or of no command, to a joint that moves",
        "Nothing",
        &[(
            NODE,
            "an_nmt_frame_of_another_length_for_another_node_or_of_no_command_does_nothing_to_a_joint_that_moves",
        )],
    ),
    row(
        "LSS to a joint that moves: configuration, node id, bit timing, store",
        "Refused (LSS error 255, 1); it moves on, and keeps its node id",
        &[
            (NODE, "lss_changes_neither_the_motion_nor_the_node_id_of_a_joint_that_moves"),
            ("crates/canopen-node/src/tests/lss.rs", "a_node_that_cannot_do_without_its_id_keeps_it"),
        ],
    ),
    row(
        "NMT stop, or a reset, to a joint that moves",
        "Taken: it brakes first, and restarts at rest",
        &[
            ("tools/node/tests/on_the_bus.rs", "nmt_stop_in_motion_brakes_the_joint_and_set_points_no_longer_count"),
            ("tools/node/tests/on_the_bus.rs", "a_reset_of_the_node_in_motion_waits_until_the_joint_has_braked"),
        ],
    ),
    row(
        "Set-points before the node is started, or after it was stopped",
        "Not taken, also not later",
        &[
            ("src/objects/tests/hostile.rs", "whatever_comes_no_torque_is_asked_for_outside_operational"),
            (
                "crates/canopen-node/src/tests/other_stacks.rs",
                "an_rpdo_received_before_operational_is_not_applied_later",
            ),
        ],
    ),
    row(
        "Any set-point, also infinite, in any mode",
        "Torque, speed and travel stay within their limits",
        &[
            ("tools/plant/tests/joint/hostile.rs", "whatever_is_commanded_the_torque_stays_within_its_limit"),
            (
                "tools/plant/tests/joint/hostile.rs",
                "whatever_is_measured_and_asked_the_joint_keeps_its_promises_and_comes_back",
            ),
        ],
    ),
    row(
        "Half a million frames of a client without the key who knows the protocol, with a judge beside the joint",
        "No image without a tag runs or is stored, the floor does not come down, the key stays, nothing is written under current",
        &[
            (SCRIPT, "half_a_million_frames_of_a_hostile_bus_do_nothing_that_the_protocol_does_not_allow"),
            (SCRIPT, "a_judge_that_is_told_of_another_key_sees_what_is_wrong"),
        ],
    ),
    row(
        "Two million random frames, and mutated transfers",
        "No panic, no transition and no set-point that the protocol does not allow; a transfer is whole or nothing",
        &[
            (
                "crates/canopen-node/src/tests/hostile.rs",
                "two_million_frames_of_a_hostile_bus_do_nothing_that_the_protocol_does_not_allow",
            ),
            ("crates/canopen-node/src/tests/hostile.rs", "a_mutated_transfer_is_whole_or_nothing"),
        ],
    ),
    row(
        "A bus that is full",
        "No control step is late, NMT stop acts within a frame; a joint whose set-points are lost brakes, and is as before afterwards",
        &[
            ("host-tests/tests/emulated/full_bus.rs", "a_full_bus_moves_no_control_step_of_moteus_r4"),
            ("host-tests/tests/emulated/full_bus.rs", "a_full_bus_moves_no_control_step_of_b_g431b_esc1"),
            ("tools/node/tests/paced/saturation.rs", "nmt_stop_on_a_bus_of_100_percent_acts_within_one_frame_time"),
            (
                "tools/node/tests/paced/saturation.rs",
                "a_flood_that_no_joint_can_help_stops_the_joints_and_afterwards_everything_is_as_before",
            ),
        ],
    ),
    row(
        "A master that repeats its last PDO without thinking",
        "Renews nothing where the counter (2010h) is mapped",
        &[("src/objects/tests/process_data.rs", "a_counter_that_is_mapped_and_repeated_does_not_renew_the_deadline")],
    ),
    row(
        "The PDO of a cyclic set-point that has died, while others go on: a controlword, another mode's target",
        "Late (8100h) after the deadline: the set-point of the mode renews it alone, in whatever PDO it is mapped",
        &[
            ("src/objects/tests/process_data.rs", "whatever_the_mapping_the_set_point_of_the_mode_counts_alone"),
            ("tools/node/tests/on_the_bus.rs", "a_velocity_whose_pdo_has_died_is_late_whatever_else_still_comes"),
        ],
    ),
];

#[test]
fn every_attack_of_the_page_has_a_test() {
    let mut text = HEAD.to_owned();
    for (title, attacks) in SECTIONS {
        writeln!(text, "\n## {title}\n\n| attack | the joint | tests |\n|---|---|---|").unwrap();
        for Attack { attack, joint, tests } in attacks {
            assert!(!tests.is_empty(), "{attack}");
            writeln!(text, "| {attack} | {joint} | {} |", links(tests)).unwrap();
        }
    }
    held_to("docs/attacks.md", &text);
}
