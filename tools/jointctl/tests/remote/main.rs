//! A joint over a bus: the virtual joint served in real time on buses within this process, driven through the library
//! as the commands do it. What goes wrong goes wrong in one line, and leaves nothing half done.
//!
//! Most of their time these wait: more of them run at once than there are cores.

mod commands;
mod commission;
mod configuration;
mod images;
mod motion;
mod owner;
mod page;
mod punctual;
mod refused;
mod registry;
mod retrain;
mod robot;
mod served;
#[path = "../shown/mod.rs"]
mod shown;
#[path = "../tables/mod.rs"]
mod tables;
mod telemetry;

use libtest_mimic::{Arguments, Trial};

/// Tests at once, where the command line does not say how many. They hardly compute, but a dozen of them keep each
/// other from answering in time.
const AT_ONCE: usize = 4;

/// The tests of each module. One that is missing is a function that nobody uses, which the compiler tells.
macro_rules! trials {
    ($($module:ident { $($(#[$where:meta])? $test:ident,)+ })+) => {
        Vec::from([$($($(#[$where])? Trial::test(concat!(stringify!($module), "::", stringify!($test)), || {
            $module::$test();
            Ok(())
        }),)+)+])
    };
}

fn main() {
    let mut arguments = Arguments::from_args();
    arguments.test_threads.get_or_insert(AT_ONCE);
    let trials = trials! {
        commands {
            a_joint_is_looked_at_set_moved_and_fed_from_the_command_line,
            what_goes_wrong_ends_in_one_line_and_an_exit_code_that_tells_why,
            every_table_of_a_joint_is_json_where_that_is_asked_for,
            tables_are_json_where_asked_for_and_bus_and_node_come_from_the_environment,
            #[cfg(unix)] a_motion_that_is_interrupted_is_not_done,
            #[cfg(unix)] ctrl_c_and_termination_leave_the_joint_disabled,
            an_adapter_that_goes_away_while_the_joint_is_enabled_is_reported,
        }
        commission {
            a_joint_is_commissioned_with_the_motor_that_it_has_and_stopped_at_once_when_asked,
            a_commissioning_prints_json_alone_where_that_is_asked_for,
        }
        configuration {
            settings_are_taken_together_or_not_at_all,
            what_is_stored_outlasts_a_reset_and_what_is_restored_does_not,
            what_is_in_use_is_told_to_be_what_was_stored_until_a_value_changes,
            a_joint_whose_configuration_is_damaged_says_what_to_do_and_is_enabled_once_that_is_done,
            new_joints_get_the_node_ids_that_are_free,
            a_joint_that_was_left_with_an_id_that_it_does_not_use_yet_is_found_again,
            the_page_says_what_an_engineer_looks_for_first,
        }
        images {
            an_image_is_verified_shadowed_tried_committed_and_rolled_back,
            a_roll_back_without_an_image_before_and_a_trial_of_no_time_are_refused,
        }
        motion {
            each_mode_moves_the_joint_and_leaves_it_disabled,
            a_stream_of_positions_is_interpolated_and_60c2h_is_put_back,
            a_motion_beyond_a_limit_is_refused_by_name_before_the_joint_is_enabled,
            an_interrupt_in_motion_leaves_the_joint_disabled_and_without_a_fault,
            braking_may_take_longer_than_the_command_deadline,
            a_master_that_dies_leaves_a_fault_that_is_named_and_acknowledged_only_when_asked,
            disable_stops_a_joint_that_somebody_else_moves,
        }
        owner {
            what_the_owner_may_do_takes_a_session_that_ends_with_his_work,
            a_key_is_replaced_and_taken_back_by_who_has_it,
            the_program_takes_the_key_as_an_option_or_from_the_environment,
        }
        page {
            the_page_on_the_bus_runs_line_by_line,
            the_page_on_ownership_runs_line_by_line,
        }
        refused {
            a_wrong_node_id_is_told_from_a_bus_where_nobody_is,
            no_answer_says_for_how_long_and_what_to_look_at,
            a_node_that_is_no_joint_is_left_alone,
            a_damaged_image_is_refused_and_the_one_in_use_stays,
            an_image_for_another_joint_or_of_the_past_is_refused_with_both_numbers,
            a_wrong_key_is_refused_and_counted_and_keeps_no_right_one_out,
            a_signed_image_of_the_right_key_is_taken,
            a_bus_that_is_unplugged_at_any_frame_of_an_upload_leaves_the_old_image_or_the_new_one,
            two_clients_at_once_are_told_of_each_other_and_the_image_stays,
            two_masters_of_one_joint_end_in_a_joint_that_is_disabled,
            a_second_command_is_refused_and_the_first_goes_on,
            a_string_that_is_no_bus_is_answered_with_those_that_are,
        }
        registry {
            joints_with_the_registrys_image_with_another_unknown_and_silent_ones_are_told_apart,
        }
        punctual { a_round_that_failed_is_repeated_only_where_the_machine_was_late, }
        retrain {
            a_round_lowers_what_is_unexplained_and_commits_a_newer_version,
            an_interrupted_round_leaves_the_joint_disabled_with_the_image_that_it_had,
            a_round_that_could_change_nothing_is_refused_before_the_joint_moves,
            a_recording_of_a_motion_is_a_data_set,
            two_producers_of_sync_are_told_of,
            a_round_after_which_the_joint_keeps_its_image_prints_its_figures_and_ends_with_3,
        }
        robot {
            all_joints_of_an_arm_move_together_and_are_left_disabled,
            an_arm_of_the_program_is_moved_and_recorded_by_the_program,
        }
        telemetry {
            samples_come_with_every_sync_in_si_units_and_the_pdos_are_put_back,
            samples_that_a_joint_did_not_send_are_told_of,
            the_pdos_of_a_new_joint_are_read_as_the_firmware_declares_them,
        }
    };
    libtest_mimic::run(&arguments, trials).exit();
}
