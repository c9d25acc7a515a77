//! The page's server from a page's side: a WebSocket client, a virtual joint served in real time, a browser where there
//! is one. Tests wait for what the joint or the server says, however long the machine takes for it.

mod browser;
mod commissioning;
mod hands;
mod led;
mod page;
mod parts;
#[cfg(unix)]
mod program;
#[allow(dead_code, reason = "rounds of a library, of which commands have more")]
#[path = "../../../jointctl/tests/remote/punctual.rs"]
mod punctual;
mod retraining;
mod safety;
mod security;
mod served;
#[allow(dead_code, reason = "benches do more with a browser")]
mod webdriver;

use libtest_mimic::{Arguments, Trial};

/// Tests at once, where the command line does not say how many: their joints run in real time.
const AT_ONCE: usize = 3;

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
    let mut trials = trials! {
        parts {
            live_values_and_states_come_as_the_joint_is_jogged_and_the_table_holds_them,
            friction_is_drawn_by_its_parts_and_as_before,
            every_motion_goes_where_it_was_asked_to_go_and_ends_disabled,
            a_motion_beyond_a_limit_is_refused_by_name,
            a_robot_is_told_where_it_is_given,
            joints_on_the_bus_and_what_they_miss_are_listed,
            joints_without_a_node_id_get_one,
            #[cfg(unix)] where_nobody_but_a_new_joint_is_the_page_gives_it_its_node_id_and_shows_it,
            a_fault_is_told_with_its_emcy,
            objects_are_read_set_stored_exported_and_imported,
            a_store_keeps_what_is_set_and_not_the_tpdos_that_the_page_watches_by,
            an_image_is_shadowed_tried_discarded_committed_and_rolled_back,
            another_client_that_takes_the_tpdos_ends_the_live_values_until_they_are_asked_for,
        }
        safety {
            a_page_that_is_gone_leaves_the_joint_disabled_and_the_next_one_commands,
            held_messages_that_stop_coming_stop_the_joint,
            stop_stops_whoever_asks_for_it,
            a_second_page_looks_and_may_not_change_anything,
            what_is_not_a_message_stops_the_joint_and_is_told_in_words,
            another_master_at_the_same_time_ends_in_a_joint_that_is_disabled,
            a_command_is_refused_while_a_page_moves_the_joint_and_the_page_goes_on,
            a_button_that_is_let_go_before_the_joint_is_enabled_moves_nothing,
            a_server_that_ends_stops_the_joint,
            #[cfg(unix)] a_program_that_is_terminated_stops_the_joint_and_one_that_is_killed_leaves_it_to_its_deadline,
        }
        commissioning {
            a_joint_is_commissioned_with_the_motor_that_it_has_and_a_no_leaves_it_as_it_was,
            what_is_let_go_stopped_or_gone_ends_a_commissioning_and_changes_nothing,
            another_page_sees_the_questions_and_may_not_answer_them,
        }
        retraining {
            a_joint_learns_and_what_was_let_go_while_it_computed_is_held_again,
            what_is_let_go_while_the_joint_moves_ends_a_round_and_keeps_what_it_had,
        }
        security {
            other_hosts_and_origins_are_refused,
            no_path_leads_beyond_the_table,
            every_answer_forbids_other_sources_and_frames,
            beyond_this_machine_a_token_is_wanted_once,
            requests_that_are_not_as_they_should_be_are_refused_and_the_server_goes_on,
            arguments_that_are_wrong_end_the_program_with_2_and_what_fails_with_1,
        }
    };
    // A browser is a large package: where there is none it is said by name; with CI set it is required.
    let ignored = std::env::var_os("CI").is_none() && !webdriver::is_there();
    let with_browser = trials! {
        browser {
            the_page_shows_values_that_move_and_the_joint_stands_once_the_button_is_let_go,
            a_robot_is_drawn_where_its_joints_are_and_each_has_its_own_page,
        }
    };
    trials.extend(with_browser.into_iter().map(|trial| trial.with_ignored_flag(ignored)));
    libtest_mimic::run(&arguments, trials).exit();
}
