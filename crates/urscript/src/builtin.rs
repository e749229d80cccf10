//! The names that are built into the language, and what becomes of their calls.

use crate::call::Call;
use crate::functions::controller::{Elements, read, write};
use crate::functions::{arm, controller, math, matrices, poses, sockets, texts};
use crate::host::{Bank, Message};
use crate::live::{Live, LiveFunction, Reply};
use crate::place::ScriptError;
use crate::value::Value;

/// A built-in function.
#[derive(Clone, Copy)]
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
    /// Its arguments decide its value.
    Compute(fn(&Call) -> Result<Value, ScriptError>),
    /// It acts upon the controller, or reads it.
    Call(LiveFunction),
    /// It reads an element of a bank.
    Read(Elements),
    /// It writes one.
    Write(Elements),
    /// Nothing, with a note.
    Nothing(&'static str),
    /// It is an exception.
    Refused(Reason),
}

impl Builtin {
    /// The parameters are known.
    pub fn has_parameters(&self) -> bool {
        !matches!(self.does, Does::Nothing(_) | Does::Refused(_))
    }

    /// Its calls change nothing, and are noted.
    pub fn only_notes(&self) -> bool {
        matches!(self.does, Does::Nothing(_))
    }

    /// The first parameter that has to be given and is not.
    pub fn missing(&self, is_given: impl Fn(usize) -> bool) -> Option<&'static str> {
        let missing = (0..self.required).find(|index| !is_given(*index));
        missing.map(|index| self.parameters[index])
    }

    /// Does a call.
    pub fn run(&self, live: &mut Live<'_>, call: &Call) -> Result<Reply, ScriptError> {
        match self.does {
            Does::Compute(function) => function(call).map(Reply::Value),
            Does::Call(function) => function(live, call),
            Does::Read(elements) => read(live, call, elements),
            Does::Write(elements) => write(live, call, elements),
            Does::Nothing(note) => {
                let message = Message::NotSimulated(note);
                live.host.message(message, call.place);
                Ok(Reply::Value(Value::Nothing))
            }
            Does::Refused(reason) => Err(call.error(reason.in_words())),
        }
    }
}

/// Why a call is not simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reason {
    Measured,
    Input,
    Network,
    Person,
    Force,
    Tracking,
    Planned,
    Chance,
    Clock,
    Safety,
    Language,
}

impl Reason {
    /// What the function does, and that it is not simulated.
    pub fn in_words(self) -> String {
        let what = match self {
            Self::Measured => "reads the arm's measured state",
            Self::Input => "reads an input of the controller",
            Self::Network => "exchanges data with another device or program",
            Self::Person => "waits for a person's answer",
            Self::Force => "moves by forces, or with the arm's stiffness changed",
            Self::Tracking => "moves with a conveyor, or on an offset",
            Self::Planned => "moves on a course that only the controller knows",
            Self::Chance => "is random",
            Self::Clock => "reads the clock",
            Self::Safety => "depends on the robot's safety configuration, or changes its state",
            Self::Language => return "it is not simulated".to_owned(),
        };
        format!("it {what}, which is not simulated")
    }
}

const fn function(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    does: Does,
) -> Builtin {
    Builtin {
        name,
        parameters,
        required,
        does,
    }
}

const fn computed(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    computes: fn(&Call) -> Result<Value, ScriptError>,
) -> Builtin {
    function(name, required, parameters, Does::Compute(computes))
}

const fn call(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    calls: LiveFunction,
) -> Builtin {
    function(name, required, parameters, Does::Call(calls))
}

