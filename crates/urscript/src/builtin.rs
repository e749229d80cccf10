//! The names that are built into the language, and what becomes of their calls.

use crate::call::Call;
use crate::functions::{arm, math, poses, texts};
use crate::machine::Machine;
use crate::place::ScriptError;
use crate::value::Value;

/// A built-in function.
pub(crate) struct Builtin {
    pub name: &'static str,
    /// Parameters in their order.
    pub parameters: &'static [&'static str],
    /// How many of them a call has to give.
    pub required: usize,
    pub does: Does,
}

/// What a call does.
#[derive(Clone, Copy)]
pub(crate) enum Does {
    /// Something that is evaluated.
    Evaluate(fn(&mut Machine<'_>, &Call) -> Result<Value, ScriptError>),
    /// Nothing, with a note.
    Nothing(&'static str),
    /// It ends the evaluation.
    Refused(Reason),
}

/// Why a call is not evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reason {
    Measured,
    Input,
    Network,
    Person,
    Force,
    Speed,
    Tracking,
    Planned,
    Chance,
    Clock,
    Safety,
    Language,
}

impl Reason {
    /// What the function does, and why that is not evaluated.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Measured => "reads the arm's measured state",
            Self::Input => "reads an input of the controller",
            Self::Network => "exchanges data with another device or program",
            Self::Person => "waits for a person's answer",
            Self::Force => "moves by forces, or with the arm's stiffness changed",
            Self::Speed => "moves at a speed until something stops it",
            Self::Tracking => "moves with a conveyor, or on an offset",
            Self::Planned => "moves on a course that only the controller knows",
            Self::Chance => "is random",
            Self::Clock => "reads the clock",
            Self::Safety => "depends on the robot's safety configuration, or changes its state",
            Self::Language => "is not evaluated",
        }
    }
}

const fn evaluated(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    does: fn(&mut Machine<'_>, &Call) -> Result<Value, ScriptError>,
) -> Builtin {
    Builtin {
        name,
        parameters,
        required,
        does: Does::Evaluate(does),
    }
}

/// What is evaluated, by name.
static EVALUATED: [Builtin; 62] = [
    evaluated("acos", 1, &["f"], math::acos),
    evaluated("asin", 1, &["f"], math::asin),
    evaluated("atan", 1, &["f"], math::atan),
    evaluated("atan2", 2, &["x", "y"], math::atan2),
    evaluated("ceil", 1, &["f"], math::ceil),
    evaluated("cos", 1, &["f"], math::cos),
    evaluated("d2r", 1, &["d"], math::d2r),
    evaluated("floor", 1, &["f"], math::floor),
    evaluated(
        "get_actual_joint_positions",
        0,
        &[],
        arm::joints_before_the_first_motion,
    ),
    evaluated(
        "get_actual_tcp_pose",
        0,
        &[],
        arm::tcp_before_the_first_motion,
    ),
    evaluated(
        "get_actual_tool_flange_pose",
        0,
        &[],
        arm::flange_before_the_first_motion,
    ),
    evaluated("get_forward_kin", 0, &["q", "tcp"], arm::forward),
    evaluated(
        "get_inverse_kin",
        1,
        &[
            "x",
            "qnear",
            "maxPositionError",
            "maxOrientationError",
            "tcp",
        ],
        arm::inverse,
    ),
    evaluated(
        "get_inverse_kin_has_solution",
        1,
        &[
            "pose",
            "qnear",
            "maxPositionError",
            "maxOrientationError",
            "tcp",
        ],
        arm::has_inverse,
    ),
    evaluated(
        "get_joint_positions",
        0,
        &[],
        arm::joints_before_the_first_motion,
    ),
    evaluated("get_list_length", 1, &["v"], texts::length),
    evaluated("get_steptime", 0, &[], arm::period),
    evaluated("get_target_joint_positions", 0, &[], arm::target_joints),
    evaluated("get_target_payload", 0, &[], arm::payload),
    evaluated("get_target_tcp_pose", 0, &[], arm::target_tcp),
    evaluated("get_tcp_offset", 0, &[], arm::tcp_offset),
    evaluated(
        "interpolate_pose",
        3,
        &["p_from", "p_to", "alpha"],
        poses::interpolate,
    ),
    evaluated("length", 1, &["v"], texts::length),
    evaluated("log", 2, &["b", "f"], math::log),
    evaluated(
        "movec",
        2,
        &["pose_via", "pose_to", "a", "v", "r", "mode"],
        arm::movec,
    ),
    evaluated("movej", 1, &["q", "a", "v", "t", "r"], arm::movej),
    evaluated("movel", 1, &["pose", "a", "v", "t", "r"], arm::movel),
    evaluated("movep", 1, &["pose", "a", "v", "r"], arm::movep),
    evaluated("norm", 1, &["a"], math::norm),
    evaluated("normalize", 1, &["v"], math::normalize),
    evaluated("point_dist", 2, &["p_from", "p_to"], poses::distance),
    evaluated("pose_add", 2, &["p_1", "p_2"], poses::add),
    evaluated("pose_dist", 2, &["p_from", "p_to"], poses::distance),
    evaluated("pose_inv", 1, &["p_from"], poses::inverse),
    evaluated("pose_sub", 2, &["p_to", "p_from"], poses::subtract),
    evaluated("pose_trans", 2, &["p_from", "p_from_to"], poses::transform),
    evaluated("pow", 2, &["base", "exponent"], math::pow),
    evaluated("r2d", 1, &["r"], math::r2d),
    evaluated(
        "rotvec2rpy",
        1,
        &["rotation_vector"],
        poses::rpy_from_vector,
    ),
    evaluated("rpy2rotvec", 1, &["rpy_vector"], poses::vector_from_rpy),
    evaluated(
        "servoj",
        1,
        &["q", "a", "v", "t", "lookahead_time", "gain"],
        arm::servoj,
    ),
    evaluated("set_gravity", 1, &["d"], arm::set_gravity),
    evaluated("set_payload", 1, &["m", "cog"], arm::set_payload),
    evaluated("set_payload_cog", 1, &["cog"], arm::set_centre),
    evaluated("set_payload_mass", 1, &["m"], arm::set_mass),
    evaluated(
        "set_target_payload",
        1,
        &["m", "cog", "inertia", "transition_time"],
        arm::set_payload,
    ),
    evaluated("set_tcp", 1, &["pose", "tcp_name"], arm::set_tcp),
    evaluated("sin", 1, &["f"], math::sin),
    evaluated("size", 1, &["v"], texts::length),
    evaluated("sleep", 1, &["t"], arm::sleep),
    evaluated("sqrt", 1, &["f"], math::sqrt),
    evaluated("stopj", 1, &["a"], arm::stopj),
    evaluated("stopl", 1, &["a", "aRot"], arm::stopl),
    evaluated("str_cat", 2, &["op1", "op2"], texts::concatenate),
    evaluated("str_empty", 1, &["str"], texts::is_empty),
    evaluated("str_len", 1, &["str"], texts::length),
    evaluated("sync", 0, &[], arm::sync),
    evaluated("tan", 1, &["f"], math::tan),
    evaluated("textmsg", 1, &["s1", "s2"], texts::message),
    evaluated("to_num", 1, &["str"], texts::number),
    evaluated("to_str", 1, &["val"], texts::to_text),
    evaluated(
        "popup",
        1,
        &["s", "title", "warning", "error", "blocking"],
        texts::popup,
    ),
];

/// What changes nothing of the motion, with what is noted of it.
static NOTHING: [(&str, &[&str]); 3] = [
    (
        "settings of the controller that are not simulated",
        &[
            "modbus_set_digital_input_action",
            "modbus_set_output_runstate",
            "modbus_set_runstate_dependent_choice",
            "modbus_set_signal_update_frequency",
            "set_analog_inputrange",
            "set_analog_outputdomain",
            "set_baselight_off",
            "set_baselight_on_default",
            "set_configurable_digital_input_action",
            "set_euromap_input_action",
            "set_euromap_runstate_dependent_choice",
            "set_gp_boolean_input_action",
            "set_gp_boolean_output_action",
            "set_input_actions_to_default",
            "set_runstate_configurable_digital_output_to_value",
            "set_runstate_gp_boolean_output_to_value",
            "set_runstate_standard_analog_output_to_value",
            "set_runstate_standard_digital_output_to_value",
            "set_runstate_tool_digital_output_to_value",
            "set_safety_mode_transition_hardness",
            "set_standard_analog_input_domain",
            "set_standard_digital_input_action",
            "set_target_payload_inertia",
            "set_tool_analog_input_domain",
            "set_tool_communication",
            "set_tool_digital_input_action",
            "set_tool_digital_output_mode",
            "set_tool_output_mode",
            "set_tool_voltage",
        ],
    ),
    (
        "outputs, which nothing here reads",
        &[
            "modbus_set_output_register",
            "modbus_set_output_signal",
            "set_analog_out",
            "set_configurable_digital_out",
            "set_digital_out",
            "set_euromap_output",
            "set_flag",
            "set_standard_analog_out",
            "set_standard_digital_out",
            "set_tool_digital_out",
            "write_output_boolean_register",
            "write_output_float_register",
            "write_output_integer_register",
            "write_port_bit",
            "write_port_register",
        ],
    ),
    ("messages to a person, answered at once", &["beep"]),
];

/// What is known and not evaluated, with the reason.
static REFUSED: [(Reason, &[&str]); 12] = [
    (
        Reason::Measured,
        &[
            "force",
            "get_actual_joint_positions_history",
            "get_actual_joint_speeds",
            "get_actual_payload",
            "get_actual_tcp_speed",
            "get_conf_estimated_payload",
            "get_controller_temp",
            "get_joint_speeds",
            "get_joint_temp",
            "get_joint_torques",
            "get_tcp_force",
            "get_tool_accelerometer_reading",
            "get_tool_current",
            "is_steady",
            "tool_contact",
            "estimate_payload",
            "get_actual_joint_accelerations",
        ],
    ),
    (
        Reason::Input,
        &[
            "encoder_get_tick_count",
            "get_analog_in",
            "get_configurable_digital_in",
            "get_configurable_digital_out",
            "get_digital_in",
            "get_digital_out",
            "get_euromap_input",
            "get_euromap_output",
            "get_flag",
            "get_standard_analog_in",
            "get_standard_analog_out",
            "get_standard_digital_in",
            "get_standard_digital_out",
            "get_tool_analog_in",
            "get_tool_digital_in",
            "get_tool_digital_out",
            "read_input_boolean_register",
            "read_input_float_register",
            "read_input_integer_register",
            "read_output_boolean_register",
            "read_output_float_register",
            "read_output_integer_register",
            "read_port_bit",
            "read_port_register",
        ],
    ),
    (
        Reason::Network,
        &[
            "interpreter_mode",
            "clear_interpreter",
            "end_interpreter",
            "get_interpreter_status",
            "modbus_add_rtu_signal",
            "modbus_add_signal",
            "modbus_delete_signal",
            "modbus_get_error",
            "modbus_get_signal_error",
            "modbus_get_signal_status",
            "modbus_get_time_since_signal_invalid",
            "modbus_reset_connection",
            "modbus_send_custom_command",
            "rpc_factory",
            "rtde_set_watchdog",
            "profinet_set_watchdog",
            "eip_set_watchdog",
            "socket_close",
            "socket_get_var",
            "socket_open",
            "socket_read_ascii_float",
            "socket_read_binary_integer",
            "socket_read_byte_list",
            "socket_read_line",
            "socket_read_string",
            "socket_send_byte",
            "socket_send_int",
            "socket_send_line",
            "socket_send_string",
            "socket_set_var",
        ],
    ),
    (
        Reason::Person,
        &[
            "request_boolean_from_primary_client",
            "request_float_from_primary_client",
            "request_integer_from_primary_client",
            "request_string_from_primary_client",
        ],
    ),
    (
        Reason::Force,
        &[
            "direct_torque",
            "end_force_mode",
            "end_freedrive_mode",
            "end_screw_driving",
            "end_teach_mode",
            "enable_external_ft_sensor",
            "force_mode",
            "force_mode_example",
            "force_mode_set_damping",
            "force_mode_set_gain_scaling",
            "freedrive_mode",
            "freedrive_mode_no_incorrect_payload_check",
            "ft_rtde_input_enable",
            "get_freedrive_status",
            "screw_driving",
            "teach_mode",
            "zero_ftsensor",
        ],
    ),
    (Reason::Speed, &["speedj", "speedl"]),
    (
        Reason::Tracking,
        &[
            "conveyor_pulse_decode",
            "encoder_enable_pulse_decode",
            "encoder_enable_set_tick_count",
            "encoder_set_tick_count",
            "encoder_unwind_delta_tick_count",
            "get_conveyor_tick_count",
            "path_offset_disable",
            "path_offset_enable",
            "path_offset_get",
            "path_offset_set",
            "path_offset_set_alpha_filter",
            "path_offset_set_max_offset",
            "reset_revolution_counter",
            "reset_world_model",
            "set_conveyor_tick_count",
            "stop_conveyor_tracking",
            "track_conveyor_circular",
            "track_conveyor_linear",
        ],
    ),
    (
        Reason::Planned,
        &["optimovej", "optimovel", "pause_on_error_code", "servoc"],
    ),
    (Reason::Chance, &["random"]),
    (Reason::Clock, &["time", "get_robot_uptime"]),
    (
        Reason::Safety,
        &[
            "get_safety_mode",
            "get_robot_mode",
            "is_within_safety_limits",
            "position_deviation_warning",
            "powerdown",
            "protective_stop",
            "set_unlock_protective_stop",
            "unlock_protective_stop",
        ],
    ),
    (
        Reason::Language,
        &[
            "get_coriolis_and_centrifugal_torques",
            "get_gravity_torques",
            "get_jacobian",
            "get_jacobian_time_derivative",
            "get_mass_matrix",
            "get_target_joint_speeds",
            "get_target_tcp_speed",
            "get_target_waypoint",
            "tool_contact_examples",
            "wrench_trans",
            "assert",
            "binary_list_to_integer",
            "integer_to_binary_list",
            "inv",
            "quit",
            "str_at",
            "str_find",
            "str_sub",
            "struct",
            "transpose",
        ],
    ),
];

/// The built-in function of a name.
pub(crate) fn builtin(name: &str) -> Option<Builtin> {
    if let Some(found) = EVALUATED.iter().find(|each| each.name == name) {
        return Some(Builtin {
            name: found.name,
            parameters: found.parameters,
            required: found.required,
            does: found.does,
        });
    }
    let other = |name, does| Builtin {
        name,
        parameters: &[],
        required: 0,
        does,
    };
    for (note, names) in &NOTHING {
        if let Some(name) = names.iter().find(|each| **each == name) {
            return Some(other(name, Does::Nothing(note)));
        }
    }
    for (reason, names) in &REFUSED {
        if let Some(name) = names.iter().find(|each| **each == name) {
            return Some(other(name, Does::Refused(*reason)));
        }
    }
    None
}