const fn reads(name: &'static str, parameters: &'static [&'static str], of: Elements) -> Builtin {
    function(name, 1, parameters, Does::Read(of))
}

const fn writes(name: &'static str, parameters: &'static [&'static str], of: Elements) -> Builtin {
    function(name, 2, parameters, Does::Write(of))
}

/// Functions by name.
static FUNCTIONS: [Builtin; 134] = [
    computed("acos", 1, &["f"], math::acos),
    computed("asin", 1, &["f"], math::asin),
    computed("atan", 1, &["f"], math::atan),
    computed("atan2", 2, &["x", "y"], math::atan2),
    computed("binary_list_to_integer", 1, &["l"], texts::of_bits),
    computed("ceil", 1, &["f"], math::ceil),
    computed("cos", 1, &["f"], math::cos),
    computed("d2r", 1, &["d"], math::d2r),
    computed("floor", 1, &["f"], math::floor),
    call("force", 0, &[], controller::force),
    call("get_actual_joint_positions", 0, &[], |live, _| {
        controller::joints(live, |state| &state.joints)
    }),
    call(
        "get_actual_joint_positions_history",
        0,
        &["steps"],
        controller::joints_ago,
    ),
    call("get_actual_joint_speeds", 0, &[], |live, _| {
        controller::joints(live, |state| &state.joint_speeds)
    }),
    call("get_actual_tcp_pose", 0, &[], controller::tcp_pose),
    call("get_actual_tcp_speed", 0, &[], |live, _| {
        controller::six(live, |state| &state.tool_speed)
    }),
    call(
        "get_actual_tool_flange_pose",
        0,
        &[],
        controller::flange_pose,
    ),
    reads("get_analog_in", &["n"], Elements::all(Bank::AnalogInput)),
    reads(
        "get_configurable_digital_in",
        &["n"],
        Elements {
            bank: Bank::DigitalInput,
            first: 8,
            count: 8,
        },
    ),
    reads(
        "get_configurable_digital_out",
        &["n"],
        Elements {
            bank: Bank::DigitalOutput,
            first: 8,
            count: 8,
        },
    ),
    reads("get_digital_in", &["n"], Elements::all(Bank::DigitalInput)),
    reads(
        "get_digital_out",
        &["n"],
        Elements::all(Bank::DigitalOutput),
    ),
    reads("get_flag", &["n"], Elements::all(Bank::Flag)),
    call("get_forward_kin", 0, &["q", "tcp"], arm::forward),
    call(
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
    call(
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
    call("get_joint_positions", 0, &[], |live, _| {
        controller::joints(live, |state| &state.joints)
    }),
    call("get_joint_speeds", 0, &[], |live, _| {
        controller::joints(live, |state| &state.joint_speeds)
    }),
    call("get_joint_torques", 0, &[], |live, _| {
        controller::joints(live, |state| &state.joint_torques)
    }),
    computed("get_list_length", 1, &["v"], texts::length),
    call("get_robot_mode", 0, &[], controller::robot_mode),
    call("get_safety_mode", 0, &[], controller::safety_mode),
    reads(
        "get_standard_analog_in",
        &["n"],
        Elements {
            bank: Bank::AnalogInput,
            first: 0,
            count: 2,
        },
    ),
    reads(
        "get_standard_analog_out",
        &["n"],
        Elements::all(Bank::AnalogOutput),
    ),
    reads(
        "get_standard_digital_in",
        &["n"],
        Elements {
            bank: Bank::DigitalInput,
            first: 0,
            count: 8,
        },
    ),
    reads(
        "get_standard_digital_out",
        &["n"],
        Elements {
            bank: Bank::DigitalOutput,
            first: 0,
            count: 8,
        },
    ),
    call("get_steptime", 0, &[], arm::period),
    call("get_target_joint_positions", 0, &[], arm::target_joints),
    call("get_target_joint_speeds", 0, &[], |live, _| {
        controller::joints(live, |state| &state.target_joint_speeds)
    }),
    call("get_target_payload", 0, &[], arm::payload),
    call("get_target_tcp_pose", 0, &[], arm::target_tcp),
    call("get_target_tcp_speed", 0, &[], |live, _| {
        controller::six(live, |state| &state.target_tool_speed)
    }),
    call("get_tcp_force", 0, &[], |live, _| {
        controller::six(live, |state| &state.tool_force)
    }),
    call("get_tcp_offset", 0, &[], arm::tcp_offset),
    reads(
        "get_tool_analog_in",
        &["n"],
        Elements {
            bank: Bank::AnalogInput,
            first: 2,
            count: 2,
        },
    ),
    reads(
        "get_tool_digital_in",
        &["n"],
        Elements {
            bank: Bank::DigitalInput,
            first: 16,
            count: 2,
        },
    ),
    reads(
        "get_tool_digital_out",
        &["n"],
        Elements {
            bank: Bank::DigitalOutput,
            first: 16,
            count: 2,
        },
    ),
    computed("integer_to_binary_list", 1, &["x"], texts::bits),
    computed(
        "interpolate_pose",
        3,
        &["p_from", "p_to", "alpha"],
        poses::interpolate,
    ),
    computed("inv", 1, &["m"], matrices::inverse),
    call("is_steady", 0, &[], controller::is_steady),
    call(
        "is_within_safety_limits",
        1,
        &["pose"],
        controller::is_within_limits,
    ),
    computed("length", 1, &["v"], texts::length),
    computed("log", 2, &["b", "f"], math::log),
    call(
        "movec",
        2,
        &["pose_via", "pose_to", "a", "v", "r", "mode"],
        arm::movec,
    ),
    call("movej", 1, &["q", "a", "v", "t", "r"], arm::movej),
    call("movel", 1, &["pose", "a", "v", "t", "r"], arm::movel),
    call("movep", 1, &["pose", "a", "v", "r"], arm::movep),
    computed("norm", 1, &["a"], math::norm),
    computed("normalize", 1, &["v"], math::normalize),
    call("optimovej", 1, &["q", "a", "v", "r"], controller::optimovej),
    call(
        "optimovel",
        1,
        &["pose", "a", "v", "r"],
        controller::optimovel,
    ),
    computed("point_dist", 2, &["p_from", "p_to"], poses::distance),
    call(
        "popup",
        1,
        &["s", "title", "warning", "error", "blocking"],
        controller::popup,
    ),
    computed("pose_add", 2, &["p_1", "p_2"], poses::add),
    computed("pose_dist", 2, &["p_from", "p_to"], poses::distance),
    computed("pose_inv", 1, &["p_from"], poses::inverse),
    computed("pose_sub", 2, &["p_to", "p_from"], poses::subtract),
    computed("pose_trans", 2, &["p_from", "p_from_to"], poses::transform),
    computed("pow", 2, &["base", "exponent"], math::pow),
    call("protective_stop", 0, &[], controller::protective_stop),
    computed("r2d", 1, &["r"], math::r2d),
    reads(
        "read_input_boolean_register",
        &["address"],
        Elements::all(Bank::InputBoolean),
    ),
    reads(
        "read_input_float_register",
        &["address"],
        Elements::all(Bank::InputFloat),
    ),
    reads(
        "read_input_integer_register",
        &["address"],
        Elements::all(Bank::InputInteger),
    ),
    reads(
        "read_output_boolean_register",
        &["address"],
        Elements::all(Bank::OutputBoolean),
    ),
    reads(
        "read_output_float_register",
        &["address"],
        Elements::all(Bank::OutputFloat),
    ),
    reads(
        "read_output_integer_register",
        &["address"],
        Elements::all(Bank::OutputInteger),
    ),
    computed(
        "rotvec2rpy",
        1,
        &["rotation_vector"],
        poses::rpy_from_vector,
    ),
    computed("rpy2rotvec", 1, &["rpy_vector"], poses::vector_from_rpy),
    call(
        "rtde_set_watchdog",
        2,
        &["variable_name", "min_frequency", "action"],
        controller::set_watchdog,
    ),
    call("servoc", 1, &["pose", "a", "v", "r"], controller::servoc),
    call(
        "servoj",
        1,
        &["q", "a", "v", "t", "lookahead_time", "gain"],
        arm::servoj,
    ),
    writes(
        "set_analog_out",
        &["n", "f"],
        Elements::all(Bank::AnalogOutput),
    ),
    writes(
        "set_configurable_digital_out",
        &["n", "b"],
        Elements {
            bank: Bank::DigitalOutput,
            first: 8,
            count: 8,
        },
    ),
    writes(
        "set_digital_out",
        &["n", "b"],
        Elements::all(Bank::DigitalOutput),
    ),
    writes("set_flag", &["n", "b"], Elements::all(Bank::Flag)),
    call("set_gravity", 1, &["d"], arm::set_gravity),
    call("set_payload", 1, &["m", "cog"], arm::set_payload),
    call("set_payload_cog", 1, &["cog"], arm::set_centre),
    call("set_payload_mass", 1, &["m"], arm::set_mass),
    writes(
        "set_standard_analog_out",
        &["n", "f"],
        Elements::all(Bank::AnalogOutput),
    ),
    writes(
        "set_standard_digital_out",
        &["n", "b"],
        Elements {
            bank: Bank::DigitalOutput,
            first: 0,
            count: 8,
        },
    ),
    call(
        "set_target_payload",
        1,
        &["m", "cog", "inertia", "transition_time"],
        arm::set_payload,
    ),
    call("set_tcp", 1, &["pose", "tcp_name"], arm::set_tcp),
    writes(
        "set_tool_digital_out",
        &["n", "b"],
        Elements {
            bank: Bank::DigitalOutput,
            first: 16,
            count: 2,
        },
    ),
    computed("sin", 1, &["f"], math::sin),
    computed("size", 1, &["v"], matrices::size),
    call("sleep", 1, &["t"], controller::sleep),
    call("socket_close", 0, &["socket_name"], sockets::close),
    call(
        "socket_get_var",
        1,
        &["name", "socket_name"],
        sockets::get_var,
    ),
    call(
        "socket_open",
        2,
        &["address", "port", "socket_name"],
        sockets::open,
    ),
    call(
        "socket_read_ascii_float",
        1,
        &["number", "socket_name", "timeout"],
        sockets::read_floats,
    ),
    call(
        "socket_read_binary_integer",
        1,
        &["number", "socket_name", "timeout"],
        sockets::read_integers,
    ),
    call(
        "socket_read_byte_list",
        1,
        &["number", "socket_name", "timeout"],
        sockets::read_bytes,
    ),
    call(
        "socket_read_line",
        0,
        &["socket_name", "timeout"],
        sockets::read_line,
    ),
    call(
        "socket_read_string",
        0,
        &[
            "socket_name",
            "prefix",
            "suffix",
            "interpret_escape",
            "timeout",
        ],
        sockets::read_string,
    ),
    call(
        "socket_send_byte",
        1,
        &["value", "socket_name"],
        sockets::send_byte,
    ),
    call(
        "socket_send_int",
        1,
        &["value", "socket_name"],
        sockets::send_int,
    ),
    call(
        "socket_send_line",
        1,
        &["str", "socket_name"],
        sockets::send_line,
    ),
    call(
        "socket_send_string",
        1,
        &["str", "socket_name"],
        sockets::send_string,
    ),
    call(
        "socket_set_var",
        2,
        &["name", "value", "socket_name"],
        sockets::set_var,
    ),
    call("speedj", 1, &["qd", "a", "t"], controller::speedj),
    call("speedl", 1, &["xd", "a", "t", "aRot"], controller::speedl),
    computed("sqrt", 1, &["f"], math::sqrt),
    call("stopj", 1, &["a"], arm::stopj),
    call("stopl", 1, &["a", "aRot"], arm::stopl),
    computed("str_at", 2, &["src", "index"], texts::at),
    computed("str_cat", 2, &["op1", "op2"], texts::concatenate),
    computed("str_empty", 1, &["str"], texts::is_empty),
    computed("str_find", 2, &["src", "target", "start_from"], texts::find),
    computed("str_len", 1, &["str"], texts::length),
    computed("str_sub", 2, &["src", "index", "len"], texts::part),
    call("sync", 0, &[], controller::sync),
    computed("tan", 1, &["f"], math::tan),
    call("textmsg", 1, &["s1", "s2"], controller::message),
    call("time", 0, &["mode"], controller::time),
    computed("to_num", 1, &["str"], texts::number),
    computed("to_str", 1, &["val"], texts::to_text),
    call("tool_contact", 0, &["direction"], controller::tool_contact),
    computed("transpose", 1, &["m"], matrices::transpose),
    writes(
        "write_output_boolean_register",
        &["address", "value"],
        Elements::all(Bank::OutputBoolean),
    ),
    writes(
        "write_output_float_register",
        &["address", "value"],
        Elements::all(Bank::OutputFloat),
    ),
    writes(
        "write_output_integer_register",
        &["address", "value"],
        Elements::all(Bank::OutputInteger),
    ),
    call("zero_ftsensor", 0, &[], controller::zero_force),
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
            "modbus_set_signal_watchdog",
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
            "set_euromap_output",
            "write_port_bit",
            "write_port_register",
        ],
    ),
    ("messages to a person, answered at once", &["beep"]),
];

/// What is known and not simulated, with the reason.
static REFUSED: [(Reason, &[&str]); 11] = [
    (
        Reason::Measured,
        &[
            "get_actual_payload",
            "get_conf_estimated_payload",
            "get_controller_temp",
            "get_joint_temp",
            "get_tool_accelerometer_reading",
            "get_tool_current",
            "estimate_payload",
            "get_actual_joint_accelerations",
        ],
    ),
    (
        Reason::Input,
        &[
            "encoder_get_tick_count",
            "get_euromap_input",
            "get_euromap_output",
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
            "eip_reader_factory",
            "eip_writer_factory",
            "get_rtde_value",
            "modbus_add_rw_signal",
            "modbus_add_signal",
            "modbus_delete_signal",
            "modbus_get_error",
            "modbus_get_signal_error",
            "modbus_get_signal_status",
            "modbus_get_time_since_signal_invalid",
            "modbus_reset_connection",
            "modbus_send_custom_command",
            "rpc_factory",
            "profinet_set_watchdog",
            "eip_set_watchdog",
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
        ],
    ),
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
    (Reason::Planned, &["pause_on_error_code"]),
    (Reason::Chance, &["random"]),
    (Reason::Clock, &["get_robot_uptime"]),
    (
        Reason::Safety,
        &[
            "position_deviation_warning",
            "powerdown",
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
            "get_target_payload_cog",
            "get_target_payload_inertia",
            "get_target_waypoint",
            "tool_contact_examples",
            "wrench_trans",
            "assert",
            "quit",
            "struct",
        ],
    ),
];

/// The built-in function of a name.
pub(crate) fn builtin(name: &str) -> Option<Builtin> {
    if let Some(found) = FUNCTIONS.iter().find(|each| each.name == name) {
        return Some(*found);
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
